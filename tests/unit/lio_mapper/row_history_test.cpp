// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "row_history.hpp"

#include "trigpoint/base/so3.hpp"

#include "random_state.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

using testing_support::random_covariance;
using testing_support::random_state;

constexpr Nanoseconds kScan_ns = 100'000'000;
constexpr int kScans = 8;

/// Equal but for rounding of sums in another order.
constexpr double kSameStamp = 1e-9;
/// Rows move attitude and yaw, whose second-order terms differ between linearisation points.
constexpr double kFirstOrder = 1e-6;

StateUpdate row(Nanoseconds stamp_ns, const Eigen::Vector3d& position_map_m, double sigma_m) {
  StateUpdate update;
  update.fix_stamp_ns = stamp_ns;
  update.decision.fill(AxisDecision::kFused);
  update.position_map_m = position_map_m;
  update.covariance_map_m2 = sigma_m * sigma_m * Eigen::Matrix3d::Identity();
  update.covariance_map_m2(0, 1) = update.covariance_map_m2(1, 0) = 0.4 * sigma_m * sigma_m;
  return update;
}

constexpr std::array<int, 9> kAngles{error::kRotation,
                                     error::kRotation + 1,
                                     error::kRotation + 2,
                                     error::kExtrinsicRotation,
                                     error::kExtrinsicRotation + 1,
                                     error::kExtrinsicRotation + 2,
                                     error::kGravity,
                                     error::kGravity + 1,
                                     error::kYawMapOdom};

/// A system whose scans map errors by known transitions with added noise; small errors in rotation
/// and yaw, so that it is linear to kFirstOrder.
struct Chain {
  std::vector<ErrorMatrix> transitions;
  std::vector<ErrorMatrix> noises;
  State start;
  ErrorMatrix start_covariance;

  Chain() {
    start.T_odom_base.p = {5.0, 2.0, 1.0};
    start.v_odom_mps = {1.0, 0.2, 0.0};
    start.T_map_odom = {0.6, {100.0, 50.0, 3.0}};
    start_covariance = random_covariance(1, 1.0);
    shrink_angles(start_covariance);
    for (unsigned i = 0; i < kScans; ++i) {
      const ErrorMatrix mix = random_covariance(10 + i, 0.3);
      ErrorMatrix M = 0.9 * ErrorMatrix::Identity() + 0.05 * mix / mix.norm();
      // Angles stay angles: what moves metres must not move radians as much.
      for (const int angle : kAngles) {
        if (angle == error::kYawMapOdom) {
          continue;
        }
        M.row(angle).setZero();
        M(angle, angle) = 0.95;
      }
      M.bottomRightCorner<4, 4>().setIdentity();
      transitions.push_back(M);
      ErrorMatrix Q = 0.01 * random_covariance(30 + i, 0.3);
      shrink_angles(Q);
      noises.push_back(Q);
    }
  }

  static void shrink_angles(ErrorMatrix& P) {
    for (const int i : kAngles) {
      P.row(i) *= 1e-5;
      P.col(i) *= 1e-5;
    }
  }

  /// The record of scan `i` after `previous`.
  ScanRecord scan(int i, const State& previous, const ErrorMatrix& covariance) const {
    const auto index = static_cast<std::size_t>(i);
    ScanRecord record;
    record.stamp_ns = (i + 1) * kScan_ns;
    record.before_rows = previous;
    record.covariance_before_rows =
        transitions[index] * covariance * transitions[index].transpose() + noises[index];
    record.transition = transitions[index];
    PathNode node;
    node.T_odom_base = previous.T_odom_base;
    for (int k = 0; k <= 10; ++k) {
      node.stamp_ns = i * kScan_ns + k * kScan_ns / 10;
      record.path.push_back(node);
    }
    return record;
  }
};

