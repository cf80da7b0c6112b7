// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "row_history.hpp"

#include "trigpoint/base/so3.hpp"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>

namespace trigpoint::lio_mapper {

using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace {

bool is_admitted(const StateUpdate& update, int axis) {
  return update.decision[static_cast<std::size_t>(axis)] == AxisDecision::kFused;
}

bool admits_any(const StateUpdate& update) {
  return is_admitted(update, 0) || is_admitted(update, 1) || is_admitted(update, 2);
}

/// Where nothing else is known a fix is believed with so many times the variance that it states:
/// receivers promise too much.
constexpr double kTrusted = 4.0;

/// The admitted axes' rows and columns, which is what is left of a Gaussian when the others are not
/// told. The others get variance 1, which no row of H and no innovation meets.
Matrix3d admitted_covariance(const StateUpdate& update) {
  Matrix3d R = Matrix3d::Identity();
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      if (is_admitted(update, i) && is_admitted(update, j)) {
        R(i, j) = update.covariance_map_m2(i, j);
      }
    }
  }
  return R;
}

bool is_usable(const StateUpdate& update) {
  if (!update.position_map_m.allFinite() || !update.lever_arm_base_m.allFinite()) {
    return false;
  }
  if (update.mode == UpdateMode::kOverwrite) {
    return true;
  }
  if (!(update.inflation >= 1.0 && std::isfinite(update.inflation))) {
    return false;
  }
  const Matrix3d R = admitted_covariance(update);
  return R.allFinite() && R.isApprox(R.transpose(), 1e-6) && R.llt().info() == Eigen::Success &&
         R.diagonal().minCoeff() > 0.0;
}

/// A row's covariance is inflated so that many fixes with the same error count as one. Where the
/// prior knows less than a single fix, as behind a way that LIO could not see, there is nothing
/// that would count twice: the fix brings the prior to its own variance (times kTrusted) and no
/// further, which is right whatever the errors of the two have in common [S. J. Julier and J. K.
/// Uhlmann, "A non-divergent estimation algorithm in the presence of unknown correlations", ACC
/// 1997, with all weight on the fix]: 1 / r = 1 / own - 1 / prior, direction by direction in units
/// of the fix's own covariance.
Matrix3d inflated_where_needed(const Matrix3d& inflated_m2,
                               double inflation,
                               const Matrix3d& prior_m2) {
  if (inflation <= kTrusted) {
    return inflated_m2;
  }
  const Eigen::LLT<Matrix3d> root(inflated_m2 / inflation);
  const Matrix3d half = root.matrixL().solve(prior_m2);
  const Eigen::SelfAdjointEigenSolver<Matrix3d> prior(root.matrixL().solve(half.transpose()));
  Vector3d times_own = Vector3d::Constant(inflation);
  for (int i = 0; i < 3; ++i) {
    const double known = 1.0 / kTrusted - 1.0 / std::max(prior.eigenvalues()[i], kTrusted);
    times_own[i] = known * inflation > 1.0 ? 1.0 / known : inflation;
  }
  const Matrix3d directions = root.matrixL() * prior.eigenvectors();
  return directions * times_own.asDiagonal() * directions.transpose();
}

/// Of an error of the place in odom the part that is a slide: all of it along axes where it is
/// large, nothing where the map holds the place.
Matrix3d slid_share(const Matrix3d& place_odom_m2) {
  constexpr double kHeld_m = 0.03;
  const Eigen::SelfAdjointEigenSolver<Matrix3d> axes(place_odom_m2);
  const Eigen::Array3d m2 = axes.eigenvalues().array().max(0.0);
  return axes.eigenvectors() * (m2 / (m2 + kHeld_m * kHeld_m)).matrix().asDiagonal() *
         axes.eigenvectors().transpose();
}

/// The standard update with the admitted rows, in place.
void condition_on(const StateUpdate& update,
                  const RowPrediction& prediction,
                  State& state,
                  ErrorMatrix& covariance) {
  Eigen::Matrix<double, 3, error::kSize> H = prediction.jacobian;
  Vector3d innovation = update.position_map_m - prediction.position_map_m;
  for (int i = 0; i < 3; ++i) {
    if (!is_admitted(update, i)) {
      H.row(i).setZero();
      innovation[i] = 0.0;
    }
  }
  const Eigen::Matrix<double, 3, error::kSize> HP = H * covariance;
  const Matrix3d prior_m2 = HP * H.transpose();
  const Matrix3d S =
      prior_m2 + inflated_where_needed(admitted_covariance(update), update.inflation, prior_m2);
  const Eigen::Matrix<double, 3, error::kSize> gain_transposed = S.llt().solve(HP);
  state = boxplus(state, gain_transposed.transpose() * innovation);
  covariance -= HP.transpose() * gain_transposed;
  make_symmetric(covariance);
}

}  // namespace

