// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "control/fix_monitor.hpp"

#include "trigpoint/base/sentence.hpp"

#include "fusion/fused_odometry.hpp"
#include "fusion/rows.hpp"

#include <algorithm>
#include <limits>
#include <numeric>
#include <vector>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::array<double, 3> kWindows_s{2.0, 10.0, 30.0};
constexpr double kWindowTolerance = 1.5;  // the reference is at most this much older
constexpr Nanoseconds kSightingMemory_ns = 50 * kNanosecondsPerSecond;
constexpr double kScatterWindow_s = 30.0;
constexpr std::size_t kScatterFixes = 10;
constexpr double kNewSolution_s = 5.0;  // after such a silence the receiver began anew
constexpr double kJump_s = 1.0;
constexpr double kInfinite = std::numeric_limits<double>::infinity();
constexpr std::size_t kRefusedKept = 32;
// An alignment that was confirmed is given up only for fixes that agree against it for much longer.
constexpr double kLongContradiction_s = 120.0;
constexpr double kLongerThanConfirmed = 2.0;
constexpr double kLongestContradiction_s = 300.0;  // nor does a drive of hours outweigh so many

}  // namespace

FixMonitor::FixMonitor(const Config& config, const Eigen::Vector3d& antenna_position_base_m)
    : config_(config),
      lever_arm_base_m_(antenna_position_base_m),
      trusts_{Trust(config, Part::kLevel), Trust(config, Part::kHeight)},
      rival_(config.alignment),
      settling_(config) {}

void FixMonitor::on_lio_status(const LioStatus& lio, double distance_m) {
  const double moved_m = std::max(0.0, distance_m - lio_distance_m_);
  lio_distance_m_ = distance_m;
  for (int axis = 0; axis < 3; ++axis) {
    if (lio.sigma[static_cast<std::size_t>(axis)] > config_.smooth.lio_blind_sigma_m) {
      blind_m_[axis] += moved_m;
    }
  }
}

bool FixMonitor::is_blind(const LioStatus& lio, int axis_map) const {
  const Eigen::Matrix3d R_map_odom = lio.T_map_odom.pose().q.toRotationMatrix();
  const Eigen::Vector3d sigma_odom_m(lio.sigma[0], lio.sigma[1], lio.sigma[2]);
  const double variance_m2 =
      R_map_odom.row(axis_map).cwiseAbs2().dot(sigma_odom_m.cwiseAbs2().transpose());
  return variance_m2 > config_.smooth.lio_blind_sigma_m * config_.smooth.lio_blind_sigma_m;
}

Eigen::Vector3d FixMonitor::blind_variance_map_m2(const LioStatus& lio) const {
  const Eigen::Matrix3d R_map_odom = lio.T_map_odom.pose().q.toRotationMatrix();
  Eigen::Vector3d result = Eigen::Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    if (const auto& last = last_row_[static_cast<std::size_t>(axis)]) {
      const Eigen::Vector3d since_odom_m = blind_m_ - last->blind_m;
      result[axis] = R_map_odom.row(axis).cwiseAbs2().dot(since_odom_m.cwiseAbs2().transpose());
    }
  }
  return result;
}

void FixMonitor::on_rows(const std::array<bool, 3>& axes) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (axes[axis]) {
      last_row_[axis] = sightings_.back();
    }
  }
}