/// The nominal motion of the chain is to stay; a scan's state moves with its predecessor's change.
State carried_on(const Chain& chain, int i, const State& previous, const State& previous_nominal) {
  return boxplus(
      chain.start,
      chain.transitions[static_cast<std::size_t>(i)] * boxminus(previous, previous_nominal));
}

struct Result {
  State state;
  ErrorMatrix covariance;
};

/// Textbook: each row is applied when its scan is the newest one.
Result in_time(const Chain& chain, std::vector<StateUpdate> rows) {
  RowHistory history(RowsConfig{}, false);
  State previous = chain.start;
  ErrorMatrix covariance = chain.start_covariance;
  for (int i = 0; i < kScans; ++i) {
    ScanRecord record = chain.scan(i, chain.start, covariance);
    record.before_rows = carried_on(chain, i, previous, chain.start);
    history.push(record);
    for (const StateUpdate& update : rows) {
      if (update.fix_stamp_ns > i * kScan_ns && update.fix_stamp_ns <= (i + 1) * kScan_ns) {
        EXPECT_EQ(history.apply(update).outcome, RowOutcome::kApplied);
      }
    }
    previous = history.newest().state;
    covariance = history.newest().covariance;
  }
  return {previous, covariance};
}

/// All scans first, then the rows in the order given.
Result late(const Chain& chain, const std::vector<StateUpdate>& rows) {
  RowHistory history(RowsConfig{}, false);
  ErrorMatrix covariance = chain.start_covariance;
  for (int i = 0; i < kScans; ++i) {
    history.push(chain.scan(i, chain.start, covariance));
    covariance = history.newest().covariance;
  }
  for (const StateUpdate& update : rows) {
    EXPECT_EQ(history.apply(update).outcome, RowOutcome::kApplied);
  }
  return {history.newest().state, history.newest().covariance};
}

Eigen::Vector3d truth_map_m(const Chain& chain) {
  return chain.start.placement().pose() * chain.start.T_odom_base.p;
}

std::vector<StateUpdate> three_rows(const Chain& chain) {
  const Eigen::Vector3d p = truth_map_m(chain);
  return {row(2 * kScan_ns, p + Eigen::Vector3d(0.3, -0.2, 0.1), 0.2),
          row(4 * kScan_ns, p + Eigen::Vector3d(-0.1, 0.4, 0.2), 0.1),
          row(6 * kScan_ns, p + Eigen::Vector3d(0.2, 0.1, -0.3), 0.3)};
}

TEST(RowHistory, a_late_row_equals_the_same_row_in_time) {
  const Chain chain;
  const std::vector<StateUpdate> one{three_rows(chain)[1]};
  const Result a = in_time(chain, one);
  const Result b = late(chain, one);
  EXPECT_GT(boxminus(a.state, chain.start).norm(), 0.05);  // it did something
  EXPECT_LT(boxminus(a.state, b.state).norm(), kFirstOrder);
  EXPECT_LT((a.covariance - b.covariance).norm(), kFirstOrder);
}

TEST(RowHistory, rows_in_any_order_equal_rows_in_time) {
  const Chain chain;
  std::vector<StateUpdate> rows = three_rows(chain);
  const Result expected = in_time(chain, rows);
  const auto by_stamp = [](const auto& a, const auto& b) {
    return a.fix_stamp_ns < b.fix_stamp_ns;
  };
  do {
    const Result shuffled = late(chain, rows);
    EXPECT_LT(boxminus(shuffled.state, expected.state).norm(), kFirstOrder);
    EXPECT_LT((shuffled.covariance - expected.covariance).norm(), kFirstOrder);
  } while (std::next_permutation(rows.begin(), rows.end(), by_stamp));
}

