// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sqlite3.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <vector>

namespace trigpoint::lio_mapper {
namespace {

using ::testing::HasSubstr;

/// A folder of its own for each test, removed afterwards.
class KeyframeStore : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = std::filesystem::temp_directory_path() / "keyframe_store_XXXXXX";
    ASSERT_NE(mkdtemp(pattern.data()), nullptr);
    folder_ = pattern;
  }

  void TearDown() override { std::filesystem::remove_all(folder_); }

  std::string file() const { return folder_ / "keyframes.sqlite"; }

  std::filesystem::path folder_;
};

Keyframe keyframe(int i, int points = 100) {
  Keyframe k;
  k.id = static_cast<std::uint64_t>(i);
  k.stamp_ns = 1'700'000'000'000'000'001 + i * 1'000'000'000LL;
  k.odom_epoch = 4'000'000'000U;
  k.T_odom_base = {Eigen::Quaterniond(0.5, -0.5, 0.5, 0.5), {0.1 * i, 1.0 / 3.0, -7.0}};
  for (int j = 0; j < 36; ++j) {
    k.pose_covariance(j / 6, j % 6) = 0.001 * j + i;
  }
  k.aligned = i % 2 == 1;
  k.T_map_odom = {0.3 + i, {1e5 / 3.0, -2.0, 3.0}};
  for (int j = 0; j < points; ++j) {
    const auto v = static_cast<float>(j) / 3.0F;
    k.points_base.push_back({v, -v, v + static_cast<float>(i), 2.0F * v});
  }
  return k;
}

/// What the stored millimetres leave of a coordinate, and float's own rounding at 1.7 km.
constexpr float kHalfMillimetre_m = 0.0005F + 0.0002F;

void expect_equal(const Keyframe& a, const Keyframe& b) {
  EXPECT_EQ(a.id, b.id);
  EXPECT_EQ(a.stamp_ns, b.stamp_ns);
  EXPECT_EQ(a.odom_epoch, b.odom_epoch);
  EXPECT_EQ(a.T_odom_base.q.coeffs(), b.T_odom_base.q.coeffs());
  EXPECT_EQ(a.T_odom_base.p, b.T_odom_base.p);
  EXPECT_EQ(a.pose_covariance, b.pose_covariance);
  EXPECT_EQ(a.aligned, b.aligned);
  EXPECT_EQ(a.T_map_odom.yaw_rad, b.T_map_odom.yaw_rad);
  EXPECT_EQ(a.T_map_odom.p, b.T_map_odom.p);
  ASSERT_EQ(a.points_base.size(), b.points_base.size());
  for (std::size_t i = 0; i < a.points_base.size(); ++i) {
    EXPECT_LE((a.points_base[i].position() - b.points_base[i].position()).cwiseAbs().maxCoeff(),
              kHalfMillimetre_m);
    EXPECT_EQ(a.points_base[i].intensity, b.points_base[i].intensity);
  }
}

std::vector<Keyframe> read_all(const std::string& file) {
  std::vector<Keyframe> all;
  const std::uint64_t count = read_keyframes(file, [&](const Keyframe& k) { all.push_back(k); });
  EXPECT_EQ(count, all.size());
  return all;
}

/// What reading says when it fails; empty when it does not.
std::string error_of_reading(const std::string& file) {
  try {
    read_keyframes(file, [](const Keyframe&) {});
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr(file));
    return error.what();
  }
  return "";
}

std::string error_of_writing(const std::string& file) {
  try {
    KeyframeWriter writer(file);
    writer.append(keyframe(0));
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), HasSubstr(file));
    return error.what();
  }
  return "";
}

void run_sql(const std::string& file, const std::string& sql) {
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open(file.c_str(), &database), SQLITE_OK);
  EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
      << sqlite3_errmsg(database);
  sqlite3_close(database);
}

void write(const std::string& file, int count) {
  KeyframeWriter writer(file);
  for (int i = 0; i < count; ++i) {
    writer.append(keyframe(i));
  }
}

