// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "alignment/heading_prior.hpp"

#include "trigpoint/base/so3.hpp"

#include "alignment/median.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

namespace trigpoint::fusion_gate {

namespace {

constexpr Nanoseconds kInterval_ns = kNanosecondsPerSecond / 2;
constexpr Nanoseconds kHeadingMemory_ns = 30 * kNanosecondsPerSecond;
constexpr std::size_t kMostWaiting = 20;
constexpr std::size_t kLeastSightings = 5;
constexpr double kSigmasOfMedianDeviation = 1.4826;  // of the normal distribution

}  // namespace

void HeadingPrior::hear(const Heading& heading) {
  const Nanoseconds newest_ns = !waiting_.empty()     ? waiting_.back().stamp_ns
                                : !sightings_.empty() ? sightings_.back().stamp_ns
                                                      : -kInterval_ns;
  if (heading.stamp_ns - newest_ns < kInterval_ns) {
    return;
  }
  waiting_.push_back(heading);
  if (waiting_.size() > kMostWaiting) {
    waiting_.pop_front();
  }
}

void HeadingPrior::match(const PoseBuffer& lio_poses) {
  while (!waiting_.empty()) {
    const Heading& heading = waiting_.front();
    const PoseBuffer::Answer lio_pose = lio_poses.at(heading.stamp_ns);
    if (lio_pose.coverage == PoseBuffer::Coverage::kNotYet) {
      return;
    }
    if (lio_pose.coverage == PoseBuffer::Coverage::kCovered) {
      const double yaw_odom_base_rad = yaw_of(lio_pose.sample.T_frame_child.q);
      sightings_.push_back({heading.stamp_ns,
                            wrap_angle(heading.yaw_map_rad - yaw_odom_base_rad),
                            heading.sigma_rad});
      while (sightings_.front().stamp_ns < heading.stamp_ns - kHeadingMemory_ns) {
        sightings_.pop_front();
      }
    }
    waiting_.pop_front();
  }
}

void HeadingPrior::clear() {
  *this = {};
}

std::optional<YawPrior> HeadingPrior::prior() const {
  if (sightings_.size() < kLeastSightings) {
    return std::nullopt;
  }
  double east = 0.0;
  double north = 0.0;
  for (const Sighting& s : sightings_) {
    east += std::cos(s.yaw_map_odom_rad);
    north += std::sin(s.yaw_map_odom_rad);
  }
  const double mean_rad = std::atan2(north, east);
  std::vector<double> from_mean_rad;
  std::vector<double> sigmas_rad;
  for (const Sighting& s : sightings_) {
    from_mean_rad.push_back(wrap_angle(s.yaw_map_odom_rad - mean_rad));
    sigmas_rad.push_back(s.sigma_rad);
  }
  const double middle_rad = median(from_mean_rad);
  for (double& deviation_rad : from_mean_rad) {
    deviation_rad = std::abs(deviation_rad - middle_rad);
  }
  const double scatter_rad = kSigmasOfMedianDeviation * median(from_mean_rad);
  return YawPrior{wrap_angle(mean_rad + middle_rad), std::max(median(sigmas_rad), scatter_rad)};
}

}  // namespace trigpoint::fusion_gate