TEST(RowHistory, shares_the_innovation_as_the_joint_covariance_says) {
  const Chain chain;
  RowHistory history(RowsConfig{}, false);
  history.push(chain.scan(0, chain.start, chain.start_covariance));
  const ScanRecord before = history.newest();
  const StateUpdate update = row(kScan_ns, truth_map_m(chain) + Eigen::Vector3d(0.5, 0, 0), 0.1);
  const auto H = predict_row(before.state, before.path, kScan_ns, {0, 0, 0}).jacobian;
  const Eigen::Matrix3d S = H * before.covariance * H.transpose() + update.covariance_map_m2;
  const ErrorVector expected =
      before.covariance * H.transpose() * S.inverse() * Eigen::Vector3d(0.5, 0.0, 0.0);
  history.apply(update);
  EXPECT_LT((boxminus(history.newest().state, before.state) - expected).norm(), kSameStamp);
  const ErrorMatrix textbook =
      before.covariance - before.covariance * H.transpose() * S.inverse() * H * before.covariance;
  EXPECT_LT((history.newest().covariance - textbook).norm(), kSameStamp);
}

TEST(RowHistory, axes_that_are_not_admitted_have_no_effect) {
  const Chain chain;
  StateUpdate update = row(kScan_ns, truth_map_m(chain), 0.1);
  update.decision = {AxisDecision::kFused, AxisDecision::kLio, AxisDecision::kFused};
  StateUpdate wild = update;
  wild.position_map_m.y() += 1000.0;
  wild.covariance_map_m2(1, 1) = 1e-9;
  wild.covariance_map_m2(0, 1) = wild.covariance_map_m2(1, 0) = 7.0;
  const Result a = late(chain, {update});
  const Result b = late(chain, {wild});
  EXPECT_EQ(boxminus(a.state, b.state).norm(), 0.0);
  EXPECT_EQ((a.covariance - b.covariance).norm(), 0.0);
}

TEST(RowPrediction, jacobian_equals_the_numerical_one_also_between_scans) {
  const State state = random_state(4);
  Path path;
  PathNode node;
  node.T_odom_base = state.T_odom_base;
  node.v_odom_mps = {3.0, -1.0, 0.5};
  node.acceleration_odom_mps2 = {0.5, 1.0, -0.3};
  node.angular_radps = {0.2, -0.1, 0.8};
  path.push_back(node);
  node.T_odom_base = path.at(100'000'000);
  node.v_odom_mps += 0.1 * node.acceleration_odom_mps2;
  node.stamp_ns = 100'000'000;
  path.push_back(node);
  const Eigen::Vector3d lever{0.3, -0.5, 1.5};
  constexpr Nanoseconds kFix_ns = 40'000'000;
  const RowPrediction nominal = predict_row(state, path, kFix_ns, lever);
  constexpr double kDelta = 1e-6;
  for (int i = 0; i < error::kSize; ++i) {
    ErrorVector e = ErrorVector::Zero();
    e[i] = kDelta;
    const Eigen::Vector3d column =
        (predict_row(boxplus(state, e), path, kFix_ns, lever).position_map_m -
         predict_row(boxplus(state, -e), path, kFix_ns, lever).position_map_m) /
        (2.0 * kDelta);
    EXPECT_LT((nominal.jacobian.col(i) - column).norm(), 1e-6) << "column " << i;
  }
}

TEST(RowPrediction, is_where_the_antenna_was_at_the_fix_when_state_and_path_agree) {
  Path path;
  PathNode node;
  node.v_odom_mps = {10.0, 0.0, 0.0};
  node.angular_radps = {0.0, 0.0, 1.0};
  path.push_back(node);
  node.T_odom_base = path.at(100'000'000);
  node.stamp_ns = 100'000'000;
  path.push_back(node);
  State state;
  state.T_odom_base = node.T_odom_base;
  state.v_odom_mps = node.v_odom_mps;
  state.T_map_odom = {1.0, {7.0, 8.0, 9.0}};
  const Eigen::Vector3d lever{0.0, 1.0, 2.0};
  const Eigen::Vector3d expected = state.placement().pose() * (path.at(30'000'000) * lever);
  EXPECT_LT((predict_row(state, path, 30'000'000, lever).position_map_m - expected).norm(), 1e-12);
}

