// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ros1_bag.hpp"

#include "as_ros1_messages.hpp"
#include <rosbag/bag.h>

namespace trigpoint::tests {

struct Ros1Bag::Impl {
  rosbag::Bag bag;
};

Ros1Bag::Ros1Bag(const std::string& file) : impl_(std::make_unique<Impl>()) {
  impl_->bag.open(file, rosbag::bagmode::Write);
}

Ros1Bag::~Ros1Bag() = default;

void Ros1Bag::write(const std::string& topic, Nanoseconds receive_ns, const ImuSample& imu) {
  impl_->bag.write(topic, ros_time(receive_ns), ros_imu(imu));
}

void Ros1Bag::write(const std::string& topic, Nanoseconds receive_ns, const GnssFix& fix) {
  impl_->bag.write(topic, ros_time(receive_ns), ros_fix(fix));
}

void Ros1Bag::write(const std::string& topic,
                    Nanoseconds receive_ns,
                    const PointCloudMessage& cloud) {
  impl_->bag.write(topic, ros_time(receive_ns), ros_cloud(cloud));
}

}  // namespace trigpoint::tests