Eigen::Vector3d FixMonitor::scatter_map_m2(const LioStatus& lio) const {
  const Eigen::Matrix3d R_map_odom = lio.T_map_odom.pose().q.toRotationMatrix();
  Eigen::Vector3d result = Eigen::Vector3d::Constant(kNaN);
  for (int axis = 0; axis < 3; ++axis) {
    const std::size_t part = index_of(part_of(axis));
    std::vector<double> offsets_m;
    const Sighting* first = nullptr;
    const Sighting* last = nullptr;
    for (const Sighting& s : sightings_) {
      if (s.used[part] && to_seconds(sightings_.back().stamp_ns - s.stamp_ns) <= kScatterWindow_s) {
        first = first == nullptr ? &s : first;
        last = &s;
        offsets_m.push_back(s.gps_map_m[axis] - R_map_odom.row(axis).dot(s.lio_odom_m));
      }
    }
    if (offsets_m.size() < kScatterFixes || (last->blind_m - first->blind_m).norm() > 0.0) {
      continue;
    }
    const auto n = static_cast<double>(offsets_m.size());
    const double mean_m = std::accumulate(offsets_m.begin(), offsets_m.end(), 0.0) / n;
    double sum_m2 = 0.0;
    for (const double offset_m : offsets_m) {
      sum_m2 += (offset_m - mean_m) * (offset_m - mean_m);
    }
    // A random walk over the whole way d has a variance of q d / 6 about its own mean.
    const double drift_m2 =
        compare_displacement(*first, *last, lio, config_).covariance_m2(axis, axis) / 6.0;
    result[axis] = std::max(0.0, sum_m2 / (n - 1.0) - drift_m2);
  }
  return result;
}

Sighting FixMonitor::sighting_of(const Witness& witness) const {
  const AcceptedFix& gps = witness.as_received();
  Sighting sighting;
  sighting.stamp_ns = witness.fix.stamp_ns;
  sighting.gps_map_m = gps.antenna_map_m;
  sighting.gps_variance_m2 = floored(gps.covariance_map_m2, config_.min_sigma_m).diagonal();
  sighting.lio_odom_m = witness.lio_pose.T_frame_child * lever_arm_base_m_;
  sighting.distance_m = witness.lio_pose.distance_m;
  sighting.blind_m = blind_m_;
  return sighting;
}

/// The row's innovation. Covariance: the fix's, T_map_odom's and the scan's at the antenna.
Difference FixMonitor::offset_of(const AcceptedFix& fix,
                                 const Sighting& sighting,
                                 const LioStatus& lio) const {
  Odometry antenna;
  antenna.T_frame_child.p = sighting.lio_odom_m;
  antenna.pose_covariance.setZero();
  for (int axis = 0; axis < 3; ++axis) {
    const double sigma_m = lio.sigma[static_cast<std::size_t>(axis)];
    antenna.pose_covariance(axis, axis) = sigma_m * sigma_m;
  }
  const Odometry in_map = fuse(antenna, lio.T_map_odom, lio.T_map_odom_covariance);
  Difference result;
  result.d_map_m = fix.antenna_map_m - in_map.T_frame_child.p;
  result.covariance_m2 = in_map.pose_covariance.topLeftCorner<3, 3>() +
                         floored(fix.covariance_map_m2, config_.min_sigma_m);
  return result;
}

/// Beyond the mapper's random walk: what LIO may have drifted since a fix was trusted, and what
/// that one was off.
Eigen::Matrix3d FixMonitor::lio_may_be_off_m2(const Sighting& sighting,
                                              const LioStatus& lio,
                                              Part part) const {
  Eigen::Matrix3d result = unsettled_m2_.asDiagonal();
  if (const auto& last = last_trusted_[index_of(part)]) {
    const Eigen::Matrix3d R_map_odom = lio.T_map_odom.pose().q.toRotationMatrix();
    const Eigen::Vector3d drift_m2 =
        lio_drift_variance_m2((sighting.blind_m - last->blind_m).cwiseAbs(),
                              std::max(0.0, sighting.distance_m - last->distance_m),
                              config_);
    result += R_map_odom * drift_m2.asDiagonal() * R_map_odom.transpose();
  }
  return result;
}

Difference FixMonitor::level_difference(const AcceptedFix& fix,
                                        const Sighting& sighting,
                                        const LioStatus& lio,
                                        Part part) const {
  Difference result = offset_of(fix, sighting, lio);
  result.covariance_m2 += lio_may_be_off_m2(sighting, lio, part);
  return result;
}

