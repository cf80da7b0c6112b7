// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/see_through.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

using Eigen::Vector3d;

constexpr double kSensor_m = 1.4;  // above the ground
constexpr double kWall_y_m = 8.0;
constexpr double kBox_y_m = 4.0;
constexpr double kNoise_m = 0.02;
constexpr double kSurface_m = 4.0 * kNoise_m;

/// Ground, a wall along x, a thin pole before it and, when there, an upright board: by rays of 16
/// rings, as a spinning LiDAR sends them from (x, 0).
struct Street {
  static constexpr double kPole_x_m = 5.0;
  static constexpr double kPole_y_m = 5.0;
  static constexpr double kPole_m = 0.1;  // radius

  /// Range along a ray to the nearest surface; infinity: none.
  static double range_m(const Vector3d& o, const Vector3d& d, double board_x_m) {
    double nearest = std::numeric_limits<double>::infinity();
    const auto offer = [&](double range) {
      nearest = range > 0.0 ? std::min(nearest, range) : nearest;
    };
    if (d.z() < 0.0) {
      offer(-o.z() / d.z());
    }
    if (d.y() > 0.0) {
      const double to_wall = (kWall_y_m - o.y()) / d.y();
      if (o.z() + to_wall * d.z() < 4.0) {
        offer(to_wall);
      }
      const double to_board = (kBox_y_m - o.y()) / d.y();
      const Vector3d at = o + to_board * d;
      if (std::abs(at.x() - board_x_m) < 0.4 && at.z() > 0.0 && at.z() < 1.8) {
        offer(to_board);
      }
    }
    const Eigen::Vector2d f(o.x() - kPole_x_m, o.y() - kPole_y_m);
    const double a = d.head<2>().squaredNorm();
    const double b = f.dot(d.head<2>());
    const double root = b * b - a * (f.squaredNorm() - kPole_m * kPole_m);
    if (root > 0.0) {
      offer((-b - std::sqrt(root)) / a);
    }
    return nearest;
  }

  static PointCloud scan(double x_m, double board_x_m) {
    std::mt19937 random(static_cast<unsigned>(x_m));
    std::normal_distribution<double> noise_m(0.0, kNoise_m);
    const Vector3d o(x_m, 0.0, kSensor_m);
    PointCloud cloud;
    for (int ring = -15; ring <= 15; ring += 2) {
      for (double azimuth = 0.0; azimuth < 360.0; azimuth += 0.4) {
        const double e = ring * std::numbers::pi / 180.0;
        const double a = azimuth * std::numbers::pi / 180.0;
        const Vector3d d(std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e));
        const double range = range_m(o, d, board_x_m);
        if (range < 50.0) {
          const Eigen::Vector3f p = (o + (range + noise_m(random)) * d).cast<float>();
          cloud.push_back({p.x(), p.y(), p.z(), 0.0F});
        }
      }
    }
    return cloud;
  }
};

struct Kind {
  std::size_t all{0};
  std::size_t removed{0};

  double share() const { return static_cast<double>(removed) / static_cast<double>(all); }
};

/// A robot drives along the wall, 1 m a scan; the board crosses its view, 0.8 m a scan, or stands.
class SeeThroughStreet : public testing::Test {
 protected:
  void drive(double board_step_m) {
    SeeThrough see_through;
    std::vector<PointCloud> scans;
    for (int i = 0; i < 20; ++i) {
      scans.push_back(Street::scan(i, 12.0 - board_step_m * i));
      see_through.add(scans.back());
    }
    for (int i = 0; i < 20; ++i) {
      see_through.look(scans[static_cast<std::size_t>(i)],
                       {static_cast<double>(i), 0.0, kSensor_m});
    }
    see_through.decide();
    for (const PointCloud& scan : scans) {
      for (const PointXyzi& point : scan) {
        Kind& kind = kind_of(point);
        ++kind.all;
        kind.removed += see_through.is_moving(point) ? 1 : 0;
      }
    }
  }

  Kind& kind_of(const PointXyzi& p) {
    const double to_pole = std::hypot(p.x - Street::kPole_x_m, p.y - Street::kPole_y_m);
    return to_pole < Street::kPole_m + kSurface_m                      ? pole_
           : std::abs(p.y - kBox_y_m) < kSurface_m && p.z > kSurface_m ? board_
           : p.z < kSurface_m                                          ? ground_
                                                                       : wall_;
  }

  Kind board_;
  Kind ground_;
  Kind wall_;
  Kind pole_;
};

TEST_F(SeeThroughStreet, removes_what_passes_and_keeps_what_stays) {
  drive(0.8);
  ASSERT_GT(board_.all, 200U);
  ASSERT_GT(pole_.all, 50U);
  EXPECT_GT(board_.share(), 0.9);
  EXPECT_LT(ground_.share(), 0.005);
  EXPECT_LT(wall_.share(), 0.005);
  EXPECT_LT(pole_.share(), 0.1);
}

TEST_F(SeeThroughStreet, keeps_a_board_that_stands) {
  drive(0.0);
  EXPECT_LT(board_.share(), 0.02);
  EXPECT_LT(wall_.share(), 0.005);
}

}  // namespace
}  // namespace trigpoint::lio_mapper
