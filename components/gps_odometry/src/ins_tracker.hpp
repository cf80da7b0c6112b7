// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Everything in eskf18 that depends on the order of measurements: strapdown between samples, rest
// and wheels, heading with its rival, fixes that contradict the filter.
#pragma once

#include "eskf18.hpp"
#include "fix_scatter.hpp"
#include "heading.hpp"
#include "imu_checks.hpp"
#include "track.hpp"
#include "warm_start.hpp"
#include <Eigen/Core>

#include <array>
#include <string>

namespace trigpoint::gps_odometry {

/// A fix is judged in two parts: receivers' heights fail more often than their positions.
enum Part : std::size_t { kHorizontal = 0, kVertical = 1 };

/// The axes of map that a part consists of.
struct Span {
  int first;
  int count;
};

inline constexpr std::array<Part, 2> kParts{kHorizontal, kVertical};
inline constexpr std::array<Span, 2> kSpans{Span{0, 2}, Span{2, 1}};

/// The part's squared Mahalanobis distance.
double squared_sigmas(const Eigen::Vector3d& innovation_m, const Eigen::Matrix3d& S_m2, Part part);

/// What contradicting fixes have led to, of one part.
struct Contradiction {
  RefusedStreak streak;
  bool filter_is_suspect{false};  ///< the streak began after an outage
  Nanoseconds absorbed_ns{0};  ///< since when the error state holds a jump of the receiver; 0: no
  Nanoseconds jumped_ns{0};    ///< the newest jump that was absorbed
  /// It jumps again and again (stuck, dragged along, wandering): fixes are not used, until they go
  /// where the strapdown goes.
  bool unsteady{false};
  Nanoseconds stuck_ns{0};   ///< newest fix of those that stand where the strapdown cannot; 0: none
  bool runs_away{false};     ///< the strapdown, meanwhile
  Nanoseconds steady_ns{0};  ///< since when they do; 0: not yet
  Eigen::Vector3d steady_fix_map_m{Eigen::Vector3d::Zero()};  ///< the fix then
  Eigen::Vector3d steady_off_m{Eigen::Vector3d::Zero()};      ///< that fix less the antenna
};

/// Where the receiver was, by a fix of some seconds ago.
struct TrailPoint {
  Nanoseconds stamp_ns{0};  ///< 0: none yet
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Zero()};
  double variance_m2{0.0};  ///< horizontal
};

/// A fix, where the filter had the antenna after it, and the strapdown's way since.
struct FixOnTheWay {
  Nanoseconds stamp_ns{0};  ///< 0: none yet
  Eigen::Vector3d fix_map_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d antenna_map_m{Eigen::Vector3d::Zero()};
  Eigen::Vector3d way_m{Eigen::Vector3d::Zero()};    ///< map's axes, up to the newest fix
  Eigen::Vector3d said_m2{Eigen::Vector3d::Zero()};  ///< white variance by the receiver
};

struct InsTrack : Track {
  Eskf18 filter;
  ImuMean imu;                      ///< the newest sample
  Nanoseconds saturated_ns{0};      ///< of the newest IMU sample that was; 0: none
  Nanoseconds quiet_ns{0};          ///< end of the newest window in which the IMU did not shake
  double confirmed_speed_mps{0.0};  ///< the highest at which fixes that moved agreed
  Nanoseconds no_side_slip_ns{0};   ///< of the newest such measurement
  HeadingSearch heading;

  /// The same with the heading turned round, until the data decide (a start in reverse).
  Eskf18 rival;
  bool has_rival{false};
  double log_ratio{0.0};    ///< of the likelihoods, filter to rival
  bool yaw_weighed{false};  ///< a heading that was heard has been weighed between them

  Eigen::Vector3d fix_variance_m2{Eigen::Vector3d::Zero()};   ///< of the newest fix; 0: none yet
  Eigen::Vector3d held_variance_m2{Eigen::Vector3d::Zero()};  ///< peak hold of it
  std::array<Contradiction, 2> parts;
  /// Of the newest fix that was used, or was not because the receiver is unsteady; 0: none yet.
  Nanoseconds heard_ns{0};
  std::array<FixOnTheWay, 2> lately;  ///< the newer one last
  std::array<FixScatter, 2> scatter;  ///< by part
  /// Who was right is open: held in what is published (m, per axis of map).
  Eigen::Vector3d doubt_m{Eigen::Vector3d::Zero()};
  Nanoseconds doubt_until_ns{0};

  /// Two fixes of the way: the newer one takes the older one's place when it is old enough.
  std::array<TrailPoint, 2> trail;
  Nanoseconds moves_until_ns{0};  ///< by the fixes, however quiet the IMU
};

/// The rules by which measurements change an InsTrack.
class InsTracker {
 public:
  using State = InsTrack;
  static constexpr const char* kSource = "eskf18";

  InsTracker(const Config& config, const Eigen::Vector3d& lever_base_m);

