// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The figures of the fusion table on a drive whose errors are known.
#include "fusion_scoreboard.hpp"
#include <gtest/gtest.h>

#include <cmath>
#include <functional>

namespace trigpoint::fusion_table {
namespace {

constexpr double kRounding = 1e-6;
constexpr double kPose = 0.0015;  // the poses at the borders of a window do not count
constexpr Nanoseconds kStart_ns = 1'700'000'000 * kNanosecondsPerSecond;
constexpr double kDuration_s = 100.0;

/// Along x at 2 m/s.
class Straight final : public simulator::Truth {
 public:
  simulator::TrueState at(Nanoseconds stamp_ns) const override {
    simulator::TrueState state;
    state.T_map_base.p.x() = 2.0 * to_seconds(stamp_ns - kStart_ns);
    return state;
  }

  Nanoseconds first_ns() const override { return kStart_ns; }

  Nanoseconds last_ns() const override { return kStart_ns + from_seconds(kDuration_s); }
};

using ErrorAt = std::function<Eigen::Vector3d(double t_s)>;

Nanoseconds at_s(double t_s) {
  return kStart_ns + from_seconds(t_s);
}

Run run_with(const ErrorAt& error) {
  Run run;
  const Straight truth;
  for (double t_s = 0.0; t_s < kDuration_s; t_s += 0.05) {
    const Pose reference = truth.at(at_s(t_s)).T_map_base;
    Pose estimate = reference;
    estimate.p += error(t_s);
    run.pairs.push_back({at_s(t_s), estimate, reference});
    run.fused.push_back({at_s(t_s), estimate});
    run.odom.push_back({at_s(t_s), reference});
  }
  return run;
}

/// Fixes at 5 Hz; `fault` says how far off they are, nullopt that they are lost.
Drive drive_with(const std::function<std::optional<Eigen::Vector3d>(double)>& fault) {
  Drive drive;
  drive.truth = std::make_shared<Straight>();
  for (int i = 0; i < 500; ++i) {
    const double t_s = 0.2 * i;
    const auto error_m = fault(t_s);
    simulator::FixTruth fix;
    fix.stamp_ns = at_s(t_s);
    fix.lost = !error_m;
    fix.gnss_class = "fixed";
    fix.fault_error_enu_m = error_m.value_or(Eigen::Vector3d::Zero());
    drive.fixes.push_back(fix);
    if (error_m) {
      drive.received.push_back({fix.stamp_ns, *error_m});
    }
  }
  return drive;
}

Figures score(const std::string& scenario, const Drive& drive, const std::string& mode = "hard") {
  for (const Row& row : rows()) {
    if (row.scenario == scenario) {
      return row.score(drive, mode);
    }
  }
  ADD_FAILURE() << scenario;
  return {};
}

const Figure& named(const Figures& figures, const std::string& part) {
  for (const Figure& figure : figures) {
    if (figure.name.find(part) != std::string::npos) {
      return figure;
    }
  }
  ADD_FAILURE() << part;
  return figures.front();
}

Eigen::Vector3d along_y(double y_m) {
  return {0.0, y_m, 0.0};
}

TEST(OutageRow, judges_the_error_at_the_end_by_the_distance_and_the_return_by_its_time) {
  Drive drive = drive_with([](double t_s) -> std::optional<Eigen::Vector3d> {
    return t_s > 20.0 && t_s < 60.0 ? std::nullopt : std::optional(Eigen::Vector3d(0.0, 0.0, 0.0));
  });
  // 0.01 m a second in the outage, and back at 0.1 m/s: 80 m are driven in it.
  drive.runs["hard"] = run_with([](double t_s) {
    return along_y(t_s < 20.0   ? 0.0
                   : t_s < 60.0 ? 0.01 * (t_s - 20.0)
                                : std::max(0.0, 0.4 - 0.1 * (t_s - 60.0)));
  });
  const Figures figures = score("indoor_60", drive);
  const Figure& end = named(figures, "outage's end");
  EXPECT_NEAR(end.value, 0.4, kPose);
  EXPECT_NEAR(*end.bound.highest, 0.005 * 80.0 + 0.05, kPose);
  EXPECT_TRUE(end.is_met());
  EXPECT_NEAR(named(figures, "% of").value, 0.5, 0.002);
  EXPECT_NEAR(named(figures, "back within").value, 3.0, 0.06);
  EXPECT_NEAR(named(figures, "largest step").value, 0.01, kRounding);
  EXPECT_TRUE(named(figures, "largest step").is_met());
}

TEST(WrongFixRow, tells_the_worst_error_and_how_many_were_used) {
  Drive drive = drive_with([](double t_s) -> std::optional<Eigen::Vector3d> {
    return t_s > 29.9 && t_s < 49.9 ? along_y(4.0) : along_y(0.0);
  });
  drive.runs["hard"] =
      run_with([](double t_s) { return along_y(t_s > 35.0 && t_s < 36.0 ? 0.25 : 0.01); });
  auto& judgements = drive.runs["hard"].judgements;
  judgements[at_s(30.0)].moves = {false, true, false};
  judgements[at_s(30.2)].moves = {true, false, true};  // along the axes on which it is right
  judgements[at_s(30.4)] = {{}, false, "too far from where LIO is"};
  const auto closing = [&] { return named(score("campus+wrong_fix", drive), "until the gate"); };
  EXPECT_NEAR(named(score("campus+wrong_fix", drive), "worst error").value, 0.25, kRounding);
  EXPECT_EQ(closing().value, 1.0);
  EXPECT_TRUE(closing().is_met());
  EXPECT_EQ(closing().words, "too far from where LIO is");
  judgements[at_s(40.0)].moves = judgements[at_s(40.2)].moves = {false, true, false};  // reopened
  EXPECT_EQ(closing().value, 3.0);
  EXPECT_FALSE(closing().is_met());
  EXPECT_NEAR(named(score("campus+wrong_fix", drive), "last one used").value, 10.2, kRounding);
}

TEST(HeightRow, allows_the_height_its_share_of_the_way_since_the_fault_began) {
  Drive drive = drive_with([](double t_s) -> std::optional<Eigen::Vector3d> {
    return Eigen::Vector3d(0.0, 0.0, t_s > 59.9 ? 30.0 : 0.0);
  });
  // 0.5 % of the way: 0.2 % too much over 80 m is 0.16 m.
  drive.runs["hard"] = run_with([](double t_s) {
    return Eigen::Vector3d(0.03, 0.04, t_s > 60.0 ? 0.01 * (t_s - 60.0) : 0.0);
  });
  const Figures figures = score("campus+height_step", drive);
  EXPECT_NEAR(named(figures, "xy RMSE").value, 0.05, kRounding);
  EXPECT_NEAR(named(figures, "less 0.3 %").value, 0.4 - 0.24, 0.002);
  EXPECT_FALSE(named(figures, "less 0.3 %").is_met());
}

TEST(SortedRow, counts_other_verdicts_and_forgives_the_first_2_s) {
  Drive drive = drive_with([](double) -> std::optional<Eigen::Vector3d> { return along_y(0.0); });
  drive.runs["hard"] = run_with([](double t_s) { return along_y(t_s < 1.5 ? 1.0 : 0.015); });
  drive.sorted_runs["hard"] = run_with([](double) { return along_y(0.0); });
  drive.sorted_runs["hard"].judgements[at_s(10.0)].moves = {true, true, true};
  drive.sorted_runs["hard"].judgements[at_s(12.0)].moves = {true, true, true};
  drive.runs["hard"].judgements[at_s(12.0)].moves = {true, true, true};
  const Figures figures = score("campus+late_fixes", drive);
  EXPECT_EQ(named(figures, "judged otherwise").value, 1.0);
  EXPECT_FALSE(named(figures, "judged otherwise").is_met());
  EXPECT_NEAR(named(figures, "distance from the sorted").value, 0.015, kRounding);
}

TEST(EveryRow, measures_nothing_and_meets_nothing_when_a_mode_is_silent) {
  const Drive empty = [] {
    Drive drive = drive_with([](double t_s) -> std::optional<Eigen::Vector3d> {
      return t_s > 20.0 && t_s < 60.0 ? std::nullopt
                                      : std::optional(along_y(t_s > 70.0 ? 3.0 : 0.0));
    });
    drive.runs["hard"];
    drive.sorted_runs["hard"];
    return drive;
  }();
  for (const Row& row : rows()) {
    if (row.score_map) {
      continue;  // makes its own drives
    }
    for (const Figure& figure : row.score(empty, "hard")) {
      const bool of_error = figure.name.find("judged otherwise") == std::string::npos;
      EXPECT_TRUE(!figure.is_judged() || !of_error || !figure.is_met()) << row.what << figure.name;
    }
  }
}

Figure bounded(double value, Bound bound, bool by_mean = false) {
  Figure figure;
  figure.name = "error, m";
  figure.value = value;
  figure.bound = bound;
  figure.judged_by_mean = by_mean;
  return figure;
}

TEST(Scoreboard, prints_mean_worst_and_how_often_the_bound_was_met) {
  const Row& row = rows().front();
  Scoreboard scores({"hard", "lio"}, "");
  scores.add(row, "hard", 1, {bounded(0.1, {std::nullopt, 0.2})});
  scores.add(row, "hard", 2, {bounded(0.3, {std::nullopt, 0.2})});
  scores.add(row, "lio", 1, {bounded(0.1, {std::nullopt, 0.2})});
  scores.add(row, "lio", 2, {bounded(0.2, {std::nullopt, 0.2})});
  const std::string line = scores.print(row);
  EXPECT_NE(line.find("| 0.200 | 0.200 / 0.300 NOT (1 of 2) | 0.150 / 0.200 met |"),
            std::string::npos)
      << line;
  EXPECT_NE(scores.print_summary().find("hard: 0 of 1"), std::string::npos);
  EXPECT_NE(scores.print_summary().find("lio: 1 of 1"), std::string::npos);
}

TEST(Scoreboard, holds_what_could_not_be_measured_for_not_met) {
  Scoreboard scores({"hard"}, "");
  scores.add(rows().front(), "hard", 1, {bounded(kNaN, {std::nullopt, 0.2})});
  EXPECT_NE(scores.print(rows().front()).find("- / - NOT (0 of 1)"), std::string::npos);
}

TEST(Scoreboard, judges_consistency_by_the_mean_over_the_runs) {
  Scoreboard scores({"hard"}, "");
  const Bound bound{0.3, 2.0};
  scores.add(rows().front(), "hard", 1, {bounded(0.2, bound, true)});
  scores.add(rows().front(), "hard", 2, {bounded(3.0, bound, true)});
  EXPECT_NE(scores.print(rows().front()).find("1.600 / 3.000 met"), std::string::npos);
  scores.add(rows().front(), "hard", 3, {bounded(9.0, bound, true)});
  EXPECT_NE(scores.print(rows().front()).find("NOT |"), std::string::npos);
}

}  // namespace
}  // namespace trigpoint::fusion_table