TEST_F(KeyframeStore, finds_a_keyframe_by_its_place_in_time_and_all_places_without_clouds) {
  {
    KeyframeWriter writer(file());
    for (const int i : {0, 2, 1}) {
      writer.append(keyframe(i));
    }
  }
  KeyframeReader reader(file());
  for (int i = 0; i < 3; ++i) {
    const auto found = reader.at(static_cast<std::size_t>(i));
    ASSERT_TRUE(found.has_value());
    expect_equal(*found, keyframe(i));
  }
  EXPECT_FALSE(reader.at(3).has_value());
  std::vector<Keyframe> places;
  EXPECT_EQ(reader.visit_places([&](const Keyframe& k) { places.push_back(k); }), 3U);
  ASSERT_EQ(places.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    expect_equal(places[static_cast<std::size_t>(i)], keyframe(i, 0));
  }
}

TEST_F(KeyframeStore, gives_back_what_was_written_clouds_to_half_a_millimetre) {
  write(file(), 5);
  const auto all = read_all(file());
  ASSERT_EQ(all.size(), 5U);
  for (int i = 0; i < 5; ++i) {
    expect_equal(all[static_cast<std::size_t>(i)], keyframe(i));
  }
}

TEST_F(KeyframeStore, keeps_a_keyframe_without_points) {
  {
    KeyframeWriter writer(file());
    writer.append(keyframe(1, 0));
  }
  expect_equal(read_all(file()).at(0), keyframe(1, 0));
}

TEST_F(KeyframeStore, is_read_in_order_of_time) {
  {
    KeyframeWriter writer(file());
    for (const int i : {3, 0, 2, 1}) {
      writer.append(keyframe(i));
    }
  }
  const auto all = read_all(file());
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(all.at(i).id, i);
  }
}

TEST_F(KeyframeStore, is_continued_by_a_mapper_that_was_started_again_and_counts_from_zero) {
  write(file(), 3);
  write(file(), 2);
  EXPECT_EQ(read_all(file()).size(), 5U);
}

TEST_F(KeyframeStore, can_be_read_while_it_is_written) {
  KeyframeWriter writer(file());
  for (int i = 0; i < 10; ++i) {
    writer.append(keyframe(i));
    EXPECT_EQ(read_all(file()).size(), static_cast<std::size_t>(i + 1));
  }
}

/// Writes until it is killed; tells through the pipe how many keyframes append() has returned from.
[[noreturn]] void write_for_ever(const std::string& file, int pipe) {
  KeyframeWriter writer(file);
  for (int i = 0;; ++i) {
    writer.append(keyframe(i, 5000));
    if (::write(pipe, &i, sizeof i) != sizeof i) {
      _exit(1);
    }
  }
}

/// The last number that the child told before it was killed, after at least `least` keyframes.
int kill_writer_after(const std::string& file, int least) {
  std::array<int, 2> pipe{};
  if (::pipe(pipe.data()) != 0) {
    return -1;
  }
  const pid_t child = fork();
  if (child == 0) {
    close(pipe[0]);
    write_for_ever(file, pipe[1]);
  }
  close(pipe[1]);
  int last = -1;
  int told = -1;
  while (last < least && ::read(pipe[0], &told, sizeof told) == sizeof told) {
    last = told;
  }
  kill(child, SIGKILL);
  int status = 0;
  waitpid(child, &status, 0);
  while (::read(pipe[0], &told, sizeof told) == sizeof told) {
    last = told;
  }
  close(pipe[0]);
  return WIFSIGNALED(status) ? last : -1;
}

TEST_F(KeyframeStore, keeps_what_was_appended_when_the_writer_is_killed) {
  for (const int least : {0, 3, 17, 40}) {
    const std::string killed = folder_ / ("killed_" + std::to_string(least));
    const int last = kill_writer_after(killed, least);
    ASSERT_GE(last, least);
    const auto all = read_all(killed);
    // The row that was being written when the signal came may or may not be there.
    ASSERT_GE(all.size(), static_cast<std::size_t>(last) + 1);
    ASSERT_LE(all.size(), static_cast<std::size_t>(last) + 2);
    for (std::size_t i = 0; i < all.size(); ++i) {
      expect_equal(all[i], keyframe(static_cast<int>(i), 5000));
    }
    write(killed, 1);
    EXPECT_EQ(read_all(killed).size(), all.size() + 1);
  }
}

