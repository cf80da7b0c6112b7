// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The recent past of the filter, so that GPS rows that come late count as if they had come in time.
// References: [1] T. D. Larsen et al., "Incorporation of time delayed measurements in a
// discrete-time Kalman filter", CDC 1998. [2] ROS REP-105: odom is continuous.
#pragma once

#include "trigpoint/base/messages.hpp"

#include "propagation.hpp"
#include "state.hpp"

#include <deque>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// The filter at one scan.
struct ScanRecord {
  Nanoseconds stamp_ns{0};
  Path path;          ///< as propagated from the previous scan to this one
  State before_rows;  ///< after the scan's own update
  ErrorMatrix covariance_before_rows{ErrorMatrix::Identity()};
  /// Error here after the scan's update over the error at the previous scan, update included.
  ErrorMatrix transition{ErrorMatrix::Identity()};
  std::vector<StateUpdate> rows;  ///< whose fixes lie in (previous scan, this one], by stamp
  State state_odom_free;          ///< after the rows, the pose where they moved it to
  State state;                    ///< the same with odom moved along, so that the pose stayed
  ErrorMatrix covariance{ErrorMatrix::Identity()};
};

enum class RowOutcome { kApplied, kWaits, kRefused };

struct RowVerdict {
  RowOutcome outcome{RowOutcome::kRefused};
  std::string reason;  ///< short and stable, when refused
};

/// A row z = T_map_odom (p + R l) predicted at a fix's stamp from the state at a later scan.
struct RowPrediction {
  Eigen::Vector3d position_map_m;
  Eigen::Matrix<double, 3, error::kSize> jacobian;
};

/// `path` ends at the scan. What the path says about the time between fix and scan is attitude
/// change and displacement without velocity; velocity comes from the state, so that the row teaches
/// it.
RowPrediction predict_row(const State& state_at_scan,
                          const Path& path,
                          Nanoseconds fix_stamp_ns,
                          const Eigen::Vector3d& lever_arm_base_m);

/// Applying a row at scan f means to condition x_f on it and to run the linear system
/// x_j = M_j x_{j-1} again up to the newest scan, with later rows applied anew in order of their
/// stamps: exact in a linear system, and the same whatever the order of arrival.
class RowHistory {
 public:
  /// What a row moves in odom (position and heading) is carried over into T_map_odom unless
  /// `odom_is_fixed` is false (which is for tests against textbook filters).
  RowHistory(const RowsConfig& config, bool odom_is_fixed = true);

  bool empty() const { return records_.empty(); }

  const ScanRecord& newest() const { return records_.back(); }

  const std::deque<ScanRecord>& records() const { return records_; }

  /// Sets `state` and `covariance` of the record from those before rows.
  void push(ScanRecord record);

  RowVerdict apply(const StateUpdate& update);

  /// Rows that wait and are now covered by the newest scan, oldest first.
  std::vector<StateUpdate> take_covered();

  std::size_t waiting() const { return waiting_.size(); }

  /// The first T_map_odom of the epoch, uncorrelated with all else.
  void align(const Alignment& alignment);

 private:
  RowVerdict check(const StateUpdate& update) const;
  void replay_from(std::size_t first);
  /// The state after the record's rows; sets the covariance.
  static State apply_rows_of(ScanRecord& record);
  void overwrite(std::size_t anchor, const StateUpdate& update);

  RowsConfig config_;
  bool odom_is_fixed_;
  std::deque<ScanRecord> records_;
  std::vector<StateUpdate> waiting_;
};

}  // namespace trigpoint::lio_mapper
