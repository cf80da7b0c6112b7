// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/geodesy/local_frame.hpp"

#include "alignment/alignment_window.hpp"
#include "alignment/heading_prior.hpp"
#include "alignment/placement_history.hpp"
#include "alignment/pose_buffer.hpp"
#include "checks/accepted_fix.hpp"
#include "checks/fix_queue.hpp"
#include "checks/foreign_source.hpp"
#include "checks/gps_sources.hpp"
#include "checks/receiver_worth.hpp"
#include "checks/verdicts.hpp"
#include "control/algorithm_one.hpp"
#include "control/fix_monitor.hpp"
#include "fusion/hand_over.hpp"
#include "fusion/rows.hpp"

#include <algorithm>
#include <array>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>

namespace trigpoint::fusion_gate {

inline constexpr const char* kCoasting = "; LIO is blind along it: coasting";

/// The gate's state and its flow; one file a theme: gate_gps (sources, verdicts), gate_alignment
/// (pairs, rows, LIO's epochs), gate_smooth (mode smooth), gate_output (map and status).
struct FusionGate::Impl {
  Impl(const Config& config_in, const RobotConfig& robot_in);
  // --- GPS in
  void take_gps_odometry(const Odometry& odometry, const std::string& writer, Output& out);
  void take_gps_status(const GpsStatus& status, const std::string& writer, Output& out);
  void take_raw_fix(const GnssFix& fix, Output& out);

  struct Told {
    std::uint64_t fixes{0};                        // of which nobody had told yet
    std::map<std::string, std::uint64_t> refused;  // of them, by reason
  };

  Told take_records(const GpsStatus& status, const std::optional<GpsStatus>& last, Output& out);
  void take_back_retold(const Told& told,
                        std::uint64_t retold,
                        const std::map<std::string, std::uint64_t>& refusals);
  void settle_others(const GpsStatus& status,
                     const std::optional<GpsStatus>& last,
                     const Told& told);
  std::uint64_t open_fixes(const GpsStatus& status, const std::optional<GpsStatus>& last) const;
  bool tell_of(ToldFix told, Output& out);
  void note_accepted(const AcceptedFix& fix);
  void record_unjudged(const ToldFix& told, const Refusal& otherwise);
  void refuse_waiting(const Refusal& why);
  void follow_healthiest(Output& out);
  bool names_datum(const std::string& id) const;
  ForeignSource& foreign(const std::string& writer);

  // --- alignment and rows
  void judge_waiting(Output& out);
  bool is_mapper_awaited(Output& out);
  void note_refused(const ToldFix& told, const PoseBuffer::Answer& lio_pose);
  void take_yaw(const YawMeasurement& yaw, Output& out);
  bool is_lio_lost() const;
  void hear_heading_of(const Odometry& gps_in_map);
  void tell_of_heading(const std::optional<YawPrior>& prior, Output& out);
  void judge(const AcceptedFix& fix, const PoseBuffer::Answer& lio_pose, Output& out);
  void add_pair(const AcceptedFix& fix, const PoseBuffer::Sample& at_fix, Output& out);
  void make_rows(const AcceptedFix& fix, Output& out);
  void send_rows(const AcceptedFix& fix, const AxisChoices& choices, Output& out);

  // --- mode smooth
  void remember_raw(const AcceptedFix& fix);
  const AcceptedFix* raw_of(Nanoseconds stamp_ns) const;
  void measure_receiver(const Witness& witness);
  Eigen::Vector3d least_share_of(const Witness& witness) const;
  Witness witness_of(const AcceptedFix& fix, const PoseBuffer::Sample& at_fix) const;
  void judge_values(const AcceptedFix& fix, const PoseBuffer::Sample& at_fix, Output& out);
  void go_back(const MonitorOutcome& outcome, const Witness& witness, Output& out);
  void settle(const Eigen::Vector3d& slid_map_m, const Witness& witness, Output& out);
  void replace(const Witness& witness, const Alignment& alignment, Output& out);
  bool is_replacement_awaited(Output& out);
  AxisChoices choose_smoothly(const Eigen::Vector3d& reported_m2) const;
  AxisChoice choose_trusted(int axis, double variance_m2) const;
  bool carries_though_doubted(int axis) const;
  void tell_changes(const MonitorOutcome& outcome, Output& out) const;
  std::optional<Alignment> best_alignment() const;

  bool aligned() const { return lio && lio->aligned; }

  // --- LIO in
  void take_lio_status(const LioStatus& status, Output& out);
  void begin_epoch(const LioStatus& status, Output& out);

