// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/correct_session.hpp"

#include "render_map.hpp"
#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <numbers>

namespace trigpoint::exporter {
namespace {

using lio_mapper::Keyframe;
using test::error_of;
using test::read_all;
using test::ScratchFolder;
using ::testing::HasSubstr;

constexpr double kVoxel_m = 0.1;
constexpr float kFloat_m = 1e-4F;
constexpr double kQuarterTurn_rad = std::numbers::pi / 2.0;

/// One point 1 m ahead of a vehicle that stands at (x, 0, 0) in odom.
Keyframe keyframe(Nanoseconds stamp_ns, std::uint32_t epoch, double x_m) {
  Keyframe result;
  result.stamp_ns = stamp_ns;
  result.odom_epoch = epoch;
  result.T_odom_base.p.x() = x_m;
  result.points_base = {{1.0F, 0.0F, 0.0F, 7.0F}};
  return result;
}

Keyframe aligned(Keyframe frame, double yaw_rad, const Eigen::Vector3d& p) {
  frame.aligned = true;
  frame.T_map_odom = {yaw_rad, p};
  return frame;
}

class RenderKeyframes : public testing::Test {
 protected:
  MapReport render(const std::vector<Keyframe>& frames,
                   const std::optional<Alignment>& fallback = {},
                   const MapCorrections& corrections = {}) {
    const auto source = [&](const auto& visit) {
      for (const auto& frame : frames) {
        visit(frame);
      }
    };
    return render_keyframes(source, fallback, kVoxel_m, file(), {}, corrections);
  }

  std::string file() const { return folder_.file("map.pcd"); }

  bool has_point(float x, float y, float z) const {
    const auto cloud = read_pcd(file());
    return std::any_of(cloud.begin(), cloud.end(), [&](const PointXyzi& point) {
      return (point.position() - Eigen::Vector3f(x, y, z)).norm() < kFloat_m;
    });
  }