TEST_F(KeyframeStore, appends_in_milliseconds) {
  constexpr int kCount = 200;
  constexpr double kMost_ms = 20.0;  // 1 ms is usual; the machine may be busy
  const Keyframe k = keyframe(0, 5000);
  KeyframeWriter writer(file());
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < kCount; ++i) {
    writer.append(k);
  }
  const std::chrono::duration<double, std::milli> taken = std::chrono::steady_clock::now() - begin;
  RecordProperty("append_us", static_cast<int>(1000.0 * taken.count() / kCount));
  EXPECT_LT(taken.count() / kCount, kMost_ms);
}

TEST_F(KeyframeStore, names_a_missing_file_and_does_not_create_it) {
  EXPECT_THAT(error_of_reading(file()), HasSubstr("no such file"));
  EXPECT_FALSE(std::filesystem::exists(file()));
}

TEST_F(KeyframeStore, refuses_what_is_no_database) {
  std::ofstream(file()) << std::string(5000, 'x');
  EXPECT_THAT(error_of_reading(file()), HasSubstr("not a database"));
  EXPECT_THAT(error_of_writing(file()), HasSubstr("not a database"));
}

std::string hex_of(const void* data, std::size_t size) {
  constexpr const char* kDigits = "0123456789abcdef";
  std::string hex = "x'";
  for (std::size_t i = 0; i < size; ++i) {
    const auto byte = static_cast<const unsigned char*>(data)[i];
    hex += {kDigits[byte >> 4U], kDigits[byte & 15U]};
  }
  return hex + "'";
}

/// A store as programs wrote it before clouds were packed: KEYFRAMES.md, version 3.
void write_version_3(const std::string& file, const std::vector<Keyframe>& keyframes) {
  run_sql(file,
          "CREATE TABLE keyframes(row INTEGER PRIMARY KEY, id INTEGER NOT NULL, "
          "stamp_ns INTEGER NOT NULL, odom_epoch INTEGER NOT NULL, T_odom_base BLOB NOT NULL, "
          "pose_covariance BLOB NOT NULL, aligned INTEGER NOT NULL, T_map_odom BLOB NOT NULL, "
          "points_base BLOB NOT NULL); PRAGMA user_version=3;");
  for (const Keyframe& k : keyframes) {
    const Pose& T = k.T_odom_base;
    const std::array<double, 7> pose{T.p.x(), T.p.y(), T.p.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
    const YawPose& Y = k.T_map_odom;
    const std::array<double, 6> yaw_pose{
        Y.yaw_rad, Y.p.x(), Y.p.y(), Y.p.z(), Y.tilt_rad.x(), Y.tilt_rad.y()};
    std::vector<float> points;
    for (const PointXyzi& p : k.points_base) {
      points.insert(points.end(), {p.x, p.y, p.z, p.intensity});
    }
    run_sql(file,
            "INSERT INTO keyframes(id, stamp_ns, odom_epoch, T_odom_base, pose_covariance, "
            "aligned, T_map_odom, points_base) VALUES(" +
                std::to_string(k.id) + "," + std::to_string(k.stamp_ns) + "," +
                std::to_string(k.odom_epoch) + "," + hex_of(pose.data(), sizeof pose) + "," +
                hex_of(k.pose_covariance.data(), 36 * sizeof(double)) + "," +
                (k.aligned ? "1" : "0") + "," + hex_of(yaw_pose.data(), sizeof yaw_pose) + "," +
                hex_of(points.data(), points.size() * sizeof(float)) + ")");
  }
}

TEST_F(KeyframeStore, of_format_3_is_read_whole_but_neither_resumed_nor_continued) {
  write_version_3(file(), {keyframe(0), keyframe(1), keyframe(2)});
  const auto all = read_all(file());
  ASSERT_EQ(all.size(), 3U);
  for (int i = 0; i < 3; ++i) {
    expect_equal(all[static_cast<std::size_t>(i)], keyframe(i));
  }
  KeyframeReader reader(file());
  EXPECT_EQ(reader.at(1)->id, 1U);
  EXPECT_EQ(reader.visit_places([](const Keyframe&) {}), 3U);
  EXPECT_EQ(reader.visit_rows([](const StoredRow&) {}), 0U);
  EXPECT_FALSE(reader.checkpoint().has_value());
  EXPECT_EQ(reader.cloud_sizes().points, 300U);
  EXPECT_DOUBLE_EQ(reader.cloud_sizes().ratio(), 1.0);
  EXPECT_THAT(error_of_writing(file()), HasSubstr("can be read, but a new session needs"));
  EXPECT_EQ(read_all(file()).size(), 3U);
}

TEST_F(KeyframeStore, tells_what_its_clouds_take_on_disk) {
  write(file(), 3);
  const CloudSizes sizes = KeyframeReader(file()).cloud_sizes();
  EXPECT_EQ(sizes.keyframes, 3U);
  EXPECT_EQ(sizes.points, 300U);
  EXPECT_EQ(sizes.raw_bytes(), 300U * 16U);
  EXPECT_GT(sizes.bytes, 0U);
  EXPECT_LT(sizes.ratio(), 1.0);
}

TEST_F(KeyframeStore, refuses_another_format_version) {
  write(file(), 1);
  run_sql(file(), "PRAGMA user_version=77");
  EXPECT_THAT(error_of_reading(file()), HasSubstr("format version 77, this program reads 3 to 5"));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder_), {}), 1)
      << "nothing is left";
  EXPECT_THAT(error_of_writing(file()), HasSubstr("format version 77"));
}