  // --- map out
  bool lio_carries() const;
  bool gps_carries() const;
  std::optional<Odometry> gps_in_map() const;
  Eigen::Vector3d gps_variance_m2() const;
  Eigen::Vector3d variance_of(const AcceptedFix& fix) const;
  void publish_lio(const Odometry& odometry, Output& out);
  void publish_gps(Output& out);
  void publish(const Odometry& odometry, const Pose& unchanged, Output& out);
  bool has_odom_jumped(const Odometry& odometry);
  Odometry with_covariance_in_local_map(const Odometry& odometry) const;
  bool can_be_published(const Odometry& odometry) const;
  Pose without_step(const Odometry& odometry);
  void keep_motion(bool goes_on);
  Pose as_predicted(Nanoseconds stamp_ns, const Pose& otherwise) const;
  void remember_gps(const Odometry& gps_in_map);
  bool gps_dead_reckons() const;
  Eigen::Vector3d gps_velocity_error_mps() const;
  Pose as_gps_moved(const Odometry& base, const Pose& predicted) const;

  // --- status
  FusionStatus status() const;
  AxisStatus axis_status(std::size_t axis, const AxisChoice& choice) const;
  std::optional<std::string> missing_fix() const;
  void finish(Output& out, bool status_wanted);

  void advance(Nanoseconds stamp_ns) { now_ns = std::max(now_ns, stamp_ns); }

  void tell(Output& out, Severity severity, const char* code, const std::string& text) const {
    out.events.push_back({severity, now_ns, code, text});
  }

  std::string datum_id() const { return frame ? frame->datum().id() : std::string(); }

  Config config;
  RobotConfig robot;
  Mode mode;
  Eigen::Vector3d threshold_m;
  GpsSources sources;
  Verdicts verdicts;
  RowMaker rows;
  PoseBuffer lio_poses;
  AlignmentWindow window;
  double window_distance_m{0.0};        // driven when the window last heard of LIO
  HeadingPrior heading;                 // measured
  HeadingPrior filter_heading;          // of the GPS filter, for where LIO is blind
  std::set<std::string> headings_told;  // what was wrong with them, once each
  FixQueue queue;  // told of, waiting for earlier fixes and for LIO to cover their stamps
  std::optional<Nanoseconds> alignment_sent_ns;  // and the mapper has not said that it has it
  bool alignment_not_taken{false};               // the mapper was waited for, in vain
  std::map<std::string, ForeignSource> foreign_sources;
  std::optional<geodesy::LocalFrame> frame;
  std::optional<LioStatus> lio;

  Nanoseconds now_ns{0};  // data time: the newest stamp of any odometry or status
  std::optional<Nanoseconds> first_gps_ns;
  std::optional<Nanoseconds> last_lio_ns;
  std::optional<Nanoseconds> last_imu_rate_ns;
  std::optional<Nanoseconds> last_fused_ns;
  std::optional<Nanoseconds> last_status_ns;
  std::optional<Nanoseconds> last_accepted_ns;
  std::deque<double> fix_intervals_s;
  std::uint64_t fixes_seen{0};
  bool status_is_news{false};

  // --- mode smooth
  struct AwaitedReplacement {
    Nanoseconds since_ns;
    Eigen::Vector3d here_odom_m;
    Eigen::Vector3d target_map_m;  // of here
    double first_distance_m;       // from it, when it was sent
    bool places_anew{false};       // after a slide
  };

  FixMonitor monitor;
  PlacementHistory placements;
  HandOver hand_over;
  std::deque<AcceptedFix> raw_fixes;  // the newest, in map
  ReceiverWorth receiver;             // what they are worth
  std::array<bool, 3> sigma_passes{true, true, true};
  std::optional<AwaitedReplacement> awaited;

  // --- what fusion/odometry rested on last
  enum class Carrier { kLio, kGps };
  std::optional<Odometry> last_raw;
  std::deque<Odometry> recent_raw;   // up to last_raw: how the robot moves
  std::deque<Odometry> recent_odom;  // the same as LIO tells it
  std::optional<Carrier> last_carrier;
  std::string last_gps_writer;  // of the GPS odometry that carried
  PoseBuffer gps_poses;         // base_link in map by the followed GPS filter
  std::string gps_poses_writer;
  Eigen::Vector3d gps_error_map_mps{Eigen::Vector3d::Zero()};  // of its velocity, when it took over
  std::uint32_t last_epoch{0};
  std::optional<Odometry> last_odom;
  std::optional<Nanoseconds> odom_jumped_at_status_ns;
  YawPose last_T_map_odom;
  std::optional<PoseCovariance> last_scan_covariance;
};

}  // namespace trigpoint::fusion_gate
