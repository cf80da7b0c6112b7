// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The reader's point times against the drive itself: sweeps that are undistorted and laid together
// along the INS's poses show thin facades only when every point has its right time.
#include "trigpoint/base/so3.hpp"

#include "kitti_drive.hpp"
#include "text_table.hpp"
#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <functional>
#include <memory>
#include <unordered_map>

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;

constexpr double kVoxel_m = 0.8;
constexpr double kNearest_m = 3.0;
constexpr double kFarthest_m = 40.0;
constexpr std::size_t kEveryPoint = 2;  // to be quick

/// The INS's poses of imu100.csv, interpolated.
class InsTrack {
 public:
  InsTrack(const fs::path& file, Nanoseconds midnight_ns) {
    constexpr std::size_t kRows = 700;  // 7 s; the sweeps end after 5.3 s
    const auto lines = read_lines(file);
    for (std::size_t i = 1; i < std::min(lines.size(), kRows); ++i) {
      const auto row = parse_numbers(lines[i], ',', 16, file, i + 1);
      stamps_ns_.push_back(midnight_ns + from_seconds(row[0]) - kOxtsMinusVelodyneClock_ns);
      poses_.emplace_back(from_roll_pitch_yaw({row[13], row[14], row[15]}),
                          Eigen::Vector3d(row[7], row[8], row[9]));
    }
  }

  Pose at(Nanoseconds time_ns) const {
    const auto after = std::upper_bound(stamps_ns_.begin(), stamps_ns_.end(), time_ns);
    const auto i = std::clamp<std::ptrdiff_t>(
        after - stamps_ns_.begin(), 1, static_cast<std::ptrdiff_t>(stamps_ns_.size()) - 1);
    const auto next = static_cast<std::size_t>(i);
    const double fraction = to_seconds(time_ns - stamps_ns_[next - 1]) /
                            to_seconds(stamps_ns_[next] - stamps_ns_[next - 1]);
    return interpolate(poses_[next - 1], poses_[next], fraction);
  }

 private:
  std::vector<Nanoseconds> stamps_ns_;
  std::vector<Pose> poses_;
};

/// Where the points in one cube lie, as a running covariance.
struct Cube {
  int points{0};
  int first_sweep{1000};
  int last_sweep{-1};
  Eigen::Vector3d sum{Eigen::Vector3d::Zero()};
  Eigen::Matrix3d squares{Eigen::Matrix3d::Zero()};

  void add(const Eigen::Vector3d& p, int sweep) {
    ++points;
    first_sweep = std::min(first_sweep, sweep);
    last_sweep = std::max(last_sweep, sweep);
    sum += p;
    squares += p * p.transpose();
  }
};

/// Thickness (m, standard deviation across the plane) of what is seen in many sweeps.
struct Sharpness {
  double wall_m{0.0};  ///< lower quartile over cubes with a steep plane
  double all_m{0.0};   ///< mean over all cubes, in which the ground is most
  std::size_t walls{0};
};

class KittiSharpness : public testing::Test {
 protected:
  void SetUp() override {
    const std::string path = std::string(TRIGPOINT_SHARED_DATA) + "/kitti_2011_09_26_drive_0009";
    if (!fs::exists(path)) {
      GTEST_SKIP() << "needs the recorded drive " << path;
    }
    drive_ = load_kitti_drive(find_kitti_sync_folder(path).value());
    constexpr Nanoseconds kDay_ns = 86'400 * kNanosecondsPerSecond;
    ins_ = std::make_unique<InsTrack>(path + "/imu100.csv",
                                      drive_.sweeps.front().start_ns / kDay_ns * kDay_ns);
    for (const auto& sweep : drive_.sweeps) {
      clouds_.push_back(load_kitti_sweep(sweep));
    }
  }

  /// `retime` gets a point's time and the sweep's duration (s) and gives the time to use.
  Sharpness sharpness(const std::function<double(double, double)>& retime) const {
    std::unordered_map<std::int64_t, Cube> cubes;
    for (std::size_t k = 0; k < clouds_.size(); ++k) {
      lay_down(static_cast<int>(k), retime, cubes);
    }
    return judge(cubes);
  }

