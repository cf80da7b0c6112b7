// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include <sqlite3.h>

#include <array>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <vector>

namespace trigpoint::lio_mapper {

namespace {

constexpr int kFormatVersion = 3;   // PRAGMA user_version
constexpr int kBusy_ms = 5000;      // one may read while another writes
constexpr int kPoseNumbers = 7;     // x y z qx qy qz qw
constexpr int kYawPoseNumbers = 6;  // yaw x y z tilt_x tilt_y

constexpr const char* kSchema =
    "CREATE TABLE IF NOT EXISTS keyframes("
    " row INTEGER PRIMARY KEY, id INTEGER NOT NULL, stamp_ns INTEGER NOT NULL,"
    " odom_epoch INTEGER NOT NULL,"
    " T_odom_base BLOB NOT NULL, pose_covariance BLOB NOT NULL,"
    " aligned INTEGER NOT NULL, T_map_odom BLOB NOT NULL, points_base BLOB NOT NULL);";

class Database {
 public:
  Database(const std::string& file, int flags) : file_(file) {
    const int code = sqlite3_open_v2(file.c_str(), &handle_, flags, nullptr);
    if (code != SQLITE_OK) {
      const std::string cause = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
      sqlite3_close(handle_);
      throw std::runtime_error(file_ + ": cannot be opened as a keyframe store: " + cause);
    }
    sqlite3_busy_timeout(handle_, kBusy_ms);
  }

  ~Database() { sqlite3_close(handle_); }

  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void run(const std::string& sql) {
    if (sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
      fail();
    }
  }

  [[noreturn]] void fail() const {
    throw std::runtime_error(file_ + ": keyframe store: " + sqlite3_errmsg(handle_));
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(file_ + ": keyframe store: " + what);
  }

  sqlite3* handle() const { return handle_; }

 private:
  std::string file_;
  sqlite3* handle_{nullptr};
};

class Statement {
 public:
  Statement(Database& database, const std::string& sql) : database_(database) {
    if (sqlite3_prepare_v2(database.handle(), sql.c_str(), -1, &handle_, nullptr) != SQLITE_OK) {
      database_.fail();
    }
  }

  ~Statement() { sqlite3_finalize(handle_); }

  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  void bind(int column, std::int64_t value) { sqlite3_bind_int64(handle_, column, value); }

  /// The bytes must live until the statement was stepped.
  void bind_bytes(int column, const void* data, std::size_t size) {
    sqlite3_bind_blob64(handle_, column, size > 0 ? data : "", size, SQLITE_STATIC);
  }

  /// True while there is a row.
  bool step() {
    const int code = sqlite3_step(handle_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) {
      database_.fail();
    }
    return code == SQLITE_ROW;
  }

  void reset() {
    sqlite3_reset(handle_);
    sqlite3_clear_bindings(handle_);
  }

  std::int64_t integer(int column) const { return sqlite3_column_int64(handle_, column); }

  std::size_t size(int column) const {
    return static_cast<std::size_t>(sqlite3_column_bytes(handle_, column));
  }

  [[noreturn]] void fail(const std::string& what) const { database_.fail(what); }

  /// Copies a blob that must have exactly `size` bytes.
  void copy(int column, void* to, std::size_t size) const {
    if (this->size(column) != size) {
      database_.fail("column " + std::string(sqlite3_column_name(handle_, column)) + " has " +
                     std::to_string(this->size(column)) + " bytes, " + std::to_string(size) +
                     " expected");
    }
    if (size > 0) {
      std::memcpy(to, sqlite3_column_blob(handle_, column), size);
    }
  }

