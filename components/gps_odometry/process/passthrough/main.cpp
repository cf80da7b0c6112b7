// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The smallest GPS filter that keeps the contract, to be copied: every fix becomes an odometry of
// the antenna. docs/write_a_gps_filter.md says why each line is there.
#include "trigpoint/base/robot.hpp"
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/convert.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"
#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/shell/shell.hpp"

#include <Eigen/Cholesky>

namespace {

using namespace trigpoint;
namespace topics = bus::topics;

constexpr double kVarianceScale = 4.0;  // receivers are optimistic: twice the sigma they report
constexpr double kLeastSigma_m = 0.03;
constexpr double kAssumedSigma_m = 5.0;  // of a receiver that does not say
constexpr Nanoseconds kDatumWait_ns = 2 * kNanosecondsPerSecond;
constexpr int kDatumFixes = 10;

class Passthrough {
 public:
  Passthrough(const RobotConfig& robot, const bus::Config& config, bus::Loop& loop)
      : geoid_undulation_m_(robot.geoid_undulation_m),
        participant_(config, "gps_passthrough"),
        odometry_(participant_, topics::gps_odometry),
        status_(participant_, topics::gps_status),
        datum_(participant_, topics::datum),
        datums_(participant_,
                topics::datum,
                [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo& info) {
                  if (info.writer_guid != datum_.guid()) {
                    loop.post([this, d = bus::datum_from_message(m)] { adopt(d); });
                  }
                }),
        imu_(participant_,
             topics::imu.renamed(robot.imu_topic),
             [this, &loop](const sensor_msgs::msg::Imu& m, const bus::MessageInfo&) {
               loop.post(
                   [this, stamp_ns = bus::from_message(m.header().stamp())] { tick(stamp_ns); });
             }),
        fixes_(participant_,
               topics::fix.renamed(robot.fix_topic),
               [this, &loop](const sensor_msgs::msg::NavSatFix& m, const bus::MessageInfo&) {
                 loop.post([this, fix = bus::from_message(m)] { take(fix); });
               }) {}

 private:
  /// Data time is what the sensors' stamps say. It goes on when no fixes come: the status must,
  /// too, and at once when health changes by time alone: the gate may have a better filter.
  void tick(Nanoseconds stamp_ns) {
    now_ns_ = stamp_ns;
    if (now_ns_ < told_ns_ || now_ns_ - told_ns_ >= kNanosecondsPerSecond ||
        health() != said_.health) {
      tell();
    }
  }

  void take(const GnssFix& fix) {
    ++said_.fixes_received;
    const geodesy::Geographic place{
        fix.latitude_deg, fix.longitude_deg, fix.altitude_m + geoid_undulation_m_};
    if (fix.status < FixStatus::kFix || fix.stamp_ns <= newest_ns_ || geodesy::find_fault(place)) {
      said_.rejections = {{"unusable", ++unusable_}};
    } else {
      newest_ns_ = fix.stamp_ns;
      now_ns_ = std::max(now_ns_, fix.stamp_ns);
      elect(place, fix.stamp_ns);
      publish(fix, place);
    }
    tell();
  }

  void publish(const GnssFix& fix, const geodesy::Geographic& place) {
    const auto position = frame_ ? frame_->to_map(place) : std::nullopt;
    if (!position) {
      return;
    }
    ++said_.fixes_accepted;
    said_.last_accepted_fix_ns = fix.stamp_ns;
    said_.accepted_antenna_map_m = *position;
    said_.accepted_covariance_map_m2 = covariance_of(fix, frame_->R_map_enu(place));
    Odometry odometry;  // orientation and twist are not known: its covariances begin as 1e6
    odometry.stamp_ns = fix.stamp_ns;
    odometry.frame_id = "map";
    odometry.child_frame_id = "gnss_antenna";
    odometry.T_frame_child.p = *position;
    odometry.pose_covariance.topLeftCorner<3, 3>() = said_.accepted_covariance_map_m2;
    odometry_.publish(bus::to_message(odometry));
  }

