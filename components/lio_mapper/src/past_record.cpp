// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "past_record.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

namespace trigpoint::lio_mapper {

namespace {

/// A longer silence of applied rows is an outage, ...
constexpr double kOutage_s = 5.0;
/// ... so long after its end T_map_odom has come back, ...
constexpr double kSettled_s = 5.0;
/// ... and if it has moved less at the robot there is nothing to correct.
constexpr double kWorthIt_m = 0.05;
/// Registrations must agree with others, 4 m apart: some are needed.
constexpr double kFirstRevisit_m = 20.0;
constexpr double kNextRevisit_m = 100.0;
/// So far from any earlier visit, and the next one is another.
constexpr double kRevisitEnds_m = 20.0;
/// A minute and a half at 10 Hz, 50 MB: who takes longer is late.
constexpr std::size_t kMostInserted = 1000;

}  // namespace

PastRecord::PastRecord(const PastConfig& config, const GraphInput& earlier) : config_(config) {
  for (const GraphKeyframe& keyframe : earlier.keyframes) {
    on_keyframe(keyframe);
  }
  input_.trajectory = earlier.trajectory;
  std::copy_if(earlier.rows.begin(),
               earlier.rows.end(),
               std::back_inserter(input_.rows),
               [](const StoredRow& row) { return row.applied; });
  revisit_m_ = 0.0;
}

void PastRecord::on_scan(const OdomSample& sample) {
  input_.trajectory.push_back(sample);
  p_odom_m_ = sample.T_odom_base.p;
}

PastRecord::Place PastRecord::place_of(const GraphKeyframe& keyframe) const {
  Place place;
  place.in_map = keyframe.aligned;
  place.p_m = keyframe.aligned ? keyframe.T_map_odom.pose() * keyframe.T_odom_base.p
                               : T_frame_odom_ * keyframe.T_odom_base.p;
  return place;
}

void PastRecord::on_keyframe(const GraphKeyframe& keyframe) {
  Place place = place_of(keyframe);
  double step_m = 0.0;
  if (!places_.empty()) {
    const GraphKeyframe& before = input_.keyframes.back();
    step_m = before.odom_epoch == keyframe.odom_epoch
                 ? (keyframe.T_odom_base.p - before.T_odom_base.p).norm()
                 : PoseGraphOptions{}.loop_apart_m;
    place.driven_m = places_.back().driven_m + step_m;
    if (keyframe.aligned && !before.aligned) {
      for (std::size_t i = 0; i < places_.size(); ++i) {
        const GraphKeyframe& earlier = input_.keyframes[i];
        if (earlier.odom_epoch == keyframe.odom_epoch && !earlier.aligned) {
          places_[i].in_map = true;
          places_[i].p_m = keyframe.T_map_odom.pose() * earlier.T_odom_base.p;
        }
      }
    }
  }
  input_.keyframes.push_back(keyframe);
  places_.push_back(place);
  judge_revisit(step_m);
}

bool PastRecord::was_here_before() const {
  const PoseGraphOptions options;
  const Place& here = places_.back();
  const std::uint32_t epoch = input_.keyframes.back().odom_epoch;
  for (std::size_t i = 0; here.driven_m - places_[i].driven_m > options.loop_apart_m; ++i) {
    const bool comparable = here.in_map
                                ? places_[i].in_map
                                : !places_[i].in_map && input_.keyframes[i].odom_epoch == epoch;
    const Eigen::Vector3d apart = places_[i].p_m - here.p_m;
    if (comparable && apart.head<2>().norm() < options.loop_radius_m &&
        std::abs(apart.z()) < options.loop_height_m) {
      return true;
    }
  }
  return false;
}

void PastRecord::judge_revisit(double step_m) {
  if (was_here_before()) {
    revisit_m_ += step_m;
    apart_m_ = 0.0;
  } else if ((apart_m_ += step_m) > kRevisitEnds_m) {
    revisit_m_ = 0.0;
    corrected_at_m_ = 0.0;
  }
}

void PastRecord::on_row(const StoredRow& row,
                        const YawPose& T_map_odom,
                        const Eigen::Vector3d& p_odom_m) {
  if (!row.applied) {
    return;
  }
  input_.rows.push_back(row);
  overwritten_ = overwritten_ || row.update.mode == UpdateMode::kOverwrite;
  const Nanoseconds fix_ns = row.update.fix_stamp_ns;
  if (newest_row_ns_ != 0 && to_seconds(fix_ns - newest_row_ns_) > kOutage_s) {
    returned_ns_ = fix_ns;
    T_map_odom_before_outage_ = T_map_odom_;
  }
  newest_row_ns_ = std::max(newest_row_ns_, fix_ns);
  T_map_odom_ = T_map_odom.pose();
  p_odom_m_ = p_odom_m;
}

void PastRecord::on_new_epoch() {
  conclude();
  newest_row_ns_ = 0;
  returned_ns_.reset();
  revisit_m_ = corrected_at_m_ = 0.0;
  T_frame_odom_ = Pose();
}

void PastRecord::on_inserted(PointCloud points_odom) {
  if (!keeping_) {
    return;
  }
  inserted_.push_back(std::move(points_odom));
  if (inserted_.size() > kMostInserted) {
    conclude();
  }
}

bool PastRecord::gps_has_returned() const {
  return returned_ns_ && to_seconds(newest_row_ns_ - *returned_ns_) >= kSettled_s &&
         (T_map_odom_ * p_odom_m_ - T_map_odom_before_outage_ * p_odom_m_).norm() > kWorthIt_m;
}

bool PastRecord::may_begin() const {
  return !keeping_ && !overwritten_ && !input_.keyframes.empty() && !input_.trajectory.empty() &&
         (!began_ns_ ||
          to_seconds(input_.trajectory.back().stamp_ns - *began_ns_) >= config_.interval_s);
}

std::optional<std::string> PastRecord::due() const {
  if (!may_begin()) {
    return std::nullopt;
  }
  if (gps_has_returned()) {
    return "gps_returned";
  }
  const double needed_m =
      corrected_at_m_ > 0.0 ? corrected_at_m_ + kNextRevisit_m : kFirstRevisit_m;
  return revisit_m_ >= needed_m ? std::optional<std::string>("place_revisited") : std::nullopt;
}

PastSnapshot PastRecord::snapshot(const Config& config) {
  PastSnapshot snapshot;
  const bool from_gps = gps_has_returned();
  snapshot.stamp_ns = input_.trajectory.back().stamp_ns;
  snapshot.reason = from_gps ? "gps_returned" : "place_revisited";
  snapshot.input = input_;
  DriftConfig& drift = snapshot.input.drift;
  const auto widen = [](double& sigma, double configured) { sigma = std::max(sigma, configured); };
  widen(drift.position_sigma_m_sqrtm, config.drift.position_sigma_m_sqrtm);
  widen(drift.yaw_sigma_rad_sqrtm, config.drift.yaw_sigma_rad_sqrtm);
  widen(drift.tilt_sigma_rad_sqrtm, config.drift.tilt_sigma_rad_sqrtm);
  snapshot.options.known_loops = loops_;
  // What was too far off to be found may be near enough with GPS.
  snapshot.options.search_from = from_gps ? 0 : searched_;
  snapshot.local_map = config.local_map;
  began_ns_ = snapshot.stamp_ns;
  returned_ns_.reset();
  corrected_at_m_ = revisit_m_ < kFirstRevisit_m ? 0.0 : revisit_m_;
  keeping_ = true;
  inserted_.clear();
  return snapshot;
}

std::vector<PointCloud> PastRecord::take_inserted() {
  return std::exchange(inserted_, {});
}

void PastRecord::conclude() {
  keeping_ = false;
  inserted_.clear();
  inserted_.shrink_to_fit();
}

void PastRecord::conclude(const PastSnapshot& snapshot,
                          const CorrectedPast& past,
                          const Pose& T_odom_frame) {
  conclude();
  for (std::size_t i = 0; i < past.T_map_base.size(); ++i) {
    if (past.T_map_base[i]) {
      places_[i].in_map = past.frame == "map";
      places_[i].p_m = past.T_map_base[i]->p;
    }
  }
  T_frame_odom_ = past.frame == "map" ? Pose() : T_odom_frame.inverse();
  loops_ = past.registered;
  searched_ = snapshot.input.keyframes.size();
}

}  // namespace trigpoint::lio_mapper
