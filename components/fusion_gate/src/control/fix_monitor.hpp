// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/fusion_gate/config.hpp"

#include "alignment/alignment_window.hpp"
#include "alignment/pose_buffer.hpp"
#include "checks/accepted_fix.hpp"
#include "checks/displacement.hpp"
#include "checks/sighting.hpp"
#include "control/settling.hpp"
#include "control/trust.hpp"

#include <array>
#include <deque>
#include <limits>
#include <optional>

namespace trigpoint::fusion_gate {

/// One fix with everything that it is held against.
struct Witness {
  AcceptedFix fix;                 ///< what would become the row
  std::optional<AcceptedFix> raw;  ///< the receiver's own statement in map, when it is known
  PoseBuffer::Sample lio_pose;     ///< at its stamp

  /// What the receiver said, as far as that is known.
  const AcceptedFix& as_received() const { return raw ? *raw : fix; }
};

/// What follows from a fix for T_map_odom.
struct MonitorOutcome {
  std::array<bool, 2> trusted{};          ///< by part
  std::array<Trust::Change, 2> change{};  ///< by part
  /// By part: what was believed since then was wrong.
  std::array<std::optional<Nanoseconds>, 2> taken_in_since_ns;
  std::optional<AlignmentSolution> realignment;  ///< the alignment itself was wrong
  /// East and north by which trusted fixes contradict T_map_odom's own covariance after a silence.
  std::optional<Eigen::Vector3d> slid_map_m;
  /// The fix contradicts that covariance and the question is open. A row would turn T_map_odom's
  /// yaw by what LIO slid.
  bool is_settling{false};
};

/// Mode smooth's tests of the values: each fix against the pose in map and, over 2, 10 and 30 s,
/// GPS displacement against LIO displacement.
class FixMonitor {
 public:
  FixMonitor(const Config& config, const Eigen::Vector3d& antenna_position_base_m);

  /// Adds up how far LIO went blind. `distance_m` driven so far.
  void on_lio_status(const LioStatus& lio, double distance_m);

  /// The mapper is aligned.
  MonitorOutcome judge(const Witness& witness, const LioStatus& lio);

  /// The GPS filter refused the fix for what it says. It is no evidence for the pose, but what the
  /// receiver said counts when the next one says it again. `witness.raw` is known.
  void on_refused(const Witness& witness);

  /// The fixes that the alignment rests on are trusted ones.
  void on_alignment(const Witness& witness);

  const Trust& trust(Part part) const { return trusts_[index_of(part)]; }

  /// Rows of the fix that was judged last went to the mapper along these axes of map.
  void on_rows(const std::array<bool, 3>& axes);

  /// T_map_odom was put where the fixes say: on probation, since they may be wrong.
  void on_settled() {
    unsettled_m2_.head<2>().setZero();
    confirmed_s_ = 0.0;
  }

  /// T_map_odom went back to where it was: what was believed since then is none of its offsets.
  void on_taken_back(bool height_only) {
    unsettled_m2_.z() = 0.0;
    if (!height_only) {
      unsettled_m2_.setZero();
    }
  }

  /// Variance along the axes of map that LIO gained by driving blind since the last row along them.
  Eigen::Vector3d blind_variance_map_m2(const LioStatus& lio) const;

  bool is_blind(const LioStatus& lio, int axis_map) const;

  /// Variance of the trusted fixes of the last 30 s against LIO's displacement, less what LIO may
  /// have drifted: what the fixes are worth, whatever they say of themselves. NaN when there are
  /// too few of them, or LIO was blind.
  Eigen::Vector3d scatter_map_m2(const LioStatus& lio) const;

  /// What the doubted fix that was judged last is worth, along any axis of the level: the
  /// receiver's own variance and what it is off beyond what LIO explains. A receiver that lies
  /// along an axis that LIO sees lies no less along one that it does not see. Infinite where no fix
  /// was doubted, or what it is off cannot be told.
  double doubted_variance_m2() const { return doubted_m2_; }

  /// A new alignment is in force, or a new odom epoch: nothing of before can be compared.
  void begin_anew();

  /// LIO found its place again: displacements across the step mean nothing.
  void on_odom_step() {
    sightings_.clear();
    refused_.clear();
    settling_.interrupt();
  }

 private:
  Sighting sighting_of(const Witness& witness) const;
  Difference offset_of(const AcceptedFix& fix,
                       const Sighting& sighting,
                       const LioStatus& lio) const;
  Eigen::Matrix3d lio_may_be_off_m2(const Sighting& sighting,
                                    const LioStatus& lio,
                                    Part part) const;
  void note_trusted(const Witness& witness,
                    const Sighting& sighting,
                    const LioStatus& lio,
                    MonitorOutcome& outcome);
  void begin_with_refused(const Sighting& sighting, const LioStatus& lio);
  bool is_new_solution(const Sighting& sighting, const LioStatus& lio) const;
  Difference level_difference(const AcceptedFix& fix,
                              const Sighting& sighting,
                              const LioStatus& lio,
                              Part part) const;
  Tests test(const Witness& witness,
             const Sighting& sighting,
             const LioStatus& lio,
             Part part) const;
  double worth_of_doubted_m2(const Witness& witness,
                             const Sighting& sighting,
                             const LioStatus& lio) const;
  std::optional<Nanoseconds> taken_in_since(const Sighting& sighting,
                                            const LioStatus& lio,
                                            Part part) const;
  const Sighting* trusted_before(Nanoseconds stamp_ns, double window_s, Part part) const;
  void forget_since(Nanoseconds stamp_ns, Part part);
  void keep(const Sighting& sighting);
  std::optional<AlignmentSolution> rival_of(const Sighting& sighting, Part doubted);

  Config config_;
  Eigen::Vector3d lever_arm_base_m_;
  std::array<Trust, 2> trusts_;
  std::deque<Sighting> sightings_;
  AlignmentWindow rival_;
  Eigen::Vector3d blind_m_{Eigen::Vector3d::Zero()};  // axes of odom, summed up
  double lio_distance_m_{0.0};
  std::array<std::optional<Sighting>, 2> last_trusted_;
  std::array<std::optional<Sighting>, 3> last_row_;  // by axis of map
  // By how much trusted fixes are still off T_map_odom: believed, and not yet taken in.
  Eigen::Vector3d unsettled_m2_{Eigen::Vector3d::Zero()};
  Settling settling_;
  double doubted_m2_{std::numeric_limits<double>::infinity()};
  std::deque<Sighting> refused_;  // by the filter, since a fix was judged
  double confirmed_s_{0.0};       // time for which fixes confirmed the alignment
  std::array<bool, 2> crept_{};   // by part: the doubt began with a displacement, not with a jump
};

}  // namespace trigpoint::fusion_gate