class FixedOdom : public testing::Test {
 protected:
  void SetUp() override {
    ErrorMatrix covariance = chain.start_covariance;
    for (int i = 0; i < kScans; ++i) {
      history.push(chain.scan(i, chain.start, covariance));
      covariance = history.newest().covariance;
    }
  }

  Chain chain;
  RowHistory history{RowsConfig{}};
};

TEST_F(FixedOdom, a_row_moves_map_and_never_position_or_heading_in_odom) {
  const Pose before = history.newest().state.T_odom_base;
  const Result free = late(chain, three_rows(chain));
  for (const StateUpdate& update : three_rows(chain)) {
    history.apply(update);
  }
  for (const ScanRecord& record : history.records()) {
    EXPECT_LT((record.state.T_odom_base.p - before.p).norm(), 1e-12);
    EXPECT_NEAR(yaw_of(record.state.T_odom_base.q), yaw_of(before.q), 1e-12);
  }
  EXPECT_GT((free.state.T_odom_base.p - before.p).norm(), 0.01);  // there was something to carry
}

TEST_F(FixedOdom, carrying_over_keeps_the_posterior_in_map) {
  const StateUpdate update = three_rows(chain)[2];
  StateUpdate newest = update;
  newest.fix_stamp_ns = kScans * kScan_ns;
  const Result free = late(chain, {newest});
  history.apply(newest);
  const State& kept = history.newest().state;
  const Pose a = free.state.placement().pose() * free.state.T_odom_base;
  const Pose b = kept.placement().pose() * kept.T_odom_base;
  EXPECT_LT((a.p - b.p).norm(), 1e-9);
  EXPECT_NEAR(wrap_angle(yaw_of(a.q) - yaw_of(b.q)), 0.0, 1e-9);
}

TEST_F(FixedOdom, overwriting_hits_the_value_at_the_fix_and_leaves_covariance_and_alignment) {
  StateUpdate update = row(5 * kScan_ns, truth_map_m(chain) + Eigen::Vector3d(2, -1, 4), 0.1);
  update.mode = UpdateMode::kOverwrite;
  update.decision = {AxisDecision::kFused, AxisDecision::kFused, AxisDecision::kLio};
  const ScanRecord before = history.newest();
  EXPECT_EQ(history.apply(update).outcome, RowOutcome::kApplied);
  const ScanRecord& at_fix = history.records()[4];
  const Eigen::Vector3d hit = at_fix.state.placement().pose() * at_fix.state.T_odom_base.p;
  EXPECT_LT((hit.head<2>() - update.position_map_m.head<2>()).norm(), 1e-9);
  EXPECT_NEAR(hit.z(), truth_map_m(chain).z(), 1e-9);
  EXPECT_EQ((history.newest().covariance - before.covariance).norm(), 0.0);
  EXPECT_EQ((history.newest().state.T_map_odom.p - before.state.T_map_odom.p).norm(), 0.0);
  EXPECT_GT((history.newest().state.T_odom_base.p - before.state.T_odom_base.p).norm(), 2.0);
}