 private:
  void lay_down(int sweep,
                const std::function<double(double, double)>& retime,
                std::unordered_map<std::int64_t, Cube>& cubes) const {
    const auto& cloud = clouds_[static_cast<std::size_t>(sweep)];
    const auto& times = drive_.sweeps[static_cast<std::size_t>(sweep)];
    const double duration_s = to_seconds(times.end_ns - times.start_ns);
    const auto poses = poses_during(times.start_ns, duration_s);
    for (std::size_t i = 0; i < cloud.width; i += kEveryPoint) {
      float values[5];
      std::memcpy(values, cloud.data.data() + i * cloud.point_step, sizeof(values));
      const Eigen::Vector3d p_lidar(values[0], values[1], values[2]);
      if (p_lidar.norm() < kNearest_m || p_lidar.norm() > kFarthest_m) {
        continue;
      }
      const double time_s = retime(static_cast<double>(values[4]), duration_s);
      const Eigen::Vector3d p =
          poses.at(static_cast<std::size_t>(std::lround((time_s + kMargin_s) / kStep_s))) * p_lidar;
      const Eigen::Array3d index = (p / kVoxel_m).array().floor();
      const Eigen::Array<std::int64_t, 3, 1> cell = index.cast<std::int64_t>() + 100'000;
      cubes[(cell.x() << 40) | (cell.y() << 20) | cell.z()].add(p - (index.matrix() * kVoxel_m),
                                                                sweep);
    }
  }

  /// T_world_lidar every half millisecond (5 mm of driving), from a margin before the sweep to one
  /// after.
  std::vector<Pose> poses_during(Nanoseconds start_ns, double duration_s) const {
    std::vector<Pose> poses;
    for (double time_s = -kMargin_s; time_s < duration_s + kMargin_s + kStep_s; time_s += kStep_s) {
      poses.push_back(ins_->at(start_ns + from_seconds(time_s)) * drive_.robot->T_base_lidar());
    }
    return poses;
  }

  static constexpr double kStep_s = 0.0005;
  static constexpr double kMargin_s = 0.06;

  static Sharpness judge(const std::unordered_map<std::int64_t, Cube>& cubes) {
    constexpr int kPoints = 40;
    constexpr int kSweeps = 8;
    constexpr double kWide_m = 0.12;  // of the plane: less is a pole or an edge
    constexpr double kCap_m = 0.15;   // bushes say nothing
    constexpr double kSteep = 0.3;    // |z| of the normal
    std::vector<double> walls;
    double sum = 0.0;
    double count = 0.0;
    for (const auto& [key, cube] : cubes) {
      if (cube.points < kPoints || cube.last_sweep - cube.first_sweep < kSweeps) {
        continue;
      }
      const Eigen::Vector3d mean = cube.sum / cube.points;
      const Eigen::Matrix3d covariance = cube.squares / cube.points - mean * mean.transpose();
      const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> solver(covariance);
      if (std::sqrt(std::max(0.0, solver.eigenvalues()[1])) < kWide_m) {
        continue;
      }
      const double thickness_m =
          std::min(kCap_m, std::sqrt(std::max(0.0, solver.eigenvalues()[0])));
      sum += thickness_m;
      count += 1.0;
      if (std::abs(solver.eigenvectors()(2, 0)) < kSteep) {
        walls.push_back(thickness_m);
      }
    }
    std::sort(walls.begin(), walls.end());
    return {walls.at(walls.size() / 4), sum / count, walls.size()};
  }

  KittiDrive drive_;
  std::unique_ptr<InsTrack> ins_;
  std::vector<PointCloudMessage> clouds_;
};

TEST_F(KittiSharpness, facades_are_thin_with_our_point_times_and_thick_with_others) {
  const auto ours = sharpness([](double time_s, double) { return time_s; });
  const auto reversed =
      sharpness([](double time_s, double duration_s) { return duration_s - time_s; });
  const auto cut_ahead = sharpness([](double time_s, double duration_s) {
    return std::fmod(time_s + duration_s / 2.0, duration_s);
  });
  const auto frozen = sharpness([](double, double duration_s) { return duration_s / 2.0; });
  RecordProperty("wall_mm", static_cast<int>(ours.wall_m * 1e3));
  RecordProperty("wall_reversed_mm", static_cast<int>(reversed.wall_m * 1e3));
  EXPECT_GT(ours.walls, 500U);
  EXPECT_LT(ours.wall_m, 0.06) << "measured 0.050 m: facades with their relief, in 51 sweeps";
  EXPECT_GT(reversed.wall_m, 1.2 * ours.wall_m) << "the scanner turns clockwise";
  EXPECT_GT(frozen.wall_m, 1.05 * ours.wall_m) << "undistorting is better than not";
  EXPECT_GT(cut_ahead.all_m, 1.02 * ours.all_m) << "the sweep is cut at the rear";
}

TEST_F(KittiSharpness, the_clocks_of_scanner_and_ins_agree_to_a_few_hundredths_of_a_second) {
  const auto shifted = [this](double shift_s) {
    return sharpness([shift_s](double time_s, double) { return time_s + shift_s; }).all_m;
  };
  const double at_zero = shifted(0.0);
  EXPECT_GT(shifted(-0.05), at_zero);
  EXPECT_GT(shifted(0.05), at_zero);
}

}  // namespace
}  // namespace trigpoint::recording
