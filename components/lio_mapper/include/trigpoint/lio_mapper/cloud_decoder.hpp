// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include <memory>

namespace trigpoint::lio_mapper {

/// A cloud as a CloudDecoder read it: a sweep, or why it was refused, and what there is to tell.
class DecodedCloud {
 public:
  struct Content;
  explicit DecodedCloud(std::unique_ptr<Content> content);
  /// For another mapper that takes the same cloud.
  DecodedCloud(const DecodedCloud& other);
  DecodedCloud& operator=(const DecodedCloud& other);
  DecodedCloud(DecodedCloud&&) noexcept;
  DecodedCloud& operator=(DecodedCloud&&) noexcept;
  ~DecodedCloud();

  /// Told by the shell, which has a clock; LioStatus::scan_ms of its scan begins with it.
  void set_decoding_ms(double decoding_ms);

 private:
  friend class LioMapper;
  std::unique_ptr<Content> content_;
};

/// The first step of LioMapper::on_cloud by itself, for a shell that decodes the next cloud on
/// another thread while the mapper matches: same clouds in the same order, same bits.
class CloudDecoder {
 public:
  explicit CloudDecoder(const Config& config);
  ~CloudDecoder();

  DecodedCloud decode(const PointCloudMessage& cloud);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::lio_mapper
