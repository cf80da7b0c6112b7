// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_filter_contract.hpp"

#include "trigpoint/base/so3.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <limits>
#include <set>

namespace trigpoint::cli {

namespace {

using Eigen::Vector3d;
using recording::FilterRecord;
using recording::Heard;

constexpr double kFirstOdometry_s = 10.0;  // datum: 2 s and 10 fixes, then a position
constexpr double kLongestGap_s = 1.0;      // of gps/odometry while fixes come
constexpr double kLongestSilence_s = 1.5;  // of gps/status, always
constexpr double kFutureStamp_s = 0.2;
constexpr double kSeesOutageWithin_s = 3.0;
constexpr double kRecoversWithin_s = 5.0;
constexpr double kRecoveredSigma_m = 1.0;
constexpr double kHonestSigmas = 5.0;
constexpr double kUsefulSigma_m = 0.5;  // the gate's default threshold
constexpr double kGrowth = 2.0;
constexpr double kKnownBelow = 1e4;  // a variance is known, or 1e6
constexpr double kSymmetric = 1e-6;  // relative
constexpr double kUnitQuaternion = 1e-3;

std::string text(const char* format, ...) __attribute__((format(printf, 1, 2)));

std::string text(const char* format, ...) {
  std::array<char, 400> buffer{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
  va_end(arguments);
  return buffer.data();
}

const char* name_of(GpsHealth health) {
  constexpr std::array<const char*, 6> kNames{
      "INIT", "OK", "DEGRADED", "DEAD_RECKONING", "STALE", "FAULT"};
  return kNames.at(static_cast<std::size_t>(health));
}

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

class Judge {
 public:
  Judge(const FilterRecord& record, const FilterScript& script, const simulator::Truth& truth)
      : record_(record), script_(script), truth_(truth) {}

  std::vector<ContractCheck> run() {
    one_writer();
    if (record_.odometry.empty()) {
      add("first position", false, "no gps/odometry came at all");
      return checks_;
    }
    first_position();
    fields();
    finite();
    stamps();
    covariances();
    rates();
    datum();
    if (!record_.datums.empty()) {
      honesty();
    }
    if (record_.statuses.empty()) {
      add("status", false, "no gps/status came: the gate would take it for a foreign filter");
      return checks_;
    }
    status_counts();
    health();
    growth();
    recovery();
    return checks_;
  }

 private:
  void add(const std::string& name, bool passed, const std::string& figures) {
    checks_.push_back({name, passed, figures});
  }

  double since_start_s(Nanoseconds stamp_ns) const {
    return to_seconds(stamp_ns - script_.start_ns);
  }

  static double sigma_m(const Odometry& odometry) {
    return std::sqrt(std::max(odometry.pose_covariance(0, 0), odometry.pose_covariance(1, 1)));
  }

  bool in_outage(Nanoseconds stamp_ns, double after_s = 0.0) const {
    return stamp_ns > script_.outage_from_ns + from_seconds(after_s) &&
           stamp_ns < script_.outage_to_ns;
  }

  void one_writer() {
    std::set<std::string> participants;
    std::set<std::string> odometry;
    for (const auto& heard : record_.odometry) {
      odometry.insert(heard.writer);
      participants.insert(heard.writer.substr(0, 24));
    }
    for (const auto& heard : record_.statuses) {
      participants.insert(heard.writer.substr(0, 24));
    }
    add("one program speaks",
        odometry.size() == 1 && participants.size() == 1,
        text("%zu writers of gps/odometry, %zu programs in all; %zu odometry, %zu status messages",
             odometry.size(),
             participants.size(),
             record_.odometry.size(),
             record_.statuses.size()));
  }

  void first_position() {
    const double first_s = since_start_s(record_.odometry.front().message.stamp_ns);
    add("first position",
        first_s < kFirstOdometry_s,
        text("%.1f s after the start (at most %.0f)", first_s, kFirstOdometry_s));
  }

  void fields() {
    std::size_t wrong = 0;
    std::string example;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      const bool good = o.frame_id == "map" &&
                        (o.child_frame_id == "base_link" || o.child_frame_id == "gnss_antenna");
      wrong += good ? 0 : 1;
      example = o.child_frame_id + " in " + o.frame_id;
    }
    add("frames", wrong == 0, text("%s; %zu wrong", example.c_str(), wrong));
  }

  void finite() {
    std::size_t wrong = 0;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      const bool good = o.T_frame_child.is_finite() && o.pose_covariance.allFinite() &&
                        o.linear_mps.allFinite() && o.angular_radps.allFinite() &&
                        o.twist_covariance.allFinite() &&
                        std::abs(o.T_frame_child.q.norm() - 1.0) < kUnitQuaternion;
      wrong += good ? 0 : 1;
    }
    add("finite values", wrong == 0, text("%zu of %zu wrong", wrong, record_.odometry.size()));
  }

