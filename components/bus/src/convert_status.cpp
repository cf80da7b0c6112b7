// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// trigpoint_msgs: what the three processes say to each other.
#include "trigpoint/bus/convert.hpp"

#include "message_parts.hpp"

#include <utility>

namespace trigpoint::bus {

namespace {

std::array<double, 3> array_of(const Eigen::Vector3d& vector) {
  return {vector.x(), vector.y(), vector.z()};
}

Eigen::Vector3d vector_of(const std::array<double, 3>& elements) {
  return {elements[0], elements[1], elements[2]};
}

trigpoint_msgs::msg::YawPose to_message(const YawPose& pose) {
  trigpoint_msgs::msg::YawPose message;
  message.yaw_rad(pose.yaw_rad);
  message.position_m(vector_message(pose.p));
  message.tilt_rad({pose.tilt_rad.x(), pose.tilt_rad.y()});
  return message;
}

YawPose from_message(const trigpoint_msgs::msg::YawPose& message) {
  return {message.yaw_rad(),
          bus::vector_of(message.position_m()),
          {message.tilt_rad()[0], message.tilt_rad()[1]}};
}

trigpoint_msgs::msg::ResetInfo to_message(const ResetInfo& reset) {
  trigpoint_msgs::msg::ResetInfo message;
  message.counter(reset.counter);
  message.delta(to_message(reset.delta));
  return message;
}

ResetInfo from_message(const trigpoint_msgs::msg::ResetInfo& message) {
  return {message.counter(), from_message(message.delta())};
}

std::vector<trigpoint_msgs::msg::NamedCount> to_message(const std::vector<NamedCount>& counts) {
  std::vector<trigpoint_msgs::msg::NamedCount> messages;
  for (const NamedCount& count : counts) {
    messages.emplace_back();
    messages.back().name(count.name);
    messages.back().count(count.count);
  }
  return messages;
}

std::vector<NamedCount> from_message(const std::vector<trigpoint_msgs::msg::NamedCount>& messages) {
  std::vector<NamedCount> counts;
  for (const auto& message : messages) {
    counts.push_back({message.name(), message.count()});
  }
  return counts;
}

trigpoint_msgs::msg::Alignment to_message(const Alignment& alignment) {
  trigpoint_msgs::msg::Alignment message;
  message.odom_epoch(alignment.odom_epoch);
  message.T_map_odom(to_message(alignment.T_map_odom));
  message.covariance(row_major(alignment.covariance));
  message.replaces(alignment.replaces);
  return message;
}

Alignment from_message(const trigpoint_msgs::msg::Alignment& message) {
  return {message.odom_epoch(),
          from_message(message.T_map_odom()),
          from_row_major<4>(message.covariance()),
          message.replaces()};
}

trigpoint_msgs::msg::AxisStatus to_message(const AxisStatus& axis) {
  trigpoint_msgs::msg::AxisStatus message;
  message.source(static_cast<std::uint8_t>(axis.source));
  message.sigma_m(axis.sigma_m);
  message.threshold_m(axis.threshold_m);
  message.reason(axis.reason);
  return message;
}

AxisStatus from_message(const trigpoint_msgs::msg::AxisStatus& message) {
  return {enumerator(message.source(), AxisSource::kGps, AxisSource::kNone),
          message.sigma_m(),
          message.threshold_m(),
          message.reason()};
}

trigpoint_msgs::msg::FixVerdict to_message(const FixVerdict& verdict) {
  trigpoint_msgs::msg::FixVerdict message;
  message.fix_stamp(bus::to_message(verdict.fix_stamp_ns));
  message.used(verdict.used);
  message.reason(verdict.reason);
  return message;
}

FixVerdict from_message(const trigpoint_msgs::msg::FixVerdict& message) {
  return {bus::from_message(message.fix_stamp()), message.used(), message.reason()};
}

trigpoint_msgs::msg::FixRecord to_message(const FixRecord& record) {
  trigpoint_msgs::msg::FixRecord message;
  message.stamp(bus::to_message(record.stamp_ns));
  message.accepted(record.accepted);
  message.reason(record.reason);
  message.antenna_map_m(array_of(record.antenna_map_m));
  message.covariance_map_m2(row_major(record.covariance_map_m2));
  return message;
}

FixRecord from_message(const trigpoint_msgs::msg::FixRecord& message) {
  return {bus::from_message(message.stamp()),
          message.accepted(),
          message.reason(),
          vector_of(message.antenna_map_m()),
          from_row_major<3>(message.covariance_map_m2())};
}

}  // namespace

trigpoint_msgs::msg::GpsStatus to_message(const GpsStatus& status) {
  trigpoint_msgs::msg::GpsStatus message;
  message.stamp(to_message(status.stamp_ns));
  message.source(status.source);
  message.health(static_cast<std::uint8_t>(status.health));
  message.datum_id(status.datum_id);
  message.gnss_class(static_cast<std::uint8_t>(status.gnss_class));
  message.last_accepted_fix(to_message(status.last_accepted_fix_ns));
  message.accepted_antenna_map_m(array_of(status.accepted_antenna_map_m));
  message.accepted_covariance_map_m2(row_major(status.accepted_covariance_map_m2));
  message.test_ratio(status.test_ratio);
  message.fixes_received(status.fixes_received);
  message.fixes_accepted(status.fixes_accepted);
  message.rejections(to_message(status.rejections));
  message.imu_received(status.imu_received);
  message.reset(to_message(status.reset));
  for (const FixRecord& record : status.recent_fixes) {
    message.recent_fixes().push_back(to_message(record));
  }
  return message;
}

GpsStatus from_message(const trigpoint_msgs::msg::GpsStatus& message) {
  GpsStatus status;
  status.stamp_ns = from_message(message.stamp());
  status.source = message.source();
  status.health = enumerator(message.health(), GpsHealth::kFault, GpsHealth::kFault);
  status.datum_id = message.datum_id();
  status.gnss_class = enumerator(message.gnss_class(), GnssClass::kFixed, GnssClass::kUnknown);
  status.last_accepted_fix_ns = from_message(message.last_accepted_fix());
  status.accepted_antenna_map_m = vector_of(message.accepted_antenna_map_m());
  status.accepted_covariance_map_m2 = from_row_major<3>(message.accepted_covariance_map_m2());
  status.test_ratio = message.test_ratio();
  status.fixes_received = message.fixes_received();
  status.fixes_accepted = message.fixes_accepted();
  status.rejections = from_message(message.rejections());
  status.imu_received = message.imu_received();
  status.reset = from_message(message.reset());
  for (const auto& record : message.recent_fixes()) {
    status.recent_fixes.push_back(from_message(record));
  }
  return status;
}

trigpoint_msgs::msg::LioStatus to_message(const LioStatus& status) {
  trigpoint_msgs::msg::LioStatus message;
  message.stamp(to_message(status.stamp_ns));
  message.odom_epoch(status.odom_epoch);
  message.health(static_cast<std::uint8_t>(status.health));
  message.observability(status.observability);
  message.sigma(status.sigma);
  message.reset(to_message(status.reset));
  message.aligned(status.aligned);
  message.T_map_odom(to_message(status.T_map_odom));
  message.T_map_odom_covariance(row_major(status.T_map_odom_covariance));
  message.rows_applied(status.rows_applied);
  message.rows_refused(status.rows_refused);
  message.last_refusal(status.last_refusal);
  message.last_row_fix(to_message(status.last_row_fix_ns));
  message.scans_received(status.scans_received);
  message.scans_used(status.scans_used);
  message.scans_refused(to_message(status.scans_refused));
  message.imu_received(status.imu_received);
  message.distance_m(status.distance_m);
  message.scan_ms(status.scan_ms);
  return message;
}

LioStatus from_message(const trigpoint_msgs::msg::LioStatus& message) {
  LioStatus status;
  status.stamp_ns = from_message(message.stamp());
  status.odom_epoch = message.odom_epoch();
  status.health = enumerator(message.health(), LioHealth::kStale, LioHealth::kLost);
  status.observability = message.observability();
  status.sigma = message.sigma();
  status.reset = from_message(message.reset());
  status.aligned = message.aligned();
  status.T_map_odom = from_message(message.T_map_odom());
  status.T_map_odom_covariance = from_row_major<6>(message.T_map_odom_covariance());
  status.rows_applied = message.rows_applied();
  status.rows_refused = message.rows_refused();
  status.last_refusal = message.last_refusal();
  status.last_row_fix_ns = from_message(message.last_row_fix());
  status.scans_received = message.scans_received();
  status.scans_used = message.scans_used();
  status.scans_refused = from_message(message.scans_refused());
  status.imu_received = message.imu_received();
  status.distance_m = message.distance_m();
  status.scan_ms = message.scan_ms();
  return status;
}

trigpoint_msgs::msg::StateUpdate to_message(const StateUpdate& update) {
  trigpoint_msgs::msg::StateUpdate message;
  message.fix_stamp(to_message(update.fix_stamp_ns));
  message.mode(static_cast<std::uint8_t>(update.mode));
  for (std::size_t axis = 0; axis < update.decision.size(); ++axis) {
    message.decision()[axis] = static_cast<std::uint8_t>(update.decision[axis]);
  }
  message.position_map_m(array_of(update.position_map_m));
  message.covariance_map_m2(row_major(update.covariance_map_m2));
  message.inflation(update.inflation);
  message.lever_arm_base_m(array_of(update.lever_arm_base_m));
  message.has_first_alignment(update.first_alignment.has_value());
  message.first_alignment(to_message(update.first_alignment.value_or(Alignment{})));
  return message;
}

StateUpdate from_message(const trigpoint_msgs::msg::StateUpdate& message) {
  StateUpdate update;
  update.fix_stamp_ns = from_message(message.fix_stamp());
  update.mode = enumerator(message.mode(), UpdateMode::kOverwrite, UpdateMode::kRows);
  for (std::size_t axis = 0; axis < update.decision.size(); ++axis) {
    update.decision[axis] =
        enumerator(message.decision()[axis], AxisDecision::kCoast, AxisDecision::kLio);
  }
  update.position_map_m = vector_of(message.position_map_m());
  update.covariance_map_m2 = from_row_major<3>(message.covariance_map_m2());
  update.inflation = message.inflation();
  update.lever_arm_base_m = vector_of(message.lever_arm_base_m());
  if (message.has_first_alignment()) {
    update.first_alignment = from_message(message.first_alignment());
  }
  return update;
}

trigpoint_msgs::msg::FusionStatus to_message(const FusionStatus& status) {
  trigpoint_msgs::msg::FusionStatus message;
  message.stamp(to_message(status.stamp_ns));
  message.mode(status.mode);
  for (std::size_t axis = 0; axis < status.axes.size(); ++axis) {
    message.axes()[axis] = to_message(status.axes[axis]);
  }
  message.aligned(status.aligned);
  message.T_map_odom(to_message(status.T_map_odom));
  message.yaw_sigma_rad(status.yaw_sigma_rad);
  message.position_sigma_m(status.position_sigma_m);
  message.verdict(to_message(status.verdict));
  message.fixes_seen(status.fixes_seen);
  message.fixes_used(status.fixes_used);
  message.verdicts(to_message(status.verdicts));
  message.gps_source(status.gps_source);
  for (const FixVerdict& verdict : status.judged) {
    message.judged().push_back(to_message(verdict));
  }
  return message;
}

FusionStatus from_message(const trigpoint_msgs::msg::FusionStatus& message) {
  FusionStatus status;
  status.stamp_ns = from_message(message.stamp());
  status.mode = message.mode();
  for (std::size_t axis = 0; axis < status.axes.size(); ++axis) {
    status.axes[axis] = from_message(message.axes()[axis]);
  }
  status.aligned = message.aligned();
  status.T_map_odom = from_message(message.T_map_odom());
  status.yaw_sigma_rad = message.yaw_sigma_rad();
  status.position_sigma_m = message.position_sigma_m();
  status.verdict = from_message(message.verdict());
  status.fixes_seen = message.fixes_seen();
  status.fixes_used = message.fixes_used();
  status.verdicts = from_message(message.verdicts());
  status.gps_source = message.gps_source();
  for (const auto& verdict : message.judged()) {
    status.judged.push_back(from_message(verdict));
  }
  return status;
}

}  // namespace trigpoint::bus
