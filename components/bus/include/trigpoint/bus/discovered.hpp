// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/qos.hpp"

#include <optional>
#include <string>

namespace trigpoint::bus {

/// A writer or reader of another participant as it was announced, on whatever topic.
struct DiscoveredEndpoint {
  std::string guid{};  ///< 32 hexadecimal digits; the first 24 are its participant's
  bool writes{true};
  std::string dds_topic{};  ///< "rt/imu/data"
  std::string dds_type{};   ///< "sensor_msgs::msg::dds_::Imu_"
  Reliability reliability{Reliability::kReliable};
  Durability durability{Durability::kVolatile};
  std::optional<unsigned> process{};  ///< its number, where it can be told
};

}  // namespace trigpoint::bus
