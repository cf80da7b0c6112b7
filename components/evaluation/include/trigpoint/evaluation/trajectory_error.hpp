// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Errors of a trajectory against a reference, with the definitions of
// [1] M. Grupp, "evo: Python package for the evaluation of odometry and SLAM", 2017 (metrics APE
//     and RPE and their statistics);
// [2] Z. Zhang, D. Scaramuzza, "A Tutorial on Quantitative Trajectory Evaluation for
//     Visual(-Inertial) Odometry", IROS 2018 (alignment with 4 and 6 degrees of freedom);
// [3] A. Geiger, P. Lenz, R. Urtasun, "Are we ready for Autonomous Driving? The KITTI Vision
//     Benchmark Suite", CVPR 2012, and its development kit (relative error per distance).
#pragma once

#include "trigpoint/base/pose.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/export/session.hpp"

#include <Eigen/Core>

#include <array>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

using exporter::StampedPose;
using exporter::Trajectory;

inline constexpr Nanoseconds kDefaultGap_ns = 100'000'000;

/// The same moment in both.
struct PosePair {
  Nanoseconds stamp_ns{0};
  Pose estimate;
  Pose reference;
};

/// How much of the reference the estimate speaks about. A reference pose is covered when a pose of
/// the estimate is no further than the largest gap away.
struct Coverage {
  double from_first{0.0};  ///< of the reference poses since the estimate's first one, 0 to 1
  double whole{0.0};       ///< of all reference poses, 0 to 1
};

struct Association {
  std::vector<PosePair> pairs;
  Coverage coverage;
};

/// The pose at `stamp_ns`: interpolated between neighbours at most 2 * largest_gap_ns apart (so
/// that none is further away than the gap); nullopt outside and in wider gaps.
std::optional<Pose> pose_at(const Trajectory& trajectory,
                            Nanoseconds stamp_ns,
                            Nanoseconds largest_gap_ns = kDefaultGap_ns);

/// The reference interpolated at the estimate's stamps. (evo takes the nearest pose instead, which
/// at 10 m/s and 10 ms puts 10 cm of the method into the result.)
Association associate(const Trajectory& estimate,
                      const Trajectory& reference,
                      Nanoseconds largest_gap_ns = kDefaultGap_ns);

enum class AlignmentKind { kNone, kYawTranslation, kSe3 };

std::string name_of(AlignmentKind kind);

/// T_reference_estimate that minimises the squared distances of positions: [2] eq. 7-9 without
/// scale (Umeyama) and its version with yaw only. nullopt when the positions do not determine it:
/// fewer than 2 (yaw) or 3 (SE(3)) pairs, or all in one place (yaw) or on one line (SE(3)).
std::optional<Pose> align(const std::vector<PosePair>& pairs, AlignmentKind kind);

std::vector<PosePair> place_estimates(const Pose& T_reference_estimate,
                                      std::vector<PosePair> pairs);

/// As evo's: of magnitudes; median of an even number is the mean of the two in the middle.
struct Statistics {
  std::size_t count{0};
  double rmse{0.0};
  double mean{0.0};
  double median{0.0};
  double max{0.0};
  double min{0.0};
  double standard_deviation{0.0};  ///< about the mean, of all (not of a sample)
};

/// Of |values|; all NaN when there are none.
Statistics statistics_of(std::vector<double> values);

/// APE, translation part and rotation angle ([1]).
struct AbsoluteError {
  Statistics position_m;
  Statistics horizontal_m;
  std::array<Statistics, 3> axes_m;                         ///< x y z of the reference's frame
  Eigen::Vector3d bias_m{Eigen::Vector3d::Constant(kNaN)};  ///< mean of estimate - reference
  Statistics rotation_deg;
};

AbsoluteError absolute_error(const std::vector<PosePair>& pairs);

/// Moments at which something begins that does not go on from what was before: another drive of a
/// session that was resumed, another odom epoch. What is between two poses with one of these after
/// the first and not after the second was not driven. In order of time.
using Breaks = std::vector<Nanoseconds>;

bool is_between(const Breaks& breaks, Nanoseconds before_ns, Nanoseconds after_ns);

/// Mean over all segments whose length along the reference is the first that reaches `length_m`,
/// one from each pose ([3] starts at every tenth). No segment goes over a break.
struct RelativeError {
  double length_m{0.0};
  std::size_t segments{0};  ///< 0: the drive is shorter, the numbers are NaN
  double translation_percent{kNaN};
  double rotation_deg_per_m{kNaN};
};

RelativeError relative_error(const std::vector<PosePair>& pairs,
                             double length_m,
                             const Breaks& breaks = {});

/// The same for positions only (a reference without attitude): |change of the aligned estimate -
/// change of the reference| over the segment; rotation is NaN.
RelativeError relative_position_error(const std::vector<PosePair>& aligned_pairs,
                                      double length_m,
                                      const Breaks& breaks = {});

/// The motion from the first to the last pair, seen by the estimate against the reference.
struct EndToEnd {
  double error_m{kNaN};
  double error_deg{kNaN};
  double distance_m{kNaN};  ///< along the reference, without what lies over breaks
  double percent{kNaN};     ///< error over distance
};

EndToEnd end_to_end(const std::vector<PosePair>& pairs, const Breaks& breaks = {});

/// Sum of the distances between consecutive poses without a break between them.
double length_of(const Trajectory& trajectory, const Breaks& breaks = {});

}  // namespace trigpoint::evaluation