TEST_F(KeyframeStore, refuses_a_database_of_another_program_and_leaves_it_alone) {
  run_sql(file(), "CREATE TABLE messages(id INTEGER)");
  EXPECT_THAT(error_of_writing(file()), HasSubstr("database of another program"));
  EXPECT_THAT(error_of_reading(file()), HasSubstr("format version 0"));
}

TEST_F(KeyframeStore, refuses_a_truncated_file) {
  write(file(), 50);
  std::filesystem::resize_file(file(), std::filesystem::file_size(file()) / 2);
  EXPECT_THAT(error_of_reading(file()), HasSubstr("malformed"));
}

TEST_F(KeyframeStore, refuses_blobs_of_the_wrong_length) {
  write(file(), 1);
  run_sql(file(), "UPDATE keyframes SET points_base = x'00112233'");
  EXPECT_THAT(error_of_reading(file()),
              HasSubstr("points_base of keyframe 0 does not hold the 857870592 points"));
  run_sql(file(), "UPDATE keyframes SET T_odom_base = x''");
  EXPECT_THAT(error_of_reading(file()), HasSubstr("T_odom_base has 0 bytes, 56 expected"));
}

TEST_F(KeyframeStore, refuses_a_pose_that_is_not_finite) {
  {
    KeyframeWriter writer(file());
    Keyframe broken = keyframe(9);
    broken.T_odom_base.p.x() = kNaN;
    writer.append(broken);
  }
  EXPECT_THAT(error_of_reading(file()), HasSubstr("keyframe 9 has a pose that is not finite"));
}

TEST_F(KeyframeStore, names_a_folder_that_cannot_be_written) {
  EXPECT_THAT(error_of_writing(folder_ / "missing" / "keyframes.sqlite"),
              HasSubstr("unable to open"));
}

/// Takes the right to write from a folder and its files, for root too.
class ReadOnly {
 public:
  explicit ReadOnly(const std::filesystem::path& folder) : folder_(folder) {
    set(0444, 0555);
    if (geteuid() == 0) {
      constexpr uid_t kNobody = 65534;
      is_nobody_ = seteuid(kNobody) == 0;
    }
  }

  ~ReadOnly() {
    if (is_nobody_ && seteuid(0) != 0) {
      std::abort();
    }
    set(0644, 0755);
  }

  ReadOnly(const ReadOnly&) = delete;
  ReadOnly& operator=(const ReadOnly&) = delete;

 private:
  void set(unsigned files, unsigned folder) const {
    namespace fs = std::filesystem;
    for (const auto& entry : fs::directory_iterator(folder_)) {
      fs::permissions(entry.path(), fs::perms{files});
    }
    fs::permissions(folder_, fs::perms{folder});
  }

