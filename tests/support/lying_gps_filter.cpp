// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A GPS filter that lies, to see whether the contract's check finds it out:
//   lying_gps_filter zero_covariance | stamps_back | constant_sigma | other_datum | honest
// It holds the last fix between fixes, with what it knows of the truth of that otherwise kept.
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <iostream>
#include <optional>
#include <string>

namespace {

using namespace trigpoint;
namespace topics = bus::topics;

constexpr double kSigma_m = 0.05;
constexpr double kFastest_mps = 6.0;  // it does not know where the vehicle goes
constexpr Nanoseconds kStep_ns = 100'000'000;
constexpr Nanoseconds kReckons_ns = 2 * kNanosecondsPerSecond;

class LyingFilter {
 public:
  LyingFilter(std::string lie, bus::Loop& loop)
      : lie_(std::move(lie)),
        participant_(bus::Config{}, "lying_gps_filter"),
        odometry_(participant_, topics::gps_odometry),
        status_(participant_, topics::gps_status),
        datum_(participant_, topics::datum),
        imu_(participant_,
             topics::imu,
             [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
               loop.post([this, now_ns = bus::from_message(m).stamp_ns] { tick(now_ns); });
             }),
        fixes_(participant_,
               topics::fix,
               [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
                 loop.post([this, fix = bus::from_message(m)] { take(fix); });
               }) {}

 private:
  void take(const GnssFix& fix) {
    if (!frame_) {
      frame_.emplace(Datum{fix.latitude_deg, fix.longitude_deg, fix.altitude_m, fix.stamp_ns});
      said_.datum_id = frame_->datum().id();
      datum_.publish(bus::to_message(frame_->datum()));
    }
    ++said_.fixes_received;
    ++said_.fixes_accepted;
    if (lie_ == "other_datum" && said_.fixes_received == 100) {
      said_.datum_id = Datum{1.0, 2.0, 3.0, 0}.id();
    }
    said_.last_accepted_fix_ns = fix.stamp_ns;
    said_.accepted_antenna_map_m =
        frame_->to_map({fix.latitude_deg, fix.longitude_deg, fix.altitude_m})
            .value_or(Eigen::Vector3d::Zero());
    said_.accepted_covariance_map_m2 = Eigen::Matrix3d::Identity() * kSigma_m * kSigma_m;
    tell(fix.stamp_ns);
  }

  void tick(Nanoseconds now_ns) {
    if (now_ns - said_.stamp_ns >= kNanosecondsPerSecond) {
      tell(now_ns);
    }
    if (!frame_ || now_ns - last_ns_ < kStep_ns) {
      return;
    }
    last_ns_ = now_ns;
    const double age_s = to_seconds(now_ns - said_.last_accepted_fix_ns);
    const double sigma_m =
        lie_ == "constant_sigma" ? kSigma_m : kSigma_m + kFastest_mps * std::max(age_s, 0.0) / 2.0;
    Odometry odometry;
    const bool back = lie_ == "stamps_back" && ++count_ % 7 == 0;
    odometry.stamp_ns = back ? now_ns - 3 * kStep_ns : now_ns;
    odometry.frame_id = "map";
    odometry.child_frame_id = "gnss_antenna";
    odometry.T_frame_child.p = said_.accepted_antenna_map_m;
    odometry.pose_covariance.topLeftCorner<3, 3>() =
        Eigen::Matrix3d::Identity() * sigma_m * sigma_m;
    if (lie_ == "zero_covariance") {
      odometry.pose_covariance.bottomRightCorner<3, 3>().setZero();
      odometry.twist_covariance.setZero();
    }
    odometry_.publish(bus::to_message(odometry));
  }

  void tell(Nanoseconds now_ns) {
    said_.stamp_ns = std::max(said_.stamp_ns, now_ns);
    said_.source = "lying";
    const bool reckons = said_.stamp_ns - said_.last_accepted_fix_ns > kReckons_ns;
    said_.health = said_.fixes_accepted == 0             ? GpsHealth::kInit
                   : reckons && lie_ != "constant_sigma" ? GpsHealth::kDeadReckoning
                                                         : GpsHealth::kOk;
    status_.publish(bus::to_message(said_));
  }

  std::string lie_;
  GpsStatus said_;
  std::optional<geodesy::LocalFrame> frame_;
  Nanoseconds last_ns_{0};
  int count_{0};
  bus::Participant participant_;
  bus::Publisher<nav_msgs::msg::Odometry> odometry_;
  bus::Publisher<trigpoint_msgs::msg::GpsStatus> status_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> datum_;
  bus::Subscription<sensor_msgs::msg::Imu> imu_;
  bus::Subscription<sensor_msgs::msg::NavSatFix> fixes_;
};

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: lying_gps_filter LIE\n";
    return 2;
  }
  trigpoint::bus::Loop loop;
  const LyingFilter filter(argv[1], loop);
  loop.run();
  return 0;
}