  /// What the receiver says when it is symmetric and positive, never less than a floor.
  Eigen::Matrix3d covariance_of(const GnssFix& fix, const Eigen::Matrix3d& R_map_enu) {
    const Eigen::Matrix3d& reported = fix.covariance_enu_m2;
    assumed_ = fix.covariance_type == CovarianceType::kUnknown || !reported.allFinite() ||
               !reported.isApprox(reported.transpose(), 1e-6) ||
               reported.llt().info() != Eigen::Success;
    const Eigen::Matrix3d own = Eigen::Matrix3d::Identity() * kAssumedSigma_m * kAssumedSigma_m;
    const Eigen::Matrix3d enu = assumed_ ? own : Eigen::Matrix3d(kVarianceScale * reported);
    return R_map_enu * enu * R_map_enu.transpose() +
           Eigen::Matrix3d::Identity() * kLeastSigma_m * kLeastSigma_m;
  }

  /// Nobody named a datum for two seconds: the mean of ten fixes about the first of them.
  void elect(const geodesy::Geographic& place, Nanoseconds stamp_ns) {
    if (frame_) {
      return;
    }
    first_ns_ = first_ns_ > 0 ? first_ns_ : stamp_ns;
    if (!candidate_) {
      candidate_.emplace(Datum{place.latitude_deg, place.longitude_deg, place.height_m, 0});
    }
    sum_m_ += candidate_->to_map(place).value_or(Eigen::Vector3d::Zero());
    if (++candidates_ >= kDatumFixes && stamp_ns - first_ns_ >= kDatumWait_ns) {
      const auto mean = candidate_->to_geographic(sum_m_ / candidates_);
      adopt({mean.latitude_deg, mean.longitude_deg, mean.height_m, stamp_ns});
    }
  }

  /// The older election wins; whoever knows the datum publishes it.
  void adopt(const Datum& datum) {
    const bool older = !frame_ || datum.elected_ns < frame_->datum().elected_ns;
    if (older && !geodesy::find_fault(geodesy::place_of(datum))) {
      frame_.emplace(datum);
      said_.datum_id = datum.id();
      datum_.publish(bus::to_message(datum));
    }
  }

  GpsHealth health() const {
    const double age_s = to_seconds(now_ns_ - said_.last_accepted_fix_ns);
    return said_.fixes_accepted == 0 ? GpsHealth::kInit
           : age_s > 30.0            ? GpsHealth::kStale
           : age_s > 2.0             ? GpsHealth::kDeadReckoning
           : assumed_                ? GpsHealth::kDegraded
                                     : GpsHealth::kOk;
  }

  void tell() {
    said_.stamp_ns = told_ns_ = now_ns_;
    said_.source = "passthrough";
    said_.health = health();
    status_.publish(bus::to_message(said_));
  }

  double geoid_undulation_m_;
  GpsStatus said_;
  std::optional<geodesy::LocalFrame> frame_;
  std::optional<geodesy::LocalFrame> candidate_;
  Eigen::Vector3d sum_m_{Eigen::Vector3d::Zero()};
  int candidates_{0};
  bool assumed_{false};
  std::uint64_t unusable_{0};
  Nanoseconds now_ns_{0}, told_ns_{0}, newest_ns_{0}, first_ns_{0};
  bus::Participant participant_;
  bus::Publisher<nav_msgs::msg::Odometry> odometry_;
  bus::Publisher<trigpoint_msgs::msg::GpsStatus> status_;
  bus::Publisher<sensor_msgs::msg::NavSatFix> datum_;
  bus::Subscription<sensor_msgs::msg::NavSatFix> datums_;
  bus::Subscription<sensor_msgs::msg::Imu> imu_;
  bus::Subscription<sensor_msgs::msg::NavSatFix> fixes_;
};

int run(const shell::Options& options, const shell::EventLog&) {
  RobotConfig robot;
  bus::Config config;
  shell::load_sections(options.config_files,
                       {{"robot", [&](ConfigFields& f) { describe(robot, f); }},
                        {"bus", [&](ConfigFields& f) { describe(config, f); }}});
  bus::Loop loop;
  Passthrough filter(robot, config, loop);
  loop.run();
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  return trigpoint::shell::run_program(argc,
                                       argv,
                                       "trigpoint_gps_passthrough",
                                       "GPS odometry without a filter: fixes passed through "
                                       "(an example for writers of filters)",
                                       run);
}