  std::filesystem::path folder_;
  bool is_nobody_{false};
};

TEST_F(KeyframeStore, is_read_where_nobody_may_write) {
  const std::filesystem::path odd = folder_ / "100%?#";
  std::filesystem::permissions(folder_, std::filesystem::perms{0755});
  std::filesystem::create_directory(odd);
  {
    KeyframeWriter writer(odd / "keyframes.sqlite");
    writer.append(keyframe(1));
  }
  const ReadOnly read_only(odd);
  EXPECT_NE(error_of_writing(odd / "keyframes.sqlite"), "");
  std::vector<Keyframe> read;
  KeyframeReader(odd / "keyframes.sqlite").visit([&](const Keyframe& k) { read.push_back(k); });
  ASSERT_EQ(read.size(), 1U);
  expect_equal(read.front(), keyframe(1));
  EXPECT_EQ(std::distance(std::filesystem::directory_iterator(odd), {}), 1) << "nothing is left";
}

std::string bytes_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// What a killed writer had in its log is read, and stays there.
TEST_F(KeyframeStore, is_not_changed_by_a_reader_after_its_writer_was_killed) {
  const std::filesystem::path left = folder_ / "left";
  std::filesystem::create_directory(left);
  {
    KeyframeWriter writer(file());
    writer.append(keyframe(1));
    for (const char* name : {"keyframes.sqlite", "keyframes.sqlite-wal"}) {  // as a kill leaves it
      std::filesystem::copy_file(folder_ / name, left / name);
    }
  }
  const std::string store = bytes_of(left / "keyframes.sqlite");
  const std::string log = bytes_of(left / "keyframes.sqlite-wal");
  ASSERT_FALSE(log.empty());
  EXPECT_EQ(KeyframeReader(left / "keyframes.sqlite").visit([](const Keyframe&) {}), 1U);
  EXPECT_TRUE(store == bytes_of(left / "keyframes.sqlite"));
  EXPECT_TRUE(log == bytes_of(left / "keyframes.sqlite-wal"));
}

/// The reader is the last to close the store then.
TEST_F(KeyframeStore, is_not_changed_by_a_reader_while_whose_reading_a_writer_came_and_was_killed) {
  { KeyframeWriter(file()).append(keyframe(1)); }
  std::array<int, 2> begin{};
  ASSERT_EQ(::pipe(begin.data()), 0);
  const pid_t writer = ::fork();  // before anything is open: SQLite must not be carried along
  ASSERT_GE(writer, 0);
  if (writer == 0) {
    char any = 0;
    const bool begins = ::read(begin[0], &any, 1) == 1;
    KeyframeWriter killed(file());
    killed.append(keyframe(2));
    ::_exit(begins ? 0 : 1);  // as a kill: nothing is closed
  }
  std::string store;
  {
    KeyframeReader reader(file());
    EXPECT_EQ(reader.visit([](const Keyframe&) {}), 1U);
    store = bytes_of(file());
    ASSERT_EQ(::write(begin[1], "b", 1), 1);
    int status = -1;
    ASSERT_EQ(::waitpid(writer, &status, 0), writer);
    ASSERT_EQ(status, 0);
    EXPECT_EQ(reader.visit([](const Keyframe&) {}), 2U);
  }
  ::close(begin[0]);
  ::close(begin[1]);
  EXPECT_TRUE(store == bytes_of(file()));
  EXPECT_FALSE(bytes_of(folder_ / "keyframes.sqlite-wal").empty());
}

TEST_F(KeyframeStore, has_nothing_beside_it_when_it_was_read_after_its_writer_ended) {
  { KeyframeWriter(file()).append(keyframe(1)); }
  EXPECT_EQ(KeyframeReader(file()).visit([](const Keyframe&) {}), 1U);
  EXPECT_FALSE(std::filesystem::exists(folder_ / "keyframes.sqlite-wal"));
  EXPECT_FALSE(std::filesystem::exists(folder_ / "keyframes.sqlite-shm"));
}

}  // namespace
}  // namespace trigpoint::lio_mapper
