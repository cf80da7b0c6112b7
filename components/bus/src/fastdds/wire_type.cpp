// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "wire_type.hpp"

namespace trigpoint::bus::fastdds {

namespace {

constexpr std::uint32_t kUsualMessageBytes = 1024;  // larger ones make their buffer grow

}  // namespace

WireType::WireType(const std::string& dds_name) {
  setName(dds_name.c_str());
  m_typeSize = kUsualMessageBytes;
  m_isGetKeyDefined = false;
  auto_fill_type_object(false);  // type information of one side only would prevent a match
  auto_fill_type_information(false);
}

bool WireType::serialize(void* sample, eprosima::fastrtps::rtps::SerializedPayload_t* payload) {
  const auto& wire = *static_cast<const WireSample*>(sample);
  const std::span<std::uint8_t> room(payload->data, payload->max_size);
  payload->encapsulation = CDR_LE;
  payload->length = static_cast<std::uint32_t>(wire.ops->serialize(wire.written, room));
  return payload->length != 0;
}

/// Always true: a malformed sample is consumed, and told by `decoded`.
bool WireType::deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* sample) {
  auto& wire = *static_cast<WireSample*>(sample);
  wire.decoded = wire.ops != nullptr && std::int64_t{payload->length} <= wire.largest_bytes &&
                 wire.ops->deserialize({payload->data, payload->length}, wire.received);
  return true;
}

std::function<std::uint32_t()> WireType::getSerializedSizeProvider(void* sample) {
  const auto* wire = static_cast<const WireSample*>(sample);
  return [wire] { return static_cast<std::uint32_t>(wire->ops->size_bound(wire->written)); };
}

void* WireType::createData() {
  return new WireSample;
}

void WireType::deleteData(void* sample) {
  delete static_cast<WireSample*>(sample);
}

bool WireType::getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) {
  return false;
}

}  // namespace trigpoint::bus::fastdds