/// A believed fix need not have moved T_map_odom: its row may have had no weight, or there was
/// none. What it was off, as far as LIO may be, stays permitted until it is taken in.
void FixMonitor::note_trusted(const Witness& witness,
                              const Sighting& sighting,
                              const LioStatus& lio,
                              MonitorOutcome& outcome) {
  const AcceptedFix& fix = witness.as_received();
  const Difference off_by = offset_of(fix, sighting, lio);
  for (const Part part : kParts) {
    if (!outcome.trusted[index_of(part)]) {
      continue;
    }
    const Eigen::Vector3d most_m2 =
        lio_may_be_off_m2(sighting, lio, part).diagonal().cwiseMin(off_by.d_map_m.cwiseAbs2());
    for (int axis = 0; axis < 3; ++axis) {
      unsettled_m2_[axis] = part_of(axis) == part ? most_m2[axis] : unsettled_m2_[axis];
    }
  }
  if (!outcome.trusted[0] || is_blind(lio, 0) || is_blind(lio, 1)) {
    settling_.interrupt();
  } else if (outcome.change[1] != Trust::Change::kDoubted) {  // else T_map_odom may go back first
    outcome.slid_map_m =
        settling_.add(fix, sighting, [&](const AcceptedFix& seen_fix, const Sighting& seen) {
          return offset_of(seen_fix, seen, lio);
        });
    outcome.is_settling =
        settling_.is_open() && sigmas_of(off_by, Part::kLevel) > config_.smooth.enter_sigmas;
  }
}

const Sighting* FixMonitor::trusted_before(Nanoseconds stamp_ns, double window_s, Part part) const {
  const auto found = std::find_if(sightings_.rbegin(), sightings_.rend(), [&](const Sighting& s) {
    return s.used[index_of(part)] && to_seconds(stamp_ns - s.stamp_ns) >= window_s;
  });
  const double oldest_s = std::max(kUnbrokenGap_s, kWindowTolerance * window_s);
  const bool near =
      found != sightings_.rend() && to_seconds(stamp_ns - found->stamp_ns) <= oldest_s;
  return near ? &*found : nullptr;
}

Tests FixMonitor::test(const Witness& witness,
                       const Sighting& sighting,
                       const LioStatus& lio,
                       Part part) const {
  Tests tests;
  const auto hold = [&](const Difference& difference, const char* code, const std::string& what) {
    const double sigmas = sigmas_of(difference, part);
    const SmoothConfig& limits = config_.smooth;
    const double limit = sigmas > limits.leave_sigmas ? limits.leave_sigmas : limits.enter_sigmas;
    if (sigmas <= limits.enter_sigmas) {
      return;
    }
    const std::string text = what + sentence(" by %.2f m, at most %.2f m",
                                             size_of(difference, part),
                                             permitted_m(difference, part, limit));
    tests.enters = false;
    tests.lack = text;
    if (sigmas > limits.leave_sigmas && !tests.contradiction) {
      tests.contradiction = Refusal{code, text};
    }
  };
  hold(level_difference(witness.fix, sighting, lio, part), "off_level", "fix is off");
  if (witness.raw) {
    hold(level_difference(*witness.raw, sighting, lio, part), "off_level", "receiver is off");
  }
  for (const double window_s : kWindows_s) {
    const Sighting* before = trusted_before(sighting.stamp_ns, window_s, part);
    if (before != nullptr) {
      hold(compare_displacement(*before, sighting, lio, config_),
           "moves_unlike_lio",
           sentence("GPS moves unlike LIO in %.0f s", window_s));
    }
  }
  return tests;
}

double FixMonitor::worth_of_doubted_m2(const Witness& witness,
                                       const Sighting& sighting,
                                       const LioStatus& lio) const {
  const AcceptedFix& fix = witness.as_received();
  std::vector<Difference> differences{level_difference(fix, sighting, lio, Part::kLevel)};
  for (const double window_s : kWindows_s) {
    const Sighting* before = trusted_before(sighting.stamp_ns, window_s, Part::kLevel);
    if (before != nullptr) {
      differences.push_back(compare_displacement(*before, sighting, lio, config_));
    }
  }
  double worst_m2 = 0.0;
  for (const Difference& difference : differences) {
    if (!difference.d_map_m.allFinite() || !difference.covariance_m2.allFinite()) {
      return kInfinite;
    }
    const Eigen::Vector3d explained_m2 = difference.covariance_m2.diagonal();
    const Eigen::Vector3d excess_m2 = (difference.d_map_m.cwiseAbs2() - explained_m2).cwiseMax(0.0);
    worst_m2 = std::max(worst_m2, excess_m2.head<2>().sum());
  }
  return worst_m2 + sighting.gps_variance_m2.head<2>().maxCoeff();
}

