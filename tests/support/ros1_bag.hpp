// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include <memory>
#include <string>

namespace trigpoint::tests {

/// A ROS 1 bag as ROS 1's own library and messages write it.
class Ros1Bag {
 public:
  explicit Ros1Bag(const std::string& file);
  ~Ros1Bag();
  Ros1Bag(const Ros1Bag&) = delete;
  Ros1Bag& operator=(const Ros1Bag&) = delete;

  void write(const std::string& topic, Nanoseconds receive_ns, const ImuSample& imu);
  void write(const std::string& topic, Nanoseconds receive_ns, const GnssFix& fix);
  void write(const std::string& topic, Nanoseconds receive_ns, const PointCloudMessage& cloud);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::tests