  template <class T>
  std::pair<std::size_t, std::size_t> misplaced(const std::vector<Heard<T>>& list,
                                                Nanoseconds least_step_ns) const {
    std::size_t back = 0;
    std::size_t outside = 0;
    for (std::size_t i = 0; i < list.size(); ++i) {
      const Nanoseconds stamp_ns = list[i].message.stamp_ns;
      back += i > 0 && stamp_ns < list[i - 1].message.stamp_ns + least_step_ns ? 1 : 0;
      outside += stamp_ns < script_.start_ns ||
                         stamp_ns > list[i].reached_ns + from_seconds(kFutureStamp_s)
                     ? 1
                     : 0;
    }
    return {back, outside};
  }

  void stamps() {
    const auto [back, outside] = misplaced(record_.odometry, 1);
    std::vector<Heard<GpsStatus>> statuses = record_.statuses;
    std::erase_if(statuses, [](const auto& heard) { return heard.message.stamp_ns == 0; });
    const auto [status_back, status_outside] = misplaced(statuses, 0);
    add("stamps advance",
        back + status_back == 0,
        text("%zu of gps/odometry and %zu of gps/status do not", back, status_back));
    add("stamps are data time",
        outside + status_outside == 0,
        text("%zu of gps/odometry and %zu of gps/status are outside the drive",
             outside,
             status_outside));
  }

  static bool is_sound(const Eigen::Matrix<double, 6, 6>& P) {
    const double size = P.cwiseAbs().maxCoeff();
    if (!P.allFinite() || (P - P.transpose()).cwiseAbs().maxCoeff() > kSymmetric * size) {
      return false;
    }
    // Scaled to ones on the diagonal, so that 1e6 beside 1e-4 is no matter of rounding.
    if (!(P.diagonal().minCoeff() > 0.0)) {
      return false;
    }
    const Eigen::Matrix<double, 6, 1> scale = P.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::Matrix<double, 6, 6> correlation = scale.asDiagonal() * P * scale.asDiagonal();
    return Eigen::SelfAdjointEigenSolver<Eigen::Matrix<double, 6, 6>>(correlation)
               .eigenvalues()
               .minCoeff() > 0.0;
  }

  void covariances() {
    std::size_t pose = 0;
    std::size_t twist = 0;
    std::size_t neither = 0;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      pose += is_sound(o.pose_covariance) ? 0 : 1;
      twist += is_sound(o.twist_covariance) ? 0 : 1;
      for (int i = 0; i < 6; ++i) {
        for (const double variance : {o.pose_covariance(i, i), o.twist_covariance(i, i)}) {
          neither += variance > kKnownBelow && variance < 0.99 * kUnknownVariance ? 1 : 0;
        }
      }
    }
    add("covariance positive",
        pose + twist == 0,
        text("symmetric and positive definite but for %zu of pose, %zu of twist (of %zu)",
             pose,
             twist,
             record_.odometry.size()));
    const Odometry& last = record_.odometry.back().message;
    add("unknown is 1e6",
        neither == 0 && pose + twist == 0,
        text("last yaw variance %.3g rad2, velocity variance %.3g m2/s2; never 0",
             last.pose_covariance(5, 5),
             last.twist_covariance(0, 0)));
  }

  void rates() {
    double gap_s = 0.0;
    std::size_t count = 0;
    Nanoseconds last_ns = record_.odometry.front().message.stamp_ns;
    const Nanoseconds first_ns = last_ns;
    for (const auto& heard : record_.odometry) {
      const Nanoseconds stamp_ns = heard.message.stamp_ns;
      if (stamp_ns < script_.outage_from_ns) {
        gap_s = std::max(gap_s, to_seconds(stamp_ns - last_ns));
        last_ns = stamp_ns;
        ++count;
      }
    }
    gap_s = std::max(gap_s, to_seconds(script_.outage_from_ns - last_ns));
    const double span_s = to_seconds(script_.outage_from_ns - first_ns);
    const double rate_hz = span_s > 0.0 ? static_cast<double>(count) / span_s : 0.0;
    add("rate of gps/odometry",
        gap_s <= kLongestGap_s && rate_hz >= 0.9 * script_.fix_rate_hz,
        text("%.1f Hz while fixes come (fixes: %.1f Hz), longest gap %.2f s (at most %.1f)",
             rate_hz,
             script_.fix_rate_hz,
             gap_s,
             kLongestGap_s));
    double silence_s = 0.0;
    Nanoseconds status_ns = script_.start_ns;
    for (const auto& heard : record_.statuses) {
      silence_s = std::max(silence_s, to_seconds(heard.reached_ns - status_ns));
      status_ns = heard.reached_ns;
    }
    silence_s = std::max(silence_s, to_seconds(script_.end_ns - status_ns));
    add("rate of gps/status",
        silence_s <= kLongestSilence_s,
        text("longest silence %.2f s of data time, outage included (at most %.1f)",
             silence_s,
             kLongestSilence_s));
  }