  void apply(InsTrack& track, const CheckedImu& imu) const;
  FixOutcome apply(InsTrack& track, const MapFix& fix) const;
  /// Goes on from another filter's state; the phase becomes kRunning.
  void warm_start(InsTrack& track, const WarmState& state) const;
  FixOutcome apply(InsTrack& track, const CheckedTwist& twist) const;
  FixOutcome apply(InsTrack& track, const Heading& yaw) const;

  Estimate estimate(const InsTrack& track) const;

  double speed_mps(const InsTrack& track) const { return track.filter.v_map_mps.norm(); }

  double yaw_sigma_rad(const InsTrack& track) const;
  bool is_doubtful(const InsTrack& track) const;
  /// Whether an IMU that comes back after this time needs no new start.
  bool bridges(double gap_s) const;

  void change_frame(InsTrack& track,
                    const Eigen::Matrix3d& R_new_old,
                    const Eigen::Vector3d& t_new_old) const;

 private:
  /// A fix against the filter: innovation, its covariance by the filter, white covariance.
  struct Judgement {
    Eigen::Vector3d innovation_m;
    Eigen::Matrix3d S_filter_m2;
    Eigen::Matrix3d R_m2;
    std::array<double, 2> ratio;  ///< squared Mahalanobis distance over the gate, by part

    Eigen::Matrix3d S_m2() const { return S_filter_m2 + R_m2; }
  };

  // ins_tracker.cpp: the IMU.
  void start(InsTrack& track, const CheckedImu& imu) const;
  InsNoise noise(const InsTrack& track) const;
  void advance(InsTrack& track, Nanoseconds stamp_ns) const;
  void step(InsTrack& track, const CheckedImu& imu, double gap_s, bool saturated) const;
  bool is_at_rest(const InsTrack& track, const QuietWindow& quiet) const;
  void constrain(InsTrack& track, const CheckedImu& imu) const;

  // ins_aiding.cpp: optional inputs.
  void weigh_yaw(InsTrack& track, const Heading& yaw) const;
  CoursePoint course_point(const InsTrack& track, const MapFix& fix) const;
  void prove_heading(InsTrack& track, const MapFix& fix) const;

  // ins_fixes.cpp: fixes and heading.
  FixOutcome align(InsTrack& track, const MapFix& fix) const;
  FixOutcome refuse_aligning(InsTrack& track, const MapFix& fix, double step_m) const;
  void begin_running(InsTrack& track, const MapFix& fix, const HeadingEstimate& heading) const;
  void weigh_rival(InsTrack& track, const MapFix& fix) const;
  void follow_receiver(InsTrack& track, const MapFix& fix) const;
  static double silence_s(const InsTrack& track, const MapFix& fix);
  void renew_fix_error(Eskf18& filter, const MapFix& fix, Part part) const;
  Judgement judge(const Eskf18& filter, const MapFix& fix) const;
  void watch_scatter(InsTrack& track, const MapFix& fix) const;
  MapFix as_it_scatters(const InsTrack& track, const MapFix& fix) const;
  void keep_on_the_way(InsTrack& track, const MapFix& fix) const;
  FixOutcome filter_fix(InsTrack& track, const MapFix& fix) const;
  bool has_guessed(const InsTrack& track, Nanoseconds stamp_ns) const;
  bool resolve(InsTrack& track, const MapFix& fix, Part part, const Judgement& judgement) const;
  bool was_unproven(InsTrack& track,
                    const MapFix& fix,
                    Part part,
                    const Judgement& judgement) const;
  void absorb(InsTrack& track, const MapFix& fix, Part part, const Judgement& judgement) const;
  bool has_come_back(InsTrack& track, const MapFix& fix, Part part) const;
  bool is_steady_again(InsTrack& track, const MapFix& fix, Part part) const;
  void note_stuck(InsTrack& track, const MapFix& fix, Part part) const;
  void recover(InsTrack& track, const MapFix& fix, Part part) const;
  bool is_over(const InsTrack& track, const MapFix& fix, Part part) const;
  void end_absorptions(InsTrack& track, const MapFix& fix) const;
  void clip(Judgement& judgement, Part part) const;
  static void ignore(Judgement& judgement, Part part);
  void hold_doubt(InsTrack& track, const MapFix& fix, const Judgement& judgement) const;
  void accept(InsTrack& track, const MapFix& fix) const;
  void watch_motion(InsTrack& track, const MapFix& fix) const;
  Eigen::Vector3d doubt_variance_m2(const InsTrack& track) const;
  Eigen::Vector3d added_variance_m2(const InsTrack& track) const;

  Estimate aligning_estimate(const InsTrack& track) const;
  double filter_yaw_sigma_rad(const InsTrack& track) const;
  /// Probability of the rival heading.
  double rival_share(const InsTrack& track) const;

  template <typename Change>
  static void for_each(InsTrack& track, const Change& change) {
    change(track.filter);
    if (track.has_rival) {
      change(track.rival);
    }
  }

  Config config_;
  Eigen::Vector3d lever_base_m_;
  std::array<double, 2> gate_;  ///< chi-square limits, by part
  double gate_axis_;            ///< 1 degree of freedom
  double gate3_;                ///< 3 degrees of freedom
};

}  // namespace trigpoint::gps_odometry