RowPrediction predict_row(const State& state,
                          const Path& path,
                          Nanoseconds fix_stamp_ns,
                          const Vector3d& lever_arm_base_m) {
  const PathNode& end = path.back();
  const double age_s = to_seconds(end.stamp_ns - fix_stamp_ns);
  const Pose then = path.at(fix_stamp_ns);
  const Vector3d displacement_base_m =
      end.T_odom_base.q.conjugate() * (then.p - end.T_odom_base.p + age_s * end.v_odom_mps);
  const Vector3d lever_base_m = end.T_odom_base.q.conjugate() * (then.q * lever_arm_base_m);
  const Vector3d offset_base_m = displacement_base_m + lever_base_m;
  const Matrix3d R_odom_base = state.T_odom_base.q.toRotationMatrix();
  const Matrix3d R_map_odom = state.placement().pose().q.toRotationMatrix();
  const Vector3d antenna_odom_m =
      state.T_odom_base.p - age_s * state.v_odom_mps + R_odom_base * offset_base_m;

  RowPrediction row;
  row.position_map_m = R_map_odom * antenna_odom_m + state.T_map_odom.p;
  row.jacobian.setZero();
  row.jacobian.middleCols<3>(error::kPosition) = R_map_odom;
  row.jacobian.middleCols<3>(error::kRotation) = -R_map_odom * R_odom_base * hat(offset_base_m);
  row.jacobian.middleCols<3>(error::kVelocity) = -age_s * R_map_odom;
  row.jacobian.col(error::kYawMapOdom) = Vector3d::UnitZ().cross(R_map_odom * antenna_odom_m);
  row.jacobian.middleCols<2>(error::kGravity) = placed_point_by_gravity(state, antenna_odom_m);
  row.jacobian.middleCols<3>(error::kPositionMapOdom).setIdentity();
  return row;
}

RowHistory::RowHistory(const RowsConfig& config, bool odom_is_fixed)
    : config_(config), odom_is_fixed_(odom_is_fixed) {}

void RowHistory::push(ScanRecord record) {
  record.state_odom_free = record.before_rows;
  record.state = record.before_rows;
  record.covariance = record.covariance_before_rows;
  records_.push_back(std::move(record));
  const Nanoseconds oldest_ns = newest().stamp_ns - from_seconds(config_.history_s);
  while (records_.size() > 2 && records_.front().stamp_ns < oldest_ns) {
    records_.pop_front();
  }
}

RowVerdict RowHistory::check(const StateUpdate& update) const {
  if (!is_usable(update)) {
    return {RowOutcome::kRefused, "not_a_gaussian"};
  }
  if (records_.empty() || update.fix_stamp_ns > newest().stamp_ns) {
    return waiting_.size() < static_cast<std::size_t>(config_.max_waiting)
               ? RowVerdict{RowOutcome::kWaits, ""}
               : RowVerdict{RowOutcome::kRefused, "too_many_waiting"};
  }
  // A path may begin before its scan's predecessor ended; the oldest record's path is all we have.
  const ScanRecord& oldest = records_.front();
  if (oldest.path.empty() || update.fix_stamp_ns < oldest.path.begin_ns()) {
    return {RowOutcome::kRefused, "older_than_history"};
  }
  return {RowOutcome::kApplied, ""};
}

RowVerdict RowHistory::apply(const StateUpdate& update) {
  const RowVerdict verdict = check(update);
  if (verdict.outcome == RowOutcome::kWaits) {
    waiting_.push_back(update);
  }
  if (verdict.outcome != RowOutcome::kApplied) {
    return verdict;
  }
  const auto covering = std::find_if(records_.begin(), records_.end(), [&](const ScanRecord& r) {
    return r.stamp_ns >= update.fix_stamp_ns;
  });
  const auto same_fix = [&](const StateUpdate& row) {
    return row.fix_stamp_ns == update.fix_stamp_ns;
  };
  if (std::any_of(covering->rows.begin(), covering->rows.end(), same_fix)) {
    return {RowOutcome::kRefused, "fix_already_used"};
  }
  const auto later = std::upper_bound(
      covering->rows.begin(), covering->rows.end(), update, [](const auto& a, const auto& b) {
        return a.fix_stamp_ns < b.fix_stamp_ns;
      });
  covering->rows.insert(later, update);
  const auto anchor = static_cast<std::size_t>(covering - records_.begin());
  if (update.mode == UpdateMode::kOverwrite) {
    overwrite(anchor, update);
  } else {
    replay_from(anchor);
  }
  return verdict;
}

State RowHistory::apply_rows_of(ScanRecord& record) {
  State state = record.before_rows;
  record.covariance = record.covariance_before_rows;
  for (const StateUpdate& row : record.rows) {
    if (row.mode == UpdateMode::kRows && admits_any(row)) {
      condition_on(row,
                   predict_row(state, record.path, row.fix_stamp_ns, row.lever_arm_base_m),
                   state,
                   record.covariance);
    }
  }
  return state;
}