  void datum() {
    std::set<std::string> published;
    for (const auto& heard : record_.datums) {
      published.insert(heard.message.id());
    }
    std::set<std::string> named;
    for (const auto& heard : record_.statuses) {
      if (!heard.message.datum_id.empty()) {
        named.insert(heard.message.datum_id);
      }
    }
    add("datum",
        published.size() == 1 && named == published,
        text("%zu on `datum` (%s), %zu in gps/status%s",
             published.size(),
             published.empty() ? "none" : published.begin()->c_str(),
             named.size(),
             named == published ? ", the same" : ", not the same"));
  }

  void honesty() {
    const TrueMap map(script_, truth_, record_.datums.back().message);
    double worst = 0.0;
    double worst_yaw = 0.0;
    double worst_speed = 0.0;
    double worst_at_s = 0.0;
    double sum2 = 0.0;
    std::size_t inside = 0;
    std::size_t compared = 0;
    std::vector<double> sigmas;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      if (!map.covers(o.stamp_ns)) {
        continue;
      }
      const Vector3d error =
          o.T_frame_child.p - map.position(o.stamp_ns, o.child_frame_id == "gnss_antenna");
      const double sigmas_off = ratio(error, o.pose_covariance.diagonal().head<3>());
      if (!(sigmas_off <= worst)) {
        worst = sigmas_off;
        worst_at_s = since_start_s(o.stamp_ns);
      }
      inside += sigmas_off < 1.96 ? 1 : 0;
      ++compared;
      sum2 += error.squaredNorm();
      if (!in_outage(o.stamp_ns)) {
        sigmas.push_back(sigma_m(o));
      }
      if (o.pose_covariance(5, 5) < 1.0) {
        worst_yaw =
            std::max(worst_yaw,
                     std::abs(wrap_angle(yaw_of(o.T_frame_child.q) - map.yaw_rad(o.stamp_ns))) /
                         std::sqrt(o.pose_covariance(5, 5)));
      }
      if (o.child_frame_id == "base_link" && o.twist_covariance(0, 0) < kKnownBelow) {
        worst_speed = std::max(worst_speed,
                               ratio(o.linear_mps - map.velocity(o.stamp_ns),
                                     o.twist_covariance.diagonal().head<3>()));
      }
    }
    std::nth_element(
        sigmas.begin(), sigmas.begin() + static_cast<long>(sigmas.size() / 2), sigmas.end());
    const double median_m = sigmas.empty() ? kNaN : sigmas[sigmas.size() / 2];
    const double n = std::max(1.0, static_cast<double>(compared));
    add("position bounded by sigma",
        worst <= kHonestSigmas && compared > 0,
        text("worst %.2f sigma at %.1f s (at most %.0f); %.1f %% within 1.96 sigma on all axes; "
             "rms %.3f m",
             worst,
             worst_at_s,
             kHonestSigmas,
             100.0 * static_cast<double>(inside) / n,
             std::sqrt(sum2 / n)));
    add("heading and velocity bounded",
        worst_yaw <= kHonestSigmas && worst_speed <= kHonestSigmas,
        text("worst %.2f sigma of yaw, %.2f of velocity, where they are claimed (at most %.0f)",
             worst_yaw,
             worst_speed,
             kHonestSigmas));
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

  void status_counts() {
    const GpsStatus& last = record_.statuses.back().message;
    std::size_t back = 0;
    for (std::size_t i = 1; i < record_.statuses.size(); ++i) {
      const GpsStatus& a = record_.statuses[i - 1].message;
      const GpsStatus& b = record_.statuses[i].message;
      back += b.fixes_received < a.fixes_received || b.fixes_accepted < a.fixes_accepted ||
                      b.last_accepted_fix_ns < a.last_accepted_fix_ns
                  ? 1
                  : 0;
    }
    add("status counts",
        back == 0 && last.fixes_received >= record_.fixes && !last.source.empty(),
        text("'%s' received %llu of %llu fixes, accepted %llu; counters went back %zu times",
             last.source.c_str(),
             static_cast<unsigned long long>(last.fixes_received),
             static_cast<unsigned long long>(record_.fixes),
             static_cast<unsigned long long>(last.fixes_accepted),
             back));
  }

