// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/so3.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "gps_filter_judges.hpp"

#include <limits>

namespace trigpoint::cli {

namespace {

using Eigen::Vector3d;

constexpr double kHonestSigmas = 5.0;
constexpr double kNinetyFivePercent = 1.96;
constexpr double kClaimedYaw_rad2 = 1.0;  // above it no heading is claimed
constexpr double kUsefulSigma_m = 0.5;    // the gate's default threshold

/// Truth in the map of the filter's own datum.
class TrueMap {
 public:
  TrueMap(const FilterScript& script, const simulator::Truth& truth, const Datum& datum)
      : truth_(truth),
        antenna_base_m_(script.antenna_position_base_m),
        source_(script.datum),
        target_(datum) {
    const auto origin = source_.to_geographic(Vector3d::Zero());
    yaw_rad_ = std::atan2(target_.R_map_enu(origin)(1, 0), target_.R_map_enu(origin)(0, 0));
  }

  bool covers(Nanoseconds stamp_ns) const {
    return stamp_ns >= truth_.first_ns() && stamp_ns <= truth_.last_ns();
  }

  Vector3d position(Nanoseconds stamp_ns, bool antenna) const {
    const Pose T = truth_.at(stamp_ns).T_map_base;
    const Vector3d point = antenna ? T * antenna_base_m_ : T.p;
    return target_.to_map(source_.to_geographic(point)).value_or(Vector3d::Constant(kNaN));
  }

  double yaw_rad(Nanoseconds stamp_ns) const {
    return wrap_angle(yaw_of(truth_.at(stamp_ns).T_map_base.q) + yaw_rad_);
  }

  /// Velocity in base_link.
  Vector3d velocity(Nanoseconds stamp_ns) const {
    const auto state = truth_.at(stamp_ns);
    return state.T_map_base.q.conjugate() * state.v_map_mps;
  }

 private:
  const simulator::Truth& truth_;
  Vector3d antenna_base_m_;
  geodesy::LocalFrame source_;
  geodesy::LocalFrame target_;
  double yaw_rad_{0.0};
};

class HonestyJudge {
 public:
  HonestyJudge(const FilterDrive& drive, ContractChecks& checks)
      : drive_(drive), record_(drive.record), script_(drive.script), checks_(checks) {}

  void run() { honesty(); }

 private:
  void add(const std::string& name, bool passed, const std::string& figures) {
    checks_.push_back({name, passed, figures});
  }

  /// The worst of what is claimed.
  struct Tally {
    double position{0.0};
    double position_at_s{0.0};
    double yaw{0.0};
    double velocity{0.0};
    double error2_m2{0.0};
    std::size_t inside{0};
    std::size_t compared{0};
    std::vector<double> sigmas_m;  ///< while fixes come

    double median_m() {
      const auto middle = sigmas_m.begin() + static_cast<std::ptrdiff_t>(sigmas_m.size() / 2);
      std::nth_element(sigmas_m.begin(), middle, sigmas_m.end());
      return sigmas_m.empty() ? kNaN : *middle;
    }
  };

  void compare(const Odometry& o, const TrueMap& map, Tally& tally) const {
    const Vector3d error =
        o.T_frame_child.p - map.position(o.stamp_ns, o.child_frame_id == "gnss_antenna");
    const double off = ratio(error, o.pose_covariance.diagonal().head<3>());
    if (off > tally.position) {
      tally.position = off;
      tally.position_at_s = drive_.since_start_s(o.stamp_ns);
    }
    tally.inside += off < kNinetyFivePercent ? 1 : 0;
    ++tally.compared;
    tally.error2_m2 += error.squaredNorm();
    if (!drive_.in_outage(o.stamp_ns)) {
      tally.sigmas_m.push_back(sigma_m(o));
    }
    if (o.pose_covariance(5, 5) < kClaimedYaw_rad2) {
      const double yaw_rad = wrap_angle(yaw_of(o.T_frame_child.q) - map.yaw_rad(o.stamp_ns));
      tally.yaw = std::max(tally.yaw, std::abs(yaw_rad) / std::sqrt(o.pose_covariance(5, 5)));
    }
    if (o.child_frame_id == "base_link" && o.twist_covariance(0, 0) < kKnownBelow) {
      tally.velocity = std::max(
          tally.velocity,
          ratio(o.linear_mps - map.velocity(o.stamp_ns), o.twist_covariance.diagonal().head<3>()));
    }
  }

  void honesty() {
    const TrueMap map(script_, drive_.truth, record_.datums.back().message);
    Tally tally;
    for (const auto& heard : record_.odometry) {
      if (map.covers(heard.message.stamp_ns)) {
        compare(heard.message, map, tally);
      }
    }
    const double n = std::max(1.0, static_cast<double>(tally.compared));
    add("position bounded by sigma",
        tally.position <= kHonestSigmas && tally.compared > 0,
        text("worst %.2f sigma at %.1f s (at most %.0f); %.1f %% within 1.96 sigma on all axes; "
             "rms %.3f m",
             tally.position,
             tally.position_at_s,
             kHonestSigmas,
             100.0 * static_cast<double>(tally.inside) / n,
             std::sqrt(tally.error2_m2 / n)));
    add("heading and velocity bounded",
        tally.yaw <= kHonestSigmas && tally.velocity <= kHonestSigmas,
        text("worst %.2f sigma of yaw, %.2f of velocity, where they are claimed (at most %.0f)",
             tally.yaw,
             tally.velocity,
             kHonestSigmas));
    const double median_m = tally.median_m();
    add("sigma is of use",
        median_m <= kUsefulSigma_m,
        text("median %.3f m with fixes of 0.014 m (at most %.1f, or the gate never fuses)",
             median_m,
             kUsefulSigma_m));
    accepted_fixes(map);
  }

  static double ratio(const Vector3d& error, const Vector3d& variance) {
    const double worst =
        error.cwiseAbs().cwiseQuotient(variance.cwiseMax(0.0).cwiseSqrt()).maxCoeff();
    return std::isfinite(worst) ? worst : std::numeric_limits<double>::infinity();
  }

  void accepted_fixes(const TrueMap& map) {
    double worst = 0.0;
    std::size_t compared = 0;
    Nanoseconds last_ns = 0;
    for (const auto& heard : record_.statuses) {
      const GpsStatus& s = heard.message;
      if (s.last_accepted_fix_ns == last_ns || !map.covers(s.last_accepted_fix_ns)) {
        continue;
      }
      last_ns = s.last_accepted_fix_ns;
      ++compared;
      worst = std::max(worst,
                       ratio(s.accepted_antenna_map_m - map.position(last_ns, true),
                             s.accepted_covariance_map_m2.diagonal()));
    }
    add("accepted fixes bounded",
        worst <= kHonestSigmas && 2 * compared > record_.fixes,
        text("antenna in gps/status of %zu accepted fixes of %llu: worst %.2f sigma (at most %.0f)",
             compared,
             static_cast<unsigned long long>(record_.fixes),
             worst,
             kHonestSigmas));
  }

  const FilterDrive& drive_;
  const recording::FilterRecord& record_;
  const FilterScript& script_;
  ContractChecks& checks_;
};

}  // namespace

void judge_honesty(const FilterDrive& drive, ContractChecks& checks) {
  if (!drive.record.odometry.empty() && !drive.record.datums.empty()) {
    HonestyJudge(drive, checks).run();
  }
}

}  // namespace trigpoint::cli