void RowHistory::replay_from(std::size_t first) {
  // The change of the state at the scan before, with odom free to move: what a row moved there is
  // pulled back by the scans after it as far as they could see it, and only the rest is carried
  // over.
  ErrorVector change = ErrorVector::Zero();
  ErrorMatrix covariance_change = ErrorMatrix::Zero();
  for (std::size_t j = first; j < records_.size(); ++j) {
    ScanRecord& record = records_[j];
    const State old = record.state_odom_free;
    const ErrorMatrix old_covariance = record.covariance;
    const ErrorMatrix& M = record.transition;
    record.before_rows = boxplus(record.before_rows, M * change);
    record.covariance_before_rows += M * covariance_change * M.transpose();
    make_symmetric(record.covariance_before_rows);
    record.state_odom_free = apply_rows_of(record);
    change = boxminus(record.state_odom_free, old);
    covariance_change = record.covariance - old_covariance;
    record.state = odom_is_fixed_
                       ? with_odom_moved(record.state_odom_free, record.state.T_odom_base)
                       : record.state_odom_free;
  }
}

void RowHistory::overwrite(std::size_t anchor, const StateUpdate& update) {
  const ScanRecord& at_fix = records_[anchor];
  const Vector3d predicted_map_m =
      predict_row(at_fix.state, at_fix.path, update.fix_stamp_ns, update.lever_arm_base_m)
          .position_map_m;
  Vector3d shift_map_m = Vector3d::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    if (is_admitted(update, axis)) {
      shift_map_m[axis] = update.position_map_m[axis] - predicted_map_m[axis];
    }
  }
  const Vector3d shift_odom_m = at_fix.state.placement().pose().q.conjugate() * shift_map_m;
  for (std::size_t j = anchor; j < records_.size(); ++j) {
    records_[j].before_rows.T_odom_base.p += shift_odom_m;
    records_[j].state_odom_free.T_odom_base.p += shift_odom_m;
    records_[j].state.T_odom_base.p += shift_odom_m;
  }
}

std::vector<StateUpdate> RowHistory::take_covered() {
  const auto uncovered =
      std::stable_partition(waiting_.begin(), waiting_.end(), [&](const StateUpdate& update) {
        return !records_.empty() && update.fix_stamp_ns <= newest().stamp_ns;
      });
  std::vector<StateUpdate> covered(waiting_.begin(), uncovered);
  waiting_.erase(waiting_.begin(), uncovered);
  std::stable_sort(covered.begin(), covered.end(), [](const auto& a, const auto& b) {
    return a.fix_stamp_ns < b.fix_stamp_ns;
  });
  return covered;
}

void RowHistory::align(const Alignment& alignment) {
  // The gate took odom as level. What it found holds where the robot is; the tilt that the gravity
  // states know turns the rest about that place, and so does their error:
  // e_t = e_t(gate) - D e_g with D the displacement of the place by the gravity errors.
  // It holds for the place that the filter states, whatever LIO slid on the way there: along what
  // the map does not hold e_p is counted from here. The slide's velocity is as unknown as before:
  // were it taken for confirmed with the place, it would go on.
  constexpr int kAt = error::kYawMapOdom;
  const Vector3d here_odom_m = newest().state.T_odom_base.p;
  Eigen::Matrix<double, 3, error::kSize> to_slide_here =  // from the error at a record
      Eigen::Matrix<double, 3, error::kSize>::Zero();
  to_slide_here.middleCols<3>(error::kPosition) =
      slid_share(newest().covariance.block<3, 3>(error::kPosition, error::kPosition));
  const auto set = [&](State& state) {
    state.T_map_odom = alignment.T_map_odom;
    state.T_map_odom.p +=
        alignment.T_map_odom.pose().q * here_odom_m - state.placement().pose().q * here_odom_m;
  };
  for (auto record = records_.rbegin(); record != records_.rend(); ++record) {
    record->rows.clear();  // of an alignment that was replaced
    set(record->before_rows);
    set(record->state_odom_free);
    set(record->state);
    ErrorMatrix to_aligned = ErrorMatrix::Identity();
    to_aligned.middleRows<3>(error::kPosition) -= to_slide_here;
    to_aligned.middleRows<4>(kAt).setZero();
    to_aligned.middleCols<4>(kAt).setZero();
    to_aligned.block<3, 2>(error::kPositionMapOdom, error::kGravity) =
        -placed_point_by_gravity(record->state, here_odom_m);
    for (ErrorMatrix* covariance : {&record->covariance_before_rows, &record->covariance}) {
      *covariance = (to_aligned * *covariance * to_aligned.transpose()).eval();
      covariance->block<4, 4>(kAt, kAt) += alignment.covariance;
      make_symmetric(*covariance);
    }
    to_slide_here = (to_slide_here * record->transition).eval();
  }
}

}  // namespace trigpoint::lio_mapper
