// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <filesystem>
#include <stdexcept>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

class CheckpointStore : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = std::filesystem::temp_directory_path() / "checkpoint_store_XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }

  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return folder_ / "keyframes.sqlite"; }

  std::filesystem::path folder_;
};

Keyframe small_keyframe(int i) {
  Keyframe k;
  k.id = static_cast<std::uint64_t>(i);
  k.stamp_ns = 1'000 + i;
  k.T_odom_base.p = {static_cast<double>(i), 0.0, 0.0};
  for (int j = 0; j < 500; ++j) {
    k.points_base.push_back({0.01F * static_cast<float>(j), 1.0F, 2.0F, 3.0F});
  }
  return k;
}

Checkpoint checkpoint(int i) {
  Checkpoint c;
  c.stamp_ns = 1'000 + i;
  c.odom_epoch = 3;
  c.T_odom_base = {Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {0.1 * i, 1.0 / 3.0, -7.0}};
  c.v_odom_mps = {1.0 / 7.0, 2.0, 3.0};
  c.gyro_bias_radps = {1e-3, 2e-3, 3e-3};
  c.accel_bias_mps2 = {0.1, 0.2, 0.3};
  c.gravity_odom_mps2 = {0.01, 0.02, -9.8};
  c.aligned = true;
  c.T_map_odom = {0.3, {1e5 / 3.0, -2.0, 3.0}, {1e-3, 2e-3}};
  c.covariance = Eigen::MatrixXd::Random(21, 21);
  c.drift_covariance = Matrix6d::Random();
  c.distance_m = 123.4;
  c.next_keyframe = 17;
  c.scans_received = static_cast<std::uint64_t>(i);
  c.scans_used = 40;
  c.imu_received = 41;
  c.rows_applied = 42;
  c.rows_refused = 43;
  c.last_row_fix_ns = 44;
  c.reset.counter = 2;
  c.reset.delta.yaw_rad = 0.5;
  c.scans_refused = {{"no_points", 3}, {"imu_gap", 4}};
  return c;
}

StoredRow row(int i) {
  StoredRow r;
  r.update.fix_stamp_ns = i;
  r.update.decision = {AxisDecision::kFused, AxisDecision::kLio, AxisDecision::kCoast};
  r.update.position_map_m = {1.0 / 3.0, 2.0, 3.0};
  r.update.covariance_map_m2 = Eigen::Matrix3d::Random();
  r.update.lever_arm_base_m = {0.1, 0.2, 0.3};
  r.odom_epoch = 3;
  r.applied = i % 2 == 0;
  r.verdict = r.applied ? "applied" : "older_than_history";
  return r;
}

TEST_F(CheckpointStore, gives_back_the_newest_checkpoint_and_every_row) {
  const Checkpoint c = checkpoint(2);
  {
    KeyframeWriter writer(file());
    writer.commit(checkpoint(1), {row(1)}, small_keyframe(1));
    writer.commit(c, {row(2), row(3)}, std::nullopt);
  }
  KeyframeReader reader(file());
  const auto read = reader.checkpoint();
  ASSERT_TRUE(read.has_value());
  EXPECT_EQ(read->stamp_ns, c.stamp_ns);
  EXPECT_EQ(read->odom_epoch, c.odom_epoch);
  EXPECT_EQ(read->T_odom_base.q.coeffs(), c.T_odom_base.q.coeffs());
  EXPECT_EQ(read->T_odom_base.p, c.T_odom_base.p);
  EXPECT_EQ(read->v_odom_mps, c.v_odom_mps);
  EXPECT_EQ(read->gyro_bias_radps, c.gyro_bias_radps);
  EXPECT_EQ(read->accel_bias_mps2, c.accel_bias_mps2);
  EXPECT_EQ(read->gravity_odom_mps2, c.gravity_odom_mps2);
  EXPECT_EQ(read->aligned, c.aligned);
  EXPECT_EQ(read->T_map_odom.p, c.T_map_odom.p);
  EXPECT_EQ(read->T_map_odom.yaw_rad, c.T_map_odom.yaw_rad);
  EXPECT_EQ(read->T_map_odom.tilt_rad, c.T_map_odom.tilt_rad);
  EXPECT_EQ(read->covariance, c.covariance);
  EXPECT_EQ(read->drift_covariance, c.drift_covariance);
  EXPECT_EQ(read->distance_m, c.distance_m);
  EXPECT_EQ(read->next_keyframe, c.next_keyframe);
  EXPECT_EQ(read->scans_received, c.scans_received);
  EXPECT_EQ(read->rows_refused, c.rows_refused);
  EXPECT_EQ(read->last_row_fix_ns, c.last_row_fix_ns);
  EXPECT_EQ(read->reset.counter, c.reset.counter);
  EXPECT_EQ(read->reset.delta.yaw_rad, c.reset.delta.yaw_rad);
  ASSERT_EQ(read->scans_refused.size(), 2U);
  EXPECT_EQ(read->scans_refused[1].name, "imu_gap");
  EXPECT_EQ(read->scans_refused[1].count, 4U);
  int i = 0;
  EXPECT_EQ(reader.visit_rows([&](const StoredRow& r) {
    EXPECT_EQ(r.update.fix_stamp_ns, ++i);
    EXPECT_EQ(r.update.decision[2], AxisDecision::kCoast);
    EXPECT_EQ(r.update.position_map_m, row(i).update.position_map_m);
    EXPECT_EQ(r.applied, i % 2 == 0);
    EXPECT_EQ(r.verdict, row(i).verdict);
  }),
            3U);
}