TEST_F(FixedOdom, the_first_alignment_holds_where_the_robot_is_however_odom_is_tilted) {
  chain.start.gravity_odom_mps2 = so3_exp({0.02, -0.01, 0.0}) * chain.start.gravity_odom_mps2;
  ErrorMatrix covariance = chain.start_covariance;
  covariance.block<2, 2>(error::kGravity, error::kGravity).diagonal().array() += 1e-4;
  ScanRecord tilted = chain.scan(kScans - 1, chain.start, covariance);
  tilted.stamp_ns += kScan_ns;
  history.push(tilted);
  const Alignment alignment{0, {0.3, {20.0, 10.0, 5.0}}, 0.01 * Eigen::Matrix4d::Identity()};
  history.align(alignment);

  const ScanRecord& newest = history.newest();
  const Eigen::Vector3d here_odom_m = newest.state.T_odom_base.p;
  const Eigen::Vector3d here_map_m = newest.state.placement().pose() * here_odom_m;
  EXPECT_LT((here_map_m - alignment.T_map_odom.pose() * here_odom_m).norm(), 1e-9);

  // The place itself is as uncertain as the gate said: the tilt's error turns about it.
  const Nanoseconds end_ns = newest.path.back().stamp_ns;
  auto H = predict_row(newest.state, newest.path, end_ns, Eigen::Vector3d::Zero()).jacobian;
  H.leftCols<error::kGravity>().setZero();  // of the alignment alone
  const Eigen::Matrix<double, 3, 4> by_alignment = H.rightCols<4>();
  const Eigen::Matrix3d expected = by_alignment * alignment.covariance * by_alignment.transpose();
  EXPECT_LT((H * newest.covariance * H.transpose() - expected).norm(), 1e-9);
}

/// A filter that nothing holds goes straight on at a velocity that is wrong by 5 m/s, as it says it
/// may be, for 40 scans; rows every second scan after the alignment.
struct Slide {
  ErrorVector error;  ///< at the end
  ErrorMatrix covariance;
  double place_error_m;
};

Slide aligned_after_a_slide(int scans_after) {
  const double scan_s = to_seconds(kScan_ns);
  constexpr double kWrong_mps = 5.0;
  constexpr int kBefore = 40;
  ErrorMatrix M = ErrorMatrix::Identity();
  M.block<3, 3>(error::kPosition, error::kVelocity) = scan_s * Eigen::Matrix3d::Identity();
  ErrorMatrix Q = ErrorMatrix::Zero();
  Q.diagonal().segment<3>(error::kVelocity).setConstant(1e-4);
  RowHistory history(RowsConfig{});
  State state;
  state.v_odom_mps = {kWrong_mps, 0.0, 0.0};  // in truth it stands
  state.gravity_odom_mps2 = {0.0, 0.0, -9.80665};
  ErrorMatrix covariance = 1e-10 * ErrorMatrix::Identity();
  covariance.diagonal().segment<3>(error::kVelocity).setConstant(25.0);
  for (int i = 0; i < kBefore + scans_after; ++i) {
    ScanRecord record;
    record.stamp_ns = (i + 1) * kScan_ns;
    PathNode node;
    node.stamp_ns = i * kScan_ns;
    node.T_odom_base = state.T_odom_base;
    node.v_odom_mps = state.v_odom_mps;
    record.path.push_back(node);
    state.T_odom_base.p += scan_s * state.v_odom_mps;
    node.stamp_ns = record.stamp_ns;
    node.T_odom_base = state.T_odom_base;
    record.path.push_back(node);
    record.before_rows = state;
    record.covariance_before_rows = M * covariance * M.transpose() + Q;
    record.transition = M;
    history.push(record);
    if (i + 1 == kBefore) {
      const Alignment alignment{0, {0.0, -state.T_odom_base.p}, 1e-4 * Eigen::Matrix4d::Identity()};
      history.align(alignment);
    } else if (i >= kBefore && i % 2 == 0) {
      EXPECT_EQ(history.apply(row(record.stamp_ns, {0.0, 0.0, 0.0}, 0.03)).outcome,
                RowOutcome::kApplied);
    }
    state = history.newest().state;
    covariance = history.newest().covariance;
  }
  State truth = state;
  truth.v_odom_mps.setZero();
  return {
      boxminus(truth, state), covariance, (state.placement().pose() * state.T_odom_base.p).norm()};
}

