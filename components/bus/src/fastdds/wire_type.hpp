// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One Fast DDS type support for every message: the sample says itself how it is serialised.
#pragma once

#include "trigpoint/bus/backend.hpp"

#include <fastdds/dds/topic/TopicDataType.hpp>

namespace trigpoint::bus::fastdds {

/// What passes through Fast DDS's void pointers. Typed and serialised endpoints of one topic can so
/// share one registered type.
struct WireSample {
  const backend::TypeOps* ops{nullptr};
  const void* written{nullptr};   ///< in: the message to serialise
  void* received{nullptr};        ///< in: where to put the message
  std::int64_t largest_bytes{0};  ///< in: of a message that is decoded at all
  bool decoded{false};            ///< out
};

class WireType : public eprosima::fastdds::dds::TopicDataType {
 public:
  explicit WireType(const std::string& dds_name);

  bool serialize(void* sample, eprosima::fastrtps::rtps::SerializedPayload_t* payload) override;
  bool deserialize(eprosima::fastrtps::rtps::SerializedPayload_t* payload, void* sample) override;
  std::function<std::uint32_t()> getSerializedSizeProvider(void* sample) override;
  void* createData() override;
  void deleteData(void* sample) override;
  bool getKey(void* sample, eprosima::fastrtps::rtps::InstanceHandle_t* key, bool md5) override;
};

}  // namespace trigpoint::bus::fastdds