/// Since when GPS has crept away unnoticed: the newest trusted fix that contradicts this one over a
/// window. None when it jumped or was away, because then nothing wrong was believed.
std::optional<Nanoseconds> FixMonitor::taken_in_since(const Sighting& sighting,
                                                      const LioStatus& lio,
                                                      Part part) const {
  const auto contradicts = [&](const Sighting* before) {
    return before != nullptr && sigmas_of(compare_displacement(*before, sighting, lio, config_),
                                          part) > config_.smooth.enter_sigmas;
  };
  const Sighting* newest = trusted_before(sighting.stamp_ns, 0.0, part);
  if (newest == nullptr || contradicts(newest)) {
    return std::nullopt;
  }
  for (const double window_s : kWindows_s) {
    const Sighting* before = trusted_before(sighting.stamp_ns, window_s, part);
    if (contradicts(before)) {
      return before->stamp_ns;
    }
  }
  return std::nullopt;
}

/// After a silence the receiver began anew, and a new solution may be as wrong as the old one: it
/// does not overthrow an alignment by one jump. One that goes on where the doubted fixes before the
/// silence left off is no new one.
bool FixMonitor::is_new_solution(const Sighting& sighting, const LioStatus& lio) const {
  const Trust& level = trust(Part::kLevel);
  return level.trusted() ||
         sigmas_of(compare_displacement(level.stretch().back(), sighting, lio, config_),
                   Part::kLevel) > config_.smooth.enter_sigmas;
}

MonitorOutcome FixMonitor::judge(const Witness& witness, const LioStatus& lio) {
  Sighting sighting = sighting_of(witness);
  if (!sightings_.empty() &&
      to_seconds(sighting.stamp_ns - sightings_.back().stamp_ns) > kNewSolution_s) {
    confirmed_s_ += is_new_solution(sighting, lio) ? config_.smooth.probation_s : 0.0;
    settling_.begin();
  }
  MonitorOutcome outcome;
  for (const Part part : kParts) {
    const std::size_t k = index_of(part);
    const Tests tests = test(witness, sighting, lio, part);
    outcome.change[k] = trusts_[k].judge(sighting, tests, lio);
    if (outcome.change[k] == Trust::Change::kDoubted) {
      outcome.taken_in_since_ns[k] = taken_in_since(sighting, lio, part);
      crept_[k] = outcome.taken_in_since_ns[k].has_value();
      forget_since(outcome.taken_in_since_ns[k].value_or(sighting.stamp_ns), part);
    }
  }
  if (outcome.change[0] == Trust::Change::kDoubted) {
    begin_with_refused(sighting, lio);
  }
  refused_.clear();
  // A reflection that spoils east and north spoils the height; a wrong height alone spoils nothing.
  outcome.trusted[0] = trusts_[0].trusted();
  outcome.trusted[1] = trusts_[1].trusted() && outcome.trusted[0];
  if (outcome.trusted[0] && last_trusted_[0]) {
    const double since_s = to_seconds(sighting.stamp_ns - last_trusted_[0]->stamp_ns);
    confirmed_s_ += since_s <= kUnbrokenGap_s ? std::max(0.0, since_s) : 0.0;
  }
  doubted_m2_ = outcome.trusted[0] ? kInfinite : worth_of_doubted_m2(witness, sighting, lio);
  note_trusted(witness, sighting, lio, outcome);
  for (const Part part : kParts) {
    if (outcome.trusted[index_of(part)]) {
      sighting.used[index_of(part)] = true;
      last_trusted_[index_of(part)] = sighting;
    }
  }
  // A gate that began beside an aligned mapper sent no row yet: LIO's blindness counts from here.
  for (int axis = 0; axis < 3; ++axis) {
    auto& last = last_row_[static_cast<std::size_t>(axis)];
    if (!last && outcome.trusted[index_of(part_of(axis))]) {
      last = sighting;
    }
  }
  keep(sighting);
  if (!trusts_[0].trusted() || !trusts_[1].trusted()) {
    outcome.realignment = rival_of(sighting, trusts_[0].trusted() ? Part::kHeight : Part::kLevel);
  }
  return outcome;
}