 private:
  ScratchFolder folder_;
};

TEST_F(RenderKeyframes, places_each_by_its_own_alignment) {
  const auto report = render({aligned(keyframe(1, 0, 0.0), 0.0, {10.0, 0.0, 0.0}),
                              aligned(keyframe(2, 0, 2.0), kQuarterTurn_rad, {0.0, 20.0, 5.0})});
  EXPECT_EQ(report.frame, "map");
  EXPECT_EQ(report.points_written, 2U);
  EXPECT_TRUE(has_point(11.0F, 0.0F, 0.0F));
  EXPECT_TRUE(has_point(0.0F, 23.0F, 5.0F));  // (3, 0, 0) turned left, then moved
  EXPECT_TRUE(report.remark.empty());
}

TEST_F(RenderKeyframes, places_those_before_the_alignment_by_the_first_of_their_epoch) {
  render({keyframe(1, 0, 0.0),
          aligned(keyframe(2, 0, 5.0), 0.0, {100.0, 0.0, 0.0}),
          aligned(keyframe(3, 0, 9.0), 0.0, {200.0, 0.0, 0.0})});
  EXPECT_TRUE(has_point(101.0F, 0.0F, 0.0F));
}

TEST_F(RenderKeyframes, levels_each_by_what_was_known_farther_on) {
  std::vector<Keyframe> frames;
  for (const double x : {0.0, 60.0, 120.0, 180.0}) {
    frames.push_back(
        aligned(keyframe(static_cast<Nanoseconds>(x) + 1, 0, x), 0.0, {10.0, 0.0, 0.0}));
  }
  // Pitched down: known from 120 m on.
  constexpr double kTilt_rad = 0.1;
  frames[2].T_map_odom.tilt_rad.y() = kTilt_rad;
  frames[3].T_map_odom.tilt_rad.y() = kTilt_rad;
  render(frames);
  const auto cos = static_cast<float>(std::cos(kTilt_rad));
  const auto sin = static_cast<float>(std::sin(kTilt_rad));
  // The robot stays where it was, what it saw a metre ahead turns about it.
  EXPECT_TRUE(has_point(10.0F + cos, 0.0F, -sin));
  EXPECT_TRUE(has_point(70.0F + cos, 0.0F, -sin));
  // From there on T_map_odom was right itself.
  EXPECT_TRUE(has_point(10.0F + 121.0F * cos, 0.0F, -121.0F * sin));
}

TEST_F(RenderKeyframes, levels_those_before_the_alignment_about_the_place_where_it_came) {
  Keyframe second = aligned(keyframe(2, 0, 5.0), 0.0, {0.0, 0.0, 0.0});
  second.T_map_odom.tilt_rad.y() = 0.1;
  second.T_map_odom.p =
      Eigen::Vector3d(5.0, 0.0, 0.0) - second.T_map_odom.pose().q * Eigen::Vector3d(5.0, 0.0, 0.0);
  render({keyframe(1, 0, 3.0), second});
  // A metre behind the place of the alignment, 0.1 rad lower ahead of it, so higher behind it.
  EXPECT_TRUE(
      has_point(5.0F - static_cast<float>(std::cos(0.1)), 0.0F, static_cast<float>(std::sin(0.1))));
}

TEST_F(RenderKeyframes, places_each_where_the_pose_graph_has_it) {
  CorrectedPoses corrected;
  corrected.T_frame_base[1].p = {50.0, 0.0, 0.0};
  const auto report = render({aligned(keyframe(1, 0, 0.0), 0.0, {10.0, 0.0, 0.0}),
                              aligned(keyframe(2, 0, 2.0), 0.0, {10.0, 0.0, 0.0})},
                             {},
                             {&corrected, false, {}});
  EXPECT_TRUE(has_point(51.0F, 0.0F, 0.0F));
  EXPECT_EQ(report.points_written, 1U);
  EXPECT_EQ(report.keyframes_left_out, 1U);
}

/// A wall 10 m ahead of a robot that stands, and in some scans a board at 5 m before it.
Keyframe wall_with_board(Nanoseconds stamp_ns, bool with_board) {
  Keyframe frame = aligned(keyframe(stamp_ns, 0, 0.0), 0.0, {});
  frame.T_map_odom.p.setZero();
  frame.points_base.clear();
  for (int azimuth = -20; azimuth <= 20; ++azimuth) {
    for (int elevation = -5; elevation <= 5; ++elevation) {
      const double y = std::tan(azimuth * 0.01);
      const double z = std::tan(elevation * 0.03);
      const double range_m = with_board && std::abs(azimuth) < 8 ? 5.0 : 10.0;
      frame.points_base.push_back({static_cast<float>(range_m),
                                   static_cast<float>(range_m * y),
                                   static_cast<float>(range_m * z),
                                   1.0F});
    }
  }
  return frame;
}

TEST_F(RenderKeyframes, leaves_out_what_other_scans_look_through) {
  std::vector<Keyframe> frames;
  for (int i = 1; i <= 6; ++i) {
    frames.push_back(wall_with_board(i, i == 3));
  }
  const auto has_board = [&] {
    const auto cloud = read_pcd(file());
    return std::any_of(cloud.begin(), cloud.end(), [](const auto& p) { return p.x < 6.0F; });
  };
  render(frames);
  EXPECT_TRUE(has_board());
  const auto report = render(frames, {}, {nullptr, true, Eigen::Vector3d::Zero()});
  EXPECT_FALSE(has_board());
  EXPECT_EQ(report.points_moving, 15U * 11U);
}

TEST_F(RenderKeyframes, leaves_out_an_epoch_that_was_never_aligned_and_says_so) {
  const auto report =
      render({aligned(keyframe(1, 0, 0.0), 0.0, {1.0, 0.0, 0.0}), keyframe(2, 1, 0.0)});
  EXPECT_EQ(report.keyframes, 1U);
  EXPECT_EQ(report.keyframes_left_out, 1U);
  EXPECT_THAT(report.remark, HasSubstr("1 keyframes"));
}

TEST_F(RenderKeyframes, falls_back_to_the_best_alignment_when_none_was_admitted) {
  Alignment best;
  best.T_map_odom = {kQuarterTurn_rad, {0.0, 0.0, 3.0}};
  const auto report = render({keyframe(1, 0, 1.0)}, best);
  EXPECT_EQ(report.frame, "map");
  EXPECT_TRUE(has_point(0.0F, 2.0F, 3.0F));
}

TEST_F(RenderKeyframes, prefers_an_admitted_alignment_to_the_fallback) {
  Alignment best;
  best.T_map_odom = {0.0, {-50.0, 0.0, 0.0}};
  render({keyframe(1, 0, 0.0), aligned(keyframe(2, 0, 1.0), 0.0, {10.0, 0.0, 0.0})}, best);
  EXPECT_TRUE(has_point(11.0F, 0.0F, 0.0F));
}

TEST_F(RenderKeyframes, says_that_the_map_is_in_odom_when_there_is_nothing_to_align_with) {
  Alignment of_another_epoch;
  of_another_epoch.odom_epoch = 9;
  const auto report = render({keyframe(1, 0, 0.0)}, of_another_epoch);
  EXPECT_EQ(report.frame, "odom");
  EXPECT_THAT(report.remark, HasSubstr("not georeferenced"));
  EXPECT_TRUE(has_point(1.0F, 0.0F, 0.0F));
}

TEST_F(RenderKeyframes, writes_a_valid_empty_map_of_nothing) {
  const auto report = render({});
  EXPECT_EQ(report.points_written, 0U);
  EXPECT_THAT(report.remark, HasSubstr("empty"));
  EXPECT_TRUE(std::filesystem::exists(file()));
}

TEST_F(RenderKeyframes, gives_the_same_bytes_twice) {
  std::vector<Keyframe> frames;
  for (int i = 0; i < 50; ++i) {
    frames.push_back(aligned(keyframe(i, 0, 3.7 * i), 0.01 * i, {0.1 * i, 0.0, 0.0}));
  }
  render(frames);
  const auto first = read_all(file());
  render(frames);
  EXPECT_EQ(first, read_all(file()));
}

TEST_F(RenderKeyframes, keeps_the_old_map_when_the_keyframes_cannot_be_read) {
  render({keyframe(1, 0, 0.0)});
  const auto before = read_all(file());
  const auto broken = [reads = 0](const auto&) mutable {
    if (++reads == 2) {
      throw std::runtime_error("keyframes.sqlite: disk error");
    }
  };
  EXPECT_THAT(error_of([&] { render_keyframes(broken, {}, kVoxel_m, file(), {}); }),
              HasSubstr("keyframes.sqlite"));
  EXPECT_EQ(before, read_all(file()));
  EXPECT_FALSE(std::filesystem::exists(file() + ".part"));
}

}  // namespace
}  // namespace trigpoint::exporter
