// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_filter_judges.hpp"
#include <Eigen/Eigenvalues>

#include <set>
#include <utility>

namespace trigpoint::cli {

namespace {

using recording::Heard;

constexpr double kFirstOdometry_s = 10.0;  // datum: 2 s and 10 fixes, then a position
constexpr double kLongestGap_s = 1.0;      // of gps/odometry while fixes come
constexpr double kLongestSilence_s = 1.5;  // of gps/status, always
constexpr double kFutureStamp_s = 0.2;
constexpr double kSymmetric = 1e-6;  // relative
constexpr double kUnitQuaternion = 1e-3;

class FormJudge {
 public:
  FormJudge(const FilterDrive& drive, ContractChecks& checks)
      : drive_(drive), record_(drive.record), script_(drive.script), checks_(checks) {}

  void run() {
    one_writer();
    if (record_.odometry.empty()) {
      add("first position", false, "no gps/odometry came at all");
      return;
    }
    first_position();
    fields();
    finite();
    stamps();
    covariances();
    rates();
    datum();
  }

 private:
  void add(const std::string& name, bool passed, const std::string& figures) {
    checks_.push_back({name, passed, figures});
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
    const double first_s = drive_.since_start_s(record_.odometry.front().message.stamp_ns);
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

  const FilterDrive& drive_;
  const recording::FilterRecord& record_;
  const FilterScript& script_;
  ContractChecks& checks_;
};

}  // namespace

void judge_form(const FilterDrive& drive, ContractChecks& checks) {
  FormJudge(drive, checks).run();
}

}  // namespace trigpoint::cli
