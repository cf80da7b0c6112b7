// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One Cyclone DDS type for every message: its samples are the bytes of Fast CDR, so both vendors
// share one set of C++ types and one codec. cyclone_type.cpp is the only file that uses Cyclone's
// unstable headers dds/ddsi/*.
#pragma once

#include "trigpoint/bus/backend.hpp"

#include "buffer_pool.hpp"
#include <dds/dds.h>

#include <atomic>
#include <memory>
#include <span>
#include <string>

namespace trigpoint::bus::cyclonedds {

class Pacer;

/// What is given to dds_write: the sample says itself how it is serialised. Typed and serialised
/// endpoints of one topic can so share one type.
struct WireSample {
  const backend::TypeOps* ops{nullptr};
  const void* value{nullptr};
};

struct Topic {
  dds_entity_t entity{0};             ///< negative: Cyclone's error code
  const ddsi_sertype* type{nullptr};  ///< lives as long as the topic
  /// The participant has, or had, a writer of it.
  std::shared_ptr<std::atomic<bool>> is_written_here{std::make_shared<std::atomic<bool>>(false)};
};

/// Registers the type too.
Topic create_topic(dds_entity_t participant,
                   const std::string& dds_topic,
                   const std::string& dds_type,
                   std::shared_ptr<BufferPool> pool);

/// A message in its wire form, counted by reference.
class WireData {
 public:
  WireData() = default;
  /// Takes over a reference, as dds_takecdr gives it.
  explicit WireData(ddsi_serdata* owned);
  /// Serialised, stamped with the wall clock; paced when it is sent.
  WireData(const Topic& topic, const WireSample& sample, Pacer& pacer);
  ~WireData();
  WireData(WireData&& other) noexcept;
  WireData& operator=(WireData&& other) noexcept;
  WireData(const WireData&) = delete;
  WireData& operator=(const WireData&) = delete;

  explicit operator bool() const { return data_ != nullptr; }

  /// With encapsulation.
  std::span<const std::uint8_t> cdr() const;

  /// Writes it and gives the reference away; the source stamp stays.
  dds_return_t forward_to(dds_entity_t writer);

 private:
  ddsi_serdata* data_{nullptr};
};

}  // namespace trigpoint::bus::cyclonedds
