// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/export_session.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "scratch_folder.hpp"
#include "small_disk.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace trigpoint::exporter {
namespace {

using test::error_of;
using test::read_all;
using test::ScratchFolder;
using test::write_all;
using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using tests::SmallDisk;

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

  /// One point 1 m ahead of the origin of odom.
  void write_keyframe(bool aligned = false) const {
    lio_mapper::KeyframeWriter writer(path_in(session(), session_file::kKeyframes));
    lio_mapper::Keyframe keyframe;
    keyframe.stamp_ns = 1;
    keyframe.aligned = aligned;
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
                export_session(session(), out(), {{"laz"}, 0.1});
              }),
              AllOf(HasSubstr("'laz'"), HasSubstr("pcd, ply, las")));
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
  EXPECT_THAT(export_session(session(), out("a"), {{"pcd"}, 0.1}).written[0].content,
              HasSubstr("frame odom"));
  EXPECT_EQ(frame_of_pcd(out("a/map.pcd")), "odom");
  write_alignment(path_in(session(), session_file::kAlignment), {});
  export_session(session(), out("b"), {{"pcd"}, 0.1});
  EXPECT_EQ(frame_of_pcd(out("b/map.pcd")), "map");
  ASSERT_EQ(read_pcd(out("b/map.pcd")).size(), 1U);  // the comment is no hindrance to readers
  std::filesystem::copy(out("b/map.pcd"), path_in(session(), session_file::kMap));
  std::filesystem::remove(path_in(session(), session_file::kKeyframes));
  EXPECT_THAT(export_session(session(), out("c"), {{"pcd"}, 0.1}).written[0].content,
              HasSubstr("frame map, copied"));
}

TEST_F(ExportSession, writes_over_nothing_and_names_what_is_there) {
  write_lio();
  create_session_folder(out());
  write_all(out("lio.csv"), "mine");
  EXPECT_THAT(error_of([&] { export_session(session(), out()); }),
              AllOf(HasSubstr("holds lio.csv already"), HasSubstr("another folder")));
  EXPECT_EQ(read_all(out("lio.csv")), "mine");
  EXPECT_FALSE(std::filesystem::exists(out("lio.tum")));
  EXPECT_FALSE(export_session(session(), out(), {{"tum"}}).written.empty());
}

TEST_F(ExportSession, without_a_datum_says_what_needs_one_and_writes_the_rest) {
  write_lio();
  write_keyframe();
  const auto report = export_session(session(), out());
  EXPECT_THAT(report.formats_missing,
              testing::ElementsAre("las", "geojson", "gpx", "kml", "kmz", "geotiff"));
  EXPECT_THAT(report.missing, Contains(AllOf(HasSubstr("no datum.yaml"), HasSubstr("pcd, ply"))));
  EXPECT_THAT(read_all(out("map.ply")), HasSubstr("comment frame odom"));
  EXPECT_TRUE(std::filesystem::exists(out("lio.kitti.txt")));
  EXPECT_FALSE(std::filesystem::exists(out("map.las")));
  EXPECT_THAT(error_of([&] { export_session(session(), out("las"), {{"las"}}); }),
              AllOf(HasSubstr("nothing to export"), HasSubstr("datum.yaml")));
}

TEST_F(ExportSession, does_not_place_a_map_in_odom_on_the_earth) {
  write_keyframe();
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  const auto report = export_session(session(), out());
  EXPECT_THAT(report.missing, Contains(HasSubstr("the map is in the frame odom")));
  EXPECT_THAT(read_all(out("map.ply")), HasSubstr("comment frame odom"));
  EXPECT_FALSE(std::filesystem::exists(out("map.las")));
  EXPECT_FALSE(std::filesystem::exists(out("height.tif")));
  EXPECT_THAT(report.formats_missing, Contains("las"));
}

TEST_F(ExportSession, leaves_no_hidden_file_and_writes_tiles_of_the_same_points) {
  write_keyframe();
  write_alignment(path_in(session(), session_file::kAlignment), {});
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  export_session(session(), out(), {{"pcd", "las", "kmz"}, 0.1, 20.0});
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(out())) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names,
              testing::UnorderedElementsAre("datum.yaml", "map_pcd", "map_las", "session.kmz"));
  EXPECT_EQ(read_pcd(out("map_pcd/map_0_0.pcd")).size(), 1U);
}