  void health() {
    bool ok_before = false;
    std::size_t blind = 0;  // status messages that do not see the outage
    std::optional<GpsHealth> end;
    std::string course;
    std::optional<GpsHealth> last;
    for (const auto& heard : record_.statuses) {
      const GpsHealth now = heard.message.health;
      if (!last || *last != now) {
        course += std::string(course.empty() ? "" : " ") + name_of(now);
      }
      last = now;
      const bool reckons = now == GpsHealth::kDeadReckoning || now == GpsHealth::kStale;
      if (heard.reached_ns < script_.outage_from_ns) {
        ok_before = ok_before || now == GpsHealth::kOk;
      } else if (in_outage(heard.reached_ns, kSeesOutageWithin_s)) {
        blind += reckons && heard.message.last_accepted_fix_ns <= script_.outage_from_ns ? 0 : 1;
        end = now;
      }
    }
    const bool first_init = record_.statuses.front().message.health == GpsHealth::kInit;
    add("health before the outage",
        ok_before && first_init,
        text("%s, and %s",
             first_init ? "INIT at first" : "not INIT at first",
             ok_before ? "OK was reached" : "OK was never reached"));
    add("health in the outage",
        end && blind == 0,
        text("%zu status messages later than %.0f s into it do not say DEAD_RECKONING or STALE",
             blind,
             kSeesOutageWithin_s));
    const bool back = last == GpsHealth::kOk || last == GpsHealth::kDegraded;
    add("health after the outage", back, course.substr(0, 200));
  }

  void growth() {
    double before_m = kNaN;
    double middle_m = kNaN;
    double end_m = kNaN;
    std::size_t in_it = 0;
    const Nanoseconds middle_ns =
        script_.outage_from_ns + (script_.outage_to_ns - script_.outage_from_ns) / 2;
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      if (o.stamp_ns <= script_.outage_from_ns) {
        before_m = sigma_m(o);
      } else if (in_outage(o.stamp_ns)) {
        middle_m = o.stamp_ns < middle_ns ? sigma_m(o) : middle_m;
        end_m = sigma_m(o);
        in_it += in_outage(o.stamp_ns, kSeesOutageWithin_s) ? 1 : 0;
      }
    }
    if (in_it == 0) {
      add("sigma grows in the outage", true, "no gps/odometry in it: nothing is claimed");
      return;
    }
    add("sigma grows in the outage",
        end_m > kGrowth * before_m && end_m >= middle_m,
        text("%.3f m before, %.3f m in its middle, %.3f m at its end (at least %.0f times)",
             before_m,
             middle_m,
             end_m,
             kGrowth));
  }

  void recovery() {
    const Nanoseconds limit_ns = script_.outage_to_ns + from_seconds(kRecoversWithin_s);
    for (const auto& heard : record_.odometry) {
      const Odometry& o = heard.message;
      const bool heard_of_fixes = accepted_after_outage(heard.reached_ns);
      if (o.stamp_ns > script_.outage_to_ns && heard_of_fixes && sigma_m(o) < kRecoveredSigma_m) {
        add("recovery after the outage",
            o.stamp_ns < limit_ns,
            text("sigma below %.1f m with accepted fixes %.2f s after its end (at most %.0f)",
                 kRecoveredSigma_m,
                 to_seconds(o.stamp_ns - script_.outage_to_ns),
                 kRecoversWithin_s));
        return;
      }
    }
    add("recovery after the outage", false, "no certain position came after it");
  }

  bool accepted_after_outage(Nanoseconds reached_ns) const {
    return std::any_of(record_.statuses.begin(), record_.statuses.end(), [&](const auto& heard) {
      return heard.reached_ns <= reached_ns &&
             heard.message.last_accepted_fix_ns >= script_.outage_to_ns;
    });
  }

  const FilterRecord& record_;
  const FilterScript& script_;
  const simulator::Truth& truth_;
  std::vector<ContractCheck> checks_;
};

}  // namespace

std::vector<ContractCheck> judge_filter(const FilterRecord& record,
                                        const FilterScript& script,
                                        const simulator::Truth& truth) {
  return Judge(record, script, truth).run();
}

}  // namespace trigpoint::cli
