// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The GPS filters on recorded drives whose receivers are bad: a consumer receiver on a road, a deep
// street canyon, a parking lot where the height wanders. KITTI is in gps_odometry_test (RealDrive).
#include "recorded_drives.hpp"

#include "gps_drives.hpp"
#include "gps_table.hpp"
#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>

namespace trigpoint {
namespace {

EvidenceTable& table() {
  return EvidenceTable::instance();
}

[[maybe_unused]] const EvidenceTable& kTable = table();

constexpr Nanoseconds kNearest_ns = 30'000'000;
constexpr double kSettled_s = 20.0;
constexpr double kErrorLasts_s = 20.0;  // of a receiver between houses, by its reflections

struct Scores {
  Honesty honesty;
  Honesty fixes;  ///< of the receiver itself, for comparison
  double lowest_m{1e9};
  double highest_m{-1e9};
  GpsStatus status;
};

/// A recorded drive is few independent draws of the receiver's error: 95 % less two standard
/// deviations of a share that is found with so many.
double least_inside(const RecordedDrive& drive) {
  const double duration_s =
      to_seconds(drive.reference.back().stamp_ns - drive.reference.front().stamp_ns) - kSettled_s;
  const double draws = 3.0 * duration_s / kErrorLasts_s;  // axes
  return 0.95 - 2.0 * std::sqrt(0.95 * 0.05 / draws);
}

const ReferencePoint* reference_at(const RecordedDrive& drive, Nanoseconds stamp_ns) {
  const auto after = std::lower_bound(
      drive.reference.begin(),
      drive.reference.end(),
      stamp_ns - kNearest_ns,
      [](const ReferencePoint& point, Nanoseconds stamp) { return point.stamp_ns < stamp; });
  const bool found =
      after != drive.reference.end() && std::llabs(after->stamp_ns - stamp_ns) <= kNearest_ns;
  return found ? &*after : nullptr;
}

/// Datum: the first fix.
Datum datum_of(const RecordedDrive& drive) {
  for (const RecordedInput& input : drive.inputs) {
    if (const auto* fix = std::get_if<GnssFix>(&input.measurement)) {
      return {fix->latitude_deg, fix->longitude_deg, fix->altitude_m, 0};
    }
  }
  return {};
}

DriveSample sample_of(const Odometry& odometry, const Eigen::Vector3d& reference_map_m) {
  DriveSample sample;
  sample.error_m = odometry.T_frame_child.p - reference_map_m;
  const Eigen::Matrix3d P = odometry.pose_covariance.topLeftCorner<3, 3>();
  sample.sigma_m = P.diagonal().cwiseMax(0.0).cwiseSqrt();
  sample.nees = sample.error_m.dot(P.ldlt().solve(sample.error_m));
  return sample;
}

Scores drive(const RecordedDrive& recorded, const std::string& name) {
  const Datum datum = datum_of(recorded);
  const geodesy::LocalFrame frame(datum);
  gps_odometry::Config config;
  config.filter = name;
  gps_odometry::GpsOdometry filter(config, recorded.robot);
  filter.on_datum(datum);
  Scores scores;
  const Nanoseconds from_ns = recorded.inputs.front().available_ns + from_seconds(kSettled_s);
  for (const RecordedInput& input : recorded.inputs) {
    if (const auto* fix = std::get_if<GnssFix>(&input.measurement)) {
      filter.on_fix(*fix);
      const auto* reference = reference_at(recorded, fix->stamp_ns);
      if (reference != nullptr && fix->stamp_ns > from_ns) {
        const auto place = frame.to_map({fix->latitude_deg, fix->longitude_deg, fix->altitude_m});
        DriveSample sample;
        sample.error_m = *place - *frame.to_map(reference->place);
        sample.sigma_m = fix->covariance_enu_m2.diagonal().cwiseSqrt();
        sample.nees = sample.error_m.cwiseQuotient(sample.sigma_m).squaredNorm();
        scores.fixes.add(sample);
      }
      continue;
    }
    const auto output = filter.on_imu(std::get<ImuSample>(input.measurement));
    if (!output.odometry || output.odometry->stamp_ns < from_ns) {
      continue;
    }
    scores.lowest_m = std::min(scores.lowest_m, output.odometry->T_frame_child.p.z());
    scores.highest_m = std::max(scores.highest_m, output.odometry->T_frame_child.p.z());
    const auto* reference = reference_at(recorded, output.odometry->stamp_ns);
    if (reference != nullptr) {
      scores.honesty.add(sample_of(*output.odometry, *frame.to_map(reference->place)));
    }
  }
  scores.status = filter.status();
  return scores;
}

void note(const std::string& what, const std::string& name, const Honesty& honesty) {
  table().note(what + ", level rms", name, honesty.rms_level_m(), "m");
  table().note(what + ", height rms", name, honesty.rms_up_m(), "m");
  table().note(what + ", worst", name, honesty.worst_m(), "m");
  table().note(what + ", median sigma", name, honesty.median_sigma_m(), "m");
  table().note(what + ", inside 1.96 sigma", name, honesty.inside(), "");
  table().note(what + ", ANEES", name, honesty.anees(), "");
}

void expect_most_fixes_used(const std::string& name, const GpsStatus& status) {
  const auto received = static_cast<double>(status.fixes_received);
  const double share = static_cast<double>(status.fixes_accepted) / received;
  EXPECT_GT(share, 0.8) << name;
  table().note("  share of fixes accepted", name, share, "");
}

/// Errors that last are no filter's to remove, but nothing may be added to them, and what is
/// published must cover them as in town (ANEES at most 2, 95 % within 1.96 sigma). ekf15 does add:
/// it has no biases to learn, so a phone's accelerometers move it between fixes that it believes
/// little; that is printed, and what it publishes must cover it.
void expect_worth_it(const std::string& what,
                     const std::string& name,
                     const RecordedDrive& recorded,
                     const Scores& scores) {
  const double ratio = scores.honesty.rms_m() / scores.fixes.rms_m();
  if (name == "ekf15") {
    table().note(what + ", rms / receiver's", name, ratio, "");
  } else {
    table().at_most(what + ", rms / receiver's", name, ratio, 1.5, "");
  }
  table().at_most(what + ", ANEES", name, scores.honesty.anees(), 2.0, "");
  table().at_least(
      what + ", inside 1.96 sigma", name, scores.honesty.inside(), least_inside(recorded), "");
}

TEST(RecordedDrive, on_a_road_with_a_consumer_receiver) {
  const auto recorded = read_comma2k19();
  if (!recorded) {
    GTEST_SKIP() << "The recording comma2k19_example1 is not at hand.";
  }
  for (const std::string name : kFilters) {
    const Scores scores = drive(*recorded, name);
    note("comma2k19, u-blox alone", name, scores.fixes);
    note("comma2k19", name, scores.honesty);
    // A limit, not a bound: no filter here estimates how the IMU is mounted.
    RecordedDrive untold = *recorded;
    untold.robot.imu_roll_pitch_yaw_base_rad.setZero();
    note("comma2k19, mounting 3.8 deg wrong", name, drive(untold, name).honesty);
    if (name != "ekf15_strict") {
      expect_worth_it("comma2k19", name, *recorded, scores);
    }
  }
}

TEST(RecordedDrive, in_a_street_canyon_with_errors_of_27_m) {
  const auto recorded = read_smartloc();
  if (!recorded) {
    GTEST_SKIP() << "The recording smartloc_potsdamer_platz is not at hand.";
  }
  for (const std::string name : kFilters) {
    const Scores scores = drive(*recorded, name);
    note("smartLoc, least squares alone", name, scores.fixes);
    note("smartLoc", name, scores.honesty);
    if (name != "ekf15_strict") {
      expect_worth_it("smartLoc", name, *recorded, scores);
    }
  }
}

TEST(RecordedDrive, on_a_flat_parking_lot_where_the_height_of_the_fixes_wanders) {
  const auto recorded = read_parking_lot();
  if (!recorded) {
    GTEST_SKIP() << "The recording robot_localization/test1.bag is not at hand.";
  }
  for (const std::string name : kFilters) {
    const Scores scores = drive(*recorded, name);
    table().note("test1.bag, span of heights", name, scores.highest_m - scores.lowest_m, "m");
    for (const NamedCount& count : scores.status.rejections) {
      table().note("test1.bag, " + count.name, name, static_cast<double>(count.count), "");
    }
    expect_most_fixes_used(name, scores.status);
  }
}

}  // namespace
}  // namespace trigpoint