TEST_F(ExportSession, that_is_broken_off_leaves_nothing_and_can_be_repeated) {
  write_keyframe();
  write_alignment(path_in(session(), session_file::kAlignment), {});
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  const ExportOptions options{{"ply", "las"}, 0.1, 20.0};
  const auto break_off = [](double share) {
    if (share > 0.85) {  // while the tiles are written
      throw std::runtime_error("stop");
    }
  };
  EXPECT_EQ(error_of([&] { export_session(session(), out(), options, break_off); }), "stop");
  EXPECT_TRUE(std::filesystem::is_empty(out()));
  EXPECT_EQ(export_session(session(), out(), options).written.size(), 3U);
}

TEST_F(ExportSession, refuses_tiles_whose_names_would_be_the_same) {
  write_keyframe();
  EXPECT_THAT(error_of([&] {
                export_session(session(), out(), {{"pcd"}, 0.1, 0.5});
              }),
              HasSubstr("1 m or more"));
}

TEST_F(ExportSession, keeps_a_map_on_the_antimeridian_in_one_piece) {
  lio_mapper::KeyframeWriter writer(path_in(session(), session_file::kKeyframes));
  lio_mapper::Keyframe keyframe;
  keyframe.stamp_ns = 1;
  keyframe.points_base = {{-20.0F, 0.0F, 0.0F, 0.0F}, {20.0F, 0.0F, 0.0F, 0.0F}};
  writer.append(keyframe);
  write_alignment(path_in(session(), session_file::kAlignment), {});
  write_datum(path_in(session(), session_file::kDatum), {-17.0, 180.0, 5.0});
  export_session(session(), out(), {{"kml"}});
  const std::string kml = read_all(out("session.kml"));
  EXPECT_THAT(kml, AllOf(HasSubstr("<east>180.0001"), HasSubstr("<west>179.9998")));
}

TEST_F(ExportSession, writes_no_sixtieth_second) {
  {
    TrajectoryWriter fused(path_in(session(), session_file::kFused), "base_link in map");
    fused.append(1'700'000'039'999'600'000, Pose{});  // 22:13:59.9996
    fused.append(1'700'000'045'123'400'000, Pose{});
  }
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  export_session(session(), out(), {{"gpx", "geojson"}});
  EXPECT_THAT(read_all(out("trajectories.gpx")),
              AllOf(HasSubstr("<time>2023-11-14T22:14:00Z</time>"),
                    HasSubstr("<time>2023-11-14T22:14:05.123Z</time>")));
  EXPECT_THAT(read_all(out("trajectories.geojson")), HasSubstr("2023-11-14T22:14:00Z"));
}

TEST_F(ExportSession, dates_the_files_in_the_archive_by_the_end_of_the_drive) {
  {
    TrajectoryWriter fused(path_in(session(), session_file::kFused), "base_link in map");
    fused.append(1'700'000'040'000'000'000, Pose{});
    fused.append(1'700'000'045'123'400'000, Pose{});  // 2023-11-14 22:14:05
  }
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  export_session(session(), out(), {{"kmz"}});
  const std::string zip = read_all(out("session.kmz"));
  const unsigned time = (22U << 11U) | (14U << 5U) | (5U / 2U);
  const unsigned date = ((2023U - 1980U) << 9U) | (11U << 5U) | 14U;
  std::string stamp;
  for (const unsigned number : {time, date}) {
    stamp += {static_cast<char>(number & 0xFFU), static_cast<char>(number >> 8U)};
  }
  const std::size_t directory = zip.find("PK\1\2");
  ASSERT_NE(directory, std::string::npos);
  EXPECT_EQ(zip.substr(10, 4), stamp) << "of the first entry itself";
  EXPECT_EQ(zip.substr(directory + 12, 4), stamp) << "in the directory";
}