 private:
  Database& database_;
  sqlite3_stmt* handle_{nullptr};
};

std::array<double, kPoseNumbers> numbers_of(const Pose& T) {
  return {T.p.x(), T.p.y(), T.p.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
}

Pose pose_of(const std::array<double, kPoseNumbers>& n) {
  return {Eigen::Quaterniond(n[6], n[3], n[4], n[5]), {n[0], n[1], n[2]}};
}

std::int64_t version_of(Database& database) {
  Statement statement(database, "PRAGMA user_version");
  statement.step();
  return statement.integer(0);
}

bool has_tables(Database& database) {
  Statement statement(database, "SELECT name FROM sqlite_master WHERE type = 'table'");
  return statement.step();
}

void check_version(Database& database) {
  const std::int64_t version = version_of(database);
  if (version != kFormatVersion) {
    database.fail("has format version " + std::to_string(version) + ", this program reads " +
                  std::to_string(kFormatVersion));
  }
}

Keyframe keyframe_of(const Statement& row) {
  Keyframe keyframe;
  keyframe.id = static_cast<std::uint64_t>(row.integer(0));
  keyframe.stamp_ns = row.integer(1);
  keyframe.odom_epoch = static_cast<std::uint32_t>(row.integer(2));
  std::array<double, kPoseNumbers> pose{};
  row.copy(3, pose.data(), sizeof pose);
  keyframe.T_odom_base = pose_of(pose);
  row.copy(4, keyframe.pose_covariance.data(), sizeof(double) * 36);
  keyframe.aligned = row.integer(5) != 0;
  std::array<double, kYawPoseNumbers> yaw_pose{};
  row.copy(6, yaw_pose.data(), sizeof yaw_pose);
  keyframe.T_map_odom = {
      yaw_pose[0], {yaw_pose[1], yaw_pose[2], yaw_pose[3]}, {yaw_pose[4], yaw_pose[5]}};
  keyframe.points_base.resize(row.size(7) / sizeof(PointXyzi));
  row.copy(7, keyframe.points_base.data(), keyframe.points_base.size() * sizeof(PointXyzi));
  if (!keyframe.T_odom_base.is_finite() || !keyframe.T_map_odom.pose().is_finite()) {
    row.fail("keyframe " + std::to_string(keyframe.id) + " has a pose that is not finite");
  }
  return keyframe;
}

}  // namespace

struct KeyframeWriter::Impl {
  explicit Impl(const std::string& file)
      : database(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE), insert(prepare()) {}

  /// Write-ahead log: a killed writer loses at most the row that it was writing. NORMAL leaves the
  /// flush to the disk to the system, which only a power cut can exploit.
  Statement& prepare() {
    if (version_of(database) == 0) {
      create();
    }
    check_version(database);
    database.run("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL;");
    statement = std::make_unique<Statement>(
        database,
        "INSERT INTO keyframes(id, stamp_ns, odom_epoch, T_odom_base, pose_covariance, aligned, "
        "T_map_odom, points_base) VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)");
    return *statement;
  }

  /// In one transaction, so that no death leaves tables without a version.
  void create() {
    if (has_tables(database)) {
      database.fail("is a database of another program, it has tables but no format version");
    }
    database.run(std::string("BEGIN IMMEDIATE; ") + kSchema +
                 " PRAGMA user_version=" + std::to_string(kFormatVersion) + "; COMMIT;");
  }

  Database database;
  std::unique_ptr<Statement> statement;
  Statement& insert;
};

KeyframeWriter::KeyframeWriter(const std::string& file) : impl_(std::make_unique<Impl>(file)) {}

KeyframeWriter::~KeyframeWriter() = default;

void KeyframeWriter::append(const Keyframe& keyframe) {
  const std::array<double, kPoseNumbers> pose = numbers_of(keyframe.T_odom_base);
  const std::array<double, kYawPoseNumbers> yaw_pose{keyframe.T_map_odom.yaw_rad,
                                                     keyframe.T_map_odom.p.x(),
                                                     keyframe.T_map_odom.p.y(),
                                                     keyframe.T_map_odom.p.z(),
                                                     keyframe.T_map_odom.tilt_rad.x(),
                                                     keyframe.T_map_odom.tilt_rad.y()};
  Statement& insert = impl_->insert;
  insert.reset();
  insert.bind(1, static_cast<std::int64_t>(keyframe.id));
  insert.bind(2, keyframe.stamp_ns);
  insert.bind(3, keyframe.odom_epoch);
  insert.bind_bytes(4, pose.data(), sizeof pose);
  insert.bind_bytes(5, keyframe.pose_covariance.data(), sizeof(double) * 36);
  insert.bind(6, keyframe.aligned ? 1 : 0);
  insert.bind_bytes(7, yaw_pose.data(), sizeof yaw_pose);
  insert.bind_bytes(
      8, keyframe.points_base.data(), keyframe.points_base.size() * sizeof(PointXyzi));
  insert.step();
  insert.reset();
}

std::uint64_t read_keyframes(const std::string& file,
                             const std::function<void(const Keyframe&)>& visit) {
  if (!std::filesystem::exists(file)) {
    throw std::runtime_error(file + ": keyframe store: no such file");
  }
  Database database(file, SQLITE_OPEN_READWRITE);
  check_version(database);
  Statement rows(database,
                 "SELECT id, stamp_ns, odom_epoch, T_odom_base, pose_covariance, aligned, "
                 "T_map_odom, points_base FROM keyframes ORDER BY stamp_ns, row");
  std::uint64_t count = 0;
  while (rows.step()) {
    visit(keyframe_of(rows));
    ++count;
  }
  return count;
}

}  // namespace trigpoint::lio_mapper