TEST_F(CheckpointStore, finds_the_keyframes_of_a_place) {
  {
    KeyframeWriter writer(file());
    int stamp = 0;
    for (const int x : {0, 5, 50, 6, 7}) {
      Keyframe k = small_keyframe(x);
      k.stamp_ns = ++stamp;
      writer.append(k);
    }
  }
  KeyframeReader reader(file());
  const auto ids_in = [&](bool recent_stretch) {
    std::vector<std::uint64_t> ids;
    reader.visit({0, Eigen::Vector3d(5.0, 0.0, 0.0), 10.0, recent_stretch},
                 [&](const Keyframe& k) { ids.push_back(k.id); });
    return ids;
  };
  EXPECT_EQ(ids_in(false), (std::vector<std::uint64_t>{0, 5, 6, 7}));
  EXPECT_EQ(ids_in(true), (std::vector<std::uint64_t>{6, 7}));
}

TEST_F(CheckpointStore, tells_a_cloud_in_which_one_byte_changed) {
  {
    KeyframeWriter writer(file());
    writer.append(small_keyframe(1));
  }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file().c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database,
                         "UPDATE keyframes SET points_base = CAST(substr(points_base, 1, "
                         "length(points_base) - 1) || x'5a' AS BLOB)",
                         nullptr,
                         nullptr,
                         nullptr),
            SQLITE_OK);
  sqlite3_close(database);
  EXPECT_THROW(read_keyframes(file(), [](const Keyframe&) {}), std::runtime_error);
}

TEST_F(CheckpointStore, keeps_scans_whole_when_the_writer_is_killed) {
  for (int round = 0; round < 4; ++round) {
    const std::string killed = folder_ / ("killed_" + std::to_string(round));
    std::array<int, 2> pipe{};
    ASSERT_EQ(::pipe(pipe.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
      KeyframeWriter writer(killed);
      for (int i = 0;; ++i) {
        writer.commit(checkpoint(i), {row(i)}, small_keyframe(i));
        if (::write(pipe[1], &i, sizeof i) != sizeof i) {
          _exit(1);
        }
      }
    }
    close(pipe[1]);
    int told = -1;
    while (told < 3 + 11 * round && ::read(pipe[0], &told, sizeof told) == sizeof told) {
    }
    kill(child, SIGKILL);
    waitpid(child, nullptr, 0);
    while (::read(pipe[0], &told, sizeof told) == sizeof told) {
    }
    close(pipe[0]);
    KeyframeReader reader(killed);
    const auto newest = reader.checkpoint();
    ASSERT_TRUE(newest.has_value());
    const auto scans = newest->scans_received + 1;
    EXPECT_GE(scans, static_cast<std::uint64_t>(told) + 1);
    EXPECT_EQ(reader.visit([](const Keyframe&) {}), scans);
    EXPECT_EQ(reader.visit_rows([](const StoredRow&) {}), scans);
  }
}

}  // namespace
}  // namespace trigpoint::lio_mapper
