// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/export_session.hpp"

#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::read_all;
using test::ScratchFolder;
using test::write_all;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;

constexpr float kFloat_m = 1e-4F;

class ExportSession : public testing::Test {
 protected:
  ExportSession() { create_session_folder(session()); }

  std::string session() const { return folder_.file("session"); }

  std::string out(const std::string& name = "") const { return folder_.file("out/" + name); }

  void write_lio() const {
    TrajectoryWriter writer(path_in(session(), session_file::kLio), "base_link in odom");
    writer.append(1, Pose{});
    writer.append(2, Pose{});
  }

  /// One point 1 m ahead of the origin of odom, not aligned.
  void write_keyframe() const {
    lio_mapper::KeyframeWriter writer(path_in(session(), session_file::kKeyframes));
    lio_mapper::Keyframe keyframe;
    keyframe.stamp_ns = 1;
    keyframe.points_base = {{1.0F, 0.0F, 0.0F, 7.0F}};
    writer.append(keyframe);
  }

 private:
  ScratchFolder folder_;
};

TEST_F(ExportSession, renders_the_stored_keyframes_with_the_alignment_that_was_not_admitted) {
  write_keyframe();
  AlignmentRecord record;
  record.alignment.T_map_odom.p = {10.0, 20.0, 30.0};
  write_alignment(path_in(session(), session_file::kAlignment), record);
  const auto report = export_session(session(), out());
  EXPECT_EQ(report.map.frame, "map");
  const auto cloud = read_pcd(out("map.pcd"));
  ASSERT_EQ(cloud.size(), 1U);
  EXPECT_LT((cloud[0].position() - Eigen::Vector3f(11.0F, 20.0F, 30.0F)).norm(), kFloat_m);
  EXPECT_NEAR(cloud[0].intensity, 7.0F, kFloat_m);
}

TEST_F(ExportSession, copies_trajectories_and_says_what_is_missing) {
  write_lio();
  const auto report = export_session(session(), out());
  EXPECT_EQ(read_trajectory(out("lio.tum")).size(), 2U);
  EXPECT_THAT(report.missing, AllOf(Contains(HasSubstr("fused.tum")), Contains(HasSubstr("map"))));
}

TEST_F(ExportSession, writes_only_the_formats_that_were_asked_for) {
  write_lio();
  write_keyframe();
  export_session(session(), out(), {{"pcd"}, 0.1});
  EXPECT_TRUE(std::filesystem::exists(out("map.pcd")));
  EXPECT_FALSE(std::filesystem::exists(out("lio.tum")));
}

TEST_F(ExportSession, refuses_an_unknown_format_and_names_those_that_are) {
  write_lio();
  EXPECT_THAT(error_of([&] {
                export_session(session(), out(), {{"las"}, 0.1});
              }),
              AllOf(HasSubstr("'las'"), HasSubstr("pcd, tum")));
}

TEST_F(ExportSession, refuses_a_damaged_trajectory_with_file_and_line) {
  write_lio();
  write_all(path_in(session(), session_file::kGps), "1 2 3\n");
  EXPECT_THAT(error_of([&] { export_session(session(), out()); }), HasSubstr("gps.tum:1"));
}

TEST_F(ExportSession, refuses_an_empty_session_a_missing_one_and_itself) {
  EXPECT_THAT(error_of([&] { export_session(session(), out()); }), HasSubstr("nothing to export"));
  EXPECT_THAT(error_of([&] { export_session("/nowhere", out()); }), HasSubstr("/nowhere"));
  EXPECT_THAT(error_of([&] { export_session(session(), session()); }), HasSubstr("itself"));
}

TEST_F(ExportSession, names_the_keyframe_file_that_cannot_be_read) {
  write_all(path_in(session(), session_file::kKeyframes), "this is no database");
  EXPECT_THAT(error_of([&] { export_session(session(), out()); }), HasSubstr("keyframes.sqlite"));
}

TEST_F(ExportSession, takes_truth_alone_for_no_result) {
  TrajectoryWriter(path_in(session(), session_file::kTruth), "base_link in map").append(1, Pose{});
  EXPECT_THAT(error_of([&] { export_session(session(), out()); }),
              AllOf(HasSubstr("nothing to export"), HasSubstr("trigpoint map")));
  EXPECT_FALSE(std::filesystem::exists(out("truth.tum")));
}

TEST_F(ExportSession, and_the_map_file_itself_agree_on_the_frame) {
  write_keyframe();
  EXPECT_THAT(export_session(session(), out(), {{"pcd"}, 0.1}).written[0].content,
              HasSubstr("frame odom"));
  EXPECT_EQ(frame_of_pcd(out("map.pcd")), "odom");
  write_alignment(path_in(session(), session_file::kAlignment), {});
  export_session(session(), out(), {{"pcd"}, 0.1});
  EXPECT_EQ(frame_of_pcd(out("map.pcd")), "map");
  ASSERT_EQ(read_pcd(out("map.pcd")).size(), 1U);  // the comment is no hindrance to readers
  std::filesystem::copy(out("map.pcd"), path_in(session(), session_file::kMap));
  std::filesystem::remove(path_in(session(), session_file::kKeyframes));
  EXPECT_THAT(export_session(session(), out(), {{"pcd"}, 0.1}).written[0].content,
              HasSubstr("frame map, copied"));
}

}  // namespace
}  // namespace trigpoint::exporter