TEST_F(ExportSession, names_the_file_that_the_disk_had_no_room_for_and_leaves_no_part_of_it) {
  PointCloud cloud;
  for (int i = 0; i < 20'000; ++i) {
    const auto x = static_cast<float>(i);
    cloud.push_back(
        {20.0F * std::sin(0.7F * x), 20.0F * std::cos(1.3F * x), 9.0F * std::sin(x), x});
  }
  write_pcd(path_in(session(), session_file::kMap), cloud);
  std::string pcd = read_all(path_in(session(), session_file::kMap));
  pcd.replace(pcd.find("VERSION"), 0, "# frame map\n");
  write_all(path_in(session(), session_file::kMap), pcd);
  write_datum(path_in(session(), session_file::kDatum), {43.9, -78.9, 100.0});
  {
    TrajectoryWriter fused(path_in(session(), session_file::kFused), "base_link in map");
    for (int i = 0; i < 2000; ++i) {
      fused.append(i * 100'000'000LL, Pose(Eigen::Quaterniond::Identity(), {0.1 * i, 0.0, 0.0}));
    }
  }
  for (const char* format : {"ply", "las", "kitti", "csv", "geojson", "gpx", "kml", "geotiff"}) {
    std::string error;
    {
      const SmallDisk disk(8192);
      error = error_of([&] { export_session(session(), out(format), {{format}}); });
    }
    EXPECT_THAT(error, AllOf(HasSubstr(out(format)), HasSubstr("cannot"))) << format;
    EXPECT_TRUE(std::filesystem::is_empty(out(format))) << format << ": " << error;
  }
}

