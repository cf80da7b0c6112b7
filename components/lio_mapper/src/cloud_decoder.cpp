// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/cloud_decoder.hpp"

#include "decoded_cloud.hpp"

#include <utility>

namespace trigpoint::lio_mapper {

DecodedCloud::DecodedCloud(std::unique_ptr<Content> content) : content_(std::move(content)) {}

DecodedCloud::DecodedCloud(const DecodedCloud& other)
    : content_(std::make_unique<Content>(*other.content_)) {}

DecodedCloud& DecodedCloud::operator=(const DecodedCloud& other) {
  content_ = std::make_unique<Content>(*other.content_);
  return *this;
}

DecodedCloud::DecodedCloud(DecodedCloud&&) noexcept = default;
DecodedCloud& DecodedCloud::operator=(DecodedCloud&&) noexcept = default;
DecodedCloud::~DecodedCloud() = default;

void DecodedCloud::set_decoding_ms(double decoding_ms) {
  if (auto* sweep = std::get_if<Sweep>(&content_->sweep)) {
    sweep->decoding_ms = decoding_ms;
  }
}

struct CloudDecoder::Impl {
  SweepDecoder sweeps;
};

CloudDecoder::CloudDecoder(const Config& config)
    : impl_(std::make_unique<Impl>(Impl{SweepDecoder(config.sweep)})) {}

CloudDecoder::~CloudDecoder() = default;

DecodedCloud CloudDecoder::decode(const PointCloudMessage& cloud) {
  auto content = std::make_unique<DecodedCloud::Content>();
  content->stamp_ns = cloud.stamp_ns;
  content->sweep = impl_->sweeps.decode(cloud, content->events);
  return DecodedCloud(std::move(content));
}

}  // namespace trigpoint::lio_mapper