TEST(RowHistory, what_slid_before_the_alignment_does_not_slide_on) {
  const Slide slide = aligned_after_a_slide(20);
  EXPECT_LT(slide.place_error_m, 0.1);
  const double error_mps = slide.error.segment<3>(error::kVelocity).norm();
  const double sigma_mps = std::sqrt(slide.covariance(error::kVelocity, error::kVelocity));
  EXPECT_LT(error_mps, 0.2);
  EXPECT_LT(error_mps, 3.0 * sigma_mps);
  EXPECT_LT(sigma_mps, 0.5);
}

/// Along x, of a row of its own sigma 0.5 m inflated 51 times, for a prior of this sigma.
double sigma_after_inflated_row(double prior_sigma_m) {
  const Chain chain;
  ErrorMatrix covariance = 1e-10 * ErrorMatrix::Identity();
  covariance.diagonal().head<3>().setConstant(prior_sigma_m * prior_sigma_m);
  ScanRecord record = chain.scan(0, chain.start, covariance);
  record.covariance_before_rows = covariance;
  RowHistory history(RowsConfig{}, false);
  history.push(record);
  StateUpdate update = row(kScan_ns, truth_map_m(chain), 0.5);
  update.covariance_map_m2 = 51.0 * 0.25 * Eigen::Matrix3d::Identity();
  update.inflation = 51.0;
  EXPECT_EQ(history.apply(update).outcome, RowOutcome::kApplied);
  return std::sqrt(history.newest().covariance(0, 0));
}

TEST(RowHistory, a_fix_counts_in_full_where_nothing_better_is_known_and_only_there) {
  EXPECT_NEAR(sigma_after_inflated_row(100.0), 2.0 * 0.5, 1e-3);
  EXPECT_NEAR(sigma_after_inflated_row(2.0), 2.0 * 0.5, 1e-3);
  EXPECT_NEAR(sigma_after_inflated_row(0.5), std::sqrt(1.0 / (4.0 + 4.0 / 51.0)), 1e-6);
}

TEST_F(FixedOdom, refuses_what_cannot_be_used_and_says_why) {
  const Eigen::Vector3d p = truth_map_m(chain);
  EXPECT_EQ(history.apply(row(-kScan_ns, p, 0.1)).reason, "older_than_history");
  StateUpdate nan = row(kScan_ns, p, 0.1);
  nan.position_map_m.x() = kNaN;
  EXPECT_EQ(history.apply(nan).reason, "not_a_gaussian");
  StateUpdate zero = row(kScan_ns, p, 0.0);
  EXPECT_EQ(history.apply(zero).reason, "not_a_gaussian");
  StateUpdate deflated = row(kScan_ns, p, 0.1);
  deflated.inflation = 0.5;
  EXPECT_EQ(history.apply(deflated).reason, "not_a_gaussian");
  EXPECT_EQ(history.apply(row(3 * kScan_ns, p, 0.1)).outcome, RowOutcome::kApplied);
  EXPECT_EQ(history.apply(row(3 * kScan_ns, p, 0.1)).reason, "fix_already_used");
}

TEST_F(FixedOdom, rows_of_the_future_wait_in_bounded_number_for_their_scan) {
  const Eigen::Vector3d p = truth_map_m(chain);
  const Nanoseconds now_ns = history.newest().stamp_ns;
  for (int i = 1; i <= RowsConfig{}.max_waiting; ++i) {
    EXPECT_EQ(history.apply(row(now_ns + i, p, 0.1)).outcome, RowOutcome::kWaits);
  }
  EXPECT_EQ(history.apply(row(now_ns + 1000, p, 0.1)).reason, "too_many_waiting");
  EXPECT_TRUE(history.take_covered().empty());
  ScanRecord next = chain.scan(0, chain.start, chain.start_covariance);
  next.stamp_ns = now_ns + 10;
  history.push(next);
  EXPECT_EQ(history.take_covered().size(), 10U);
  EXPECT_EQ(history.waiting(), static_cast<std::size_t>(RowsConfig{}.max_waiting) - 10);
}

}  // namespace

}  // namespace trigpoint::lio_mapper