void FixMonitor::on_refused(const Witness& witness) {
  refused_.push_back(sighting_of(witness));
  if (refused_.size() > kRefusedKept) {
    refused_.pop_front();
  }
}

/// A jump that the GPS filter found first is as old as the first fix that it refused for it.
void FixMonitor::begin_with_refused(const Sighting& sighting, const LioStatus& lio) {
  const auto first = std::find_if(refused_.begin(), refused_.end(), [&](const Sighting& s) {
    return to_seconds(sighting.stamp_ns - s.stamp_ns) <= kJump_s &&
           sigmas_of(compare_displacement(s, sighting, lio, config_), Part::kLevel) <=
               config_.smooth.enter_sigmas;
  });
  if (first != refused_.end()) {
    trusts_[index_of(Part::kLevel)].begin_earlier(*first);
  }
}

void FixMonitor::on_alignment(const Witness& witness) {
  Sighting sighting = sighting_of(witness);
  sighting.used = {true, true};
  last_trusted_.fill(sighting);
  last_row_.fill(sighting);
  keep(sighting);
}

void FixMonitor::keep(const Sighting& sighting) {
  sightings_.push_back(sighting);
  while (sightings_.front().stamp_ns < sighting.stamp_ns - kSightingMemory_ns) {
    sightings_.pop_front();
  }
}

void FixMonitor::forget_since(Nanoseconds stamp_ns, Part part) {
  for (Sighting& sighting : sightings_) {
    if (sighting.stamp_ns > stamp_ns) {
      sighting.used[index_of(part)] = false;
    }
  }
}

/// A second alignment from the fixes that agree with each other while they are in doubt.
std::optional<AlignmentSolution> FixMonitor::rival_of(const Sighting& sighting, Part doubted) {
  const Trust& doubt = trust(doubted);
  if (doubt.stretch_began()) {
    rival_.clear();
  }
  rival_.add({sighting.stamp_ns,
              sighting.gps_map_m,
              sighting.gps_variance_m2,
              sighting.lio_odom_m,
              sighting.distance_m});
  const Sighting& first = doubt.stretch().front();
  const double agreed_s = doubt.agreed_s();
  // Fixes that first moved unlike LIO are liars themselves, also those that crept so slowly that
  // they agree with each other ever since; the end of a wrong fix is one jump.
  const bool jumped =
      !crept_[index_of(doubted)] && to_seconds(first.stamp_ns - doubt.since_ns()) <= kJump_s;
  const bool on_probation = jumped && confirmed_s_ < config_.smooth.probation_s;
  const bool outlives =
      doubted == Part::kLevel && agreed_s > kLongContradiction_s &&
      agreed_s > std::min(kLongerThanConfirmed * confirmed_s_, kLongestContradiction_s);
  const bool is_long_enough = doubt.agreed_m() >= config_.smooth.realign_m;
  const bool is_off = doubt.reason().code == "off_level";
  if (rival_.admitted() && is_off && is_long_enough && (on_probation || outlives)) {
    return rival_.solution();
  }
  return std::nullopt;
}

void FixMonitor::begin_anew() {
  for (Trust& trust : trusts_) {
    trust.begin_anew();
  }
  sightings_.clear();
  rival_.clear();
  last_trusted_ = {};
  last_row_ = {};
  unsettled_m2_.setZero();
  settling_.end();
  refused_.clear();
  confirmed_s_ = 0.0;
  crept_ = {};
  doubted_m2_ = kInfinite;
}

}  // namespace trigpoint::fusion_gate