TEST_F(ExportSession, places_lio_once_so_that_its_drift_shows) {
  // lio sees 2 m where fused, which starts at (10, 0), sees 1 m.
  TrajectoryWriter fused(path_in(session(), session_file::kFused), "base_link in map");
  TrajectoryWriter lio(path_in(session(), session_file::kLio), "base_link in odom");
  for (int i = 0; i < 3; ++i) {
    fused.append(i * 1'000'000'000, Pose(Eigen::Quaterniond::Identity(), {10.0 + i, 0.0, 0.0}));
    lio.append(i * 1'000'000'000, Pose(Eigen::Quaterniond::Identity(), {2.0 * i, 0.0, 0.0}));
  }
  // At the equator on Greenwich's other side, 1 m east is 8.983e-6 degrees.
  write_datum(path_in(session(), session_file::kDatum), {1e-6, 3.0, 0.0});
  export_session(session(), out(), {{"geojson"}});
  const std::string text = read_all(out("trajectories.geojson"));
  const std::string lio_line = text.substr(text.find("\"lio\""));
  EXPECT_THAT(lio_line, HasSubstr("placed once"));
  EXPECT_THAT(lio_line, HasSubstr("[ 3.000089832, 0.000001"));  // 10 m
  EXPECT_THAT(lio_line, HasSubstr("[ 3.000125764, 0.000001"));  // 14 m
}

TEST_F(ExportSession, places_lio_at_the_very_moment_of_the_first_published_pose) {
  // Both drive east at 10 m/s; fused begins between two scans, 20 ms before the second.
  TrajectoryWriter fused(path_in(session(), session_file::kFused), "base_link in map");
  TrajectoryWriter lio(path_in(session(), session_file::kLio), "base_link in odom");
  const auto at = [](double x_m) { return Pose(Eigen::Quaterniond::Identity(), {x_m, 0.0, 0.0}); };
  lio.append(1'000'000'000, at(0.0));
  lio.append(1'100'000'000, at(1.0));
  fused.append(1'080'000'000, at(100.8));
  fused.append(1'100'000'000, at(101.0));
  write_datum(path_in(session(), session_file::kDatum), {1e-6, 3.0, 0.0});
  export_session(session(), out(), {{"geojson"}});
  const std::string text = read_all(out("trajectories.geojson"));
  // 100 m and 101 m at 8.98315e-6 degrees each.
  EXPECT_THAT(text.substr(text.find("\"lio\"")),
              AllOf(HasSubstr("[ 3.000898315"), HasSubstr("[ 3.000907298")));
}

TEST_F(ExportSession, tells_wrong_options_from_a_failure) {
  write_lio();
  export_session(session(), out());
  ExportOptions small;
  small.tile_m = 0.5;
  EXPECT_THROW(export_session(session(), out()), ConfigError) << "is there already";
  EXPECT_THROW(export_session(session(), out("lio.tum")), ConfigError) << "a file";
  EXPECT_THROW(export_session(session(), out("tiles"), small), ConfigError);
  EXPECT_FALSE(std::filesystem::exists(out("tiles")));
}

TEST_F(ExportSession, names_the_configuration_that_cannot_be_read) {
  for (const char* text : {"robot: [1, 2\n", "hello\n", "robot: {lidar_position_base_m: [a]}\n"}) {
    write_all(path_in(session(), session_file::kConfig), text);
    EXPECT_THAT(error_of([&] { past_settings_of(session()); }), HasSubstr("config.yaml")) << text;
  }
}

TEST_F(ExportSession, tells_a_value_of_the_configuration_that_cannot_be_taken) {
  const auto error_with = [&](const std::string& text) {
    write_all(path_in(session(), session_file::kConfig), text);
    return error_of([&] { past_settings_of(session()); });
  };
  const std::string drift = "lio_mapper:\n  drift:\n    ";
  for (const char* value : {"[0.1, 0.2]", "much", ".nan", "-0.1", "{x: 1}"}) {
    EXPECT_THAT(error_with(drift + "yaw_sigma_rad_sqrtm: " + value + "\n"),
                AllOf(HasSubstr("config.yaml:3: lio_mapper.drift.yaw_sigma_rad_sqrtm must be a "),
                      HasSubstr("number, 0 or more; is ")))
        << value;
  }
  EXPECT_THAT(error_with("lio_mapper: {drift: 0.3}\n"), HasSubstr("lio_mapper.drift must be"));
  EXPECT_THAT(error_with("robot: {lidar_position_base_m: [1, 2]}\n"), HasSubstr("three numbers"));
  EXPECT_EQ(error_with(drift + "yaw_sigma_rad_sqrtm: 0.5\nrobot: {}\n"), "");
  EXPECT_EQ(past_settings_of(session()).drift.yaw_sigma_rad_sqrtm, 0.5);
  EXPECT_EQ(error_with("lio_mapper: {drift: }\n"), "");
}

TEST_F(ExportSession, that_needs_a_place_on_the_earth_is_refused_before_the_map_is_rendered) {
  write_keyframe();
  double furthest = 0.0;
  EXPECT_THAT(error_of([&] {
                export_session(session(), out(), {{"las", "kmz"}}, [&](double share) {
                  furthest = std::max(furthest, share);
                });
              }),
              AllOf(HasSubstr("nothing to export"), HasSubstr("no datum.yaml"), HasSubstr("kmz")));
  EXPECT_EQ(furthest, 0.0);
  EXPECT_FALSE(std::filesystem::exists(out()));
}

TEST_F(ExportSession, of_a_drive_twice_is_no_merge_and_both_are_named) {
  write_keyframe(true);
  write_datum(path_in(session(), session_file::kDatum), Datum{43.9, -78.9, 100.0});
  EXPECT_THAT(error_of([&] { merge_sessions(session(), session(), out(), 0.1, {}); }),
              AllOf(HasSubstr(session() + " and " + session()), HasSubstr("not one twice")));
}

TEST_F(ExportSession, merged_with_another_one_and_broken_off_leaves_nothing_and_can_be_repeated) {
  const std::string second = out("second");
  for (const std::string& folder : {session(), second}) {
    create_session_folder(folder);
    lio_mapper::KeyframeWriter writer(path_in(folder, session_file::kKeyframes));
    lio_mapper::Keyframe keyframe;
    keyframe.stamp_ns = folder == second ? 2 : 1;
    keyframe.aligned = true;
    keyframe.points_base = {{1.0F, 0.0F, 0.0F, 7.0F}};
    writer.append(keyframe);
    write_datum(path_in(folder, session_file::kDatum), Datum{43.9, -78.9, 100.0});
  }
  const std::string merged = out("merged");
  const auto break_off = [](double share) {
    if (share > 0.6) {  // while the map is rendered
      throw std::runtime_error("stop");
    }
  };
  EXPECT_EQ(error_of([&] { merge_sessions(session(), second, merged, 0.1, break_off); }), "stop");
  EXPECT_TRUE(std::filesystem::is_empty(merged));
  EXPECT_EQ(merge_sessions(session(), second, merged, 0.1, {}).graph.keyframes, 2U);
  std::vector<std::string> names;
  for (const auto& entry : std::filesystem::directory_iterator(merged)) {
    names.push_back(entry.path().filename());
  }
  EXPECT_THAT(names,
              testing::UnorderedElementsAre("datum.yaml", "map.pcd", "first.tum", "second.tum"));
}

}  // namespace
}  // namespace trigpoint::exporter
