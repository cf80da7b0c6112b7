// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/point_cloud.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "point_codec.hpp"
#include "store_format.hpp"
#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <utility>

namespace trigpoint::lio_mapper {

namespace {

namespace fs = std::filesystem;

constexpr const char* kColumns =
    "SELECT id, stamp_ns, odom_epoch, T_odom_base, pose_covariance, aligned, T_map_odom, "
    "points_base FROM keyframes ";

/// A blob that nobody asks for stays on the disk.
enum class Clouds { kRead, kLeave };

bool may_write(const fs::path& path) {
  return ::faccessat(AT_FDCWD, path.c_str(), W_OK, AT_EACCESS) == 0;
}

/// SQLite reads a store with a write-ahead log only where it may make files beside it; one that
/// nobody can have open for writing it reads as it is.
std::string uri_of_unchanging(const std::string& file) {
  std::string uri = "file:";
  for (const char c : fs::absolute(file).string()) {
    uri += c == '%' ? "%25" : c == '?' ? "%3f" : c == '#' ? "%23" : std::string(1, c);
  }
  return uri + "?immutable=1";
}

bool has_log(const std::string& file) {
  const std::string log = file + "-wal";
  std::error_code none;
  return fs::exists(log, none) && fs::file_size(log, none) > 0;
}

/// Also on a disk that is read-only, or of another user.
Database opened(const std::string& file) {
  if (!fs::exists(file)) {
    throw std::runtime_error(file + ": keyframe store: no such file");
  }
  if (may_write(file) && may_write(fs::absolute(file).parent_path())) {
    return {file, SQLITE_OPEN_READWRITE};
  }
  if (has_log(file)) {
    return {file, SQLITE_OPEN_READONLY};  // somebody writes, or was killed while writing
  }
  return {file, SQLITE_OPEN_READONLY | SQLITE_OPEN_URI, uri_of_unchanging(file)};
}

/// Who reads changes nothing, a store that it refuses neither. To be gone before the database is.
class UntouchedLog {
 public:
  UntouchedLog(std::string file, Database& database) : file_(std::move(file)), database_(database) {
    database_.leave_log();
  }

  /// Asked at the end: a writer may have come and been killed in between.
  ~UntouchedLog() {
    if (!has_log(file_)) {
      database_.remove_log();
    }
  }

  UntouchedLog(const UntouchedLog&) = delete;
  UntouchedLog& operator=(const UntouchedLog&) = delete;

 private:
  std::string file_;
  Database& database_;
};

PointCloud raw_points(const Statement& row, int column) {
  PointCloud points(row.size(column) / sizeof(PointXyzi));
  row.copy(column, points.data(), points.size() * sizeof(PointXyzi));
  return points;
}

}  // namespace

struct KeyframeReader::Impl {
  explicit Impl(const std::string& path) : database(opened(path)), log(path, database) {
    version = store::version_of(database);
    if (version < store::kRawPointsVersion || version > store::kFormatVersion) {
      database.fail("has format version " + std::to_string(version) + ", this program reads " +
                    std::to_string(store::kRawPointsVersion) + " to " +
                    std::to_string(store::kFormatVersion));
    }
  }

  bool has_all() const { return version > store::kRawPointsVersion; }

  PointCloud points_of(const Statement& row, std::uint64_t id) const {
    if (!has_all()) {
      return raw_points(row, 7);
    }
    try {
      return unpack_points(row.blob(7), row.size(7));
    } catch (const std::runtime_error& error) {
      row.fail("points_base of keyframe " + std::to_string(id) + " " + error.what());
    }
  }

  Keyframe keyframe_of(const Statement& row, Clouds clouds = Clouds::kRead) const {
    Keyframe keyframe;
    keyframe.id = static_cast<std::uint64_t>(row.integer(0));
    keyframe.stamp_ns = row.integer(1);
    keyframe.odom_epoch = static_cast<std::uint32_t>(row.integer(2));
    store::PoseNumbers pose{};
    row.copy(3, pose.data(), sizeof pose);
    keyframe.T_odom_base = store::pose_of(pose);
    row.copy(4, keyframe.pose_covariance.data(), sizeof(double) * 36);
    keyframe.aligned = row.integer(5) != 0;
    store::YawPoseNumbers yaw_pose{};
    row.copy(6, yaw_pose.data(), sizeof yaw_pose);
    keyframe.T_map_odom = store::yaw_pose_of(yaw_pose);
    if (clouds == Clouds::kRead) {
      keyframe.points_base = points_of(row, keyframe.id);
    }
    if (!keyframe.T_odom_base.is_finite() || !keyframe.T_map_odom.pose().is_finite()) {
      row.fail("keyframe " + std::to_string(keyframe.id) + " has a pose that is not finite");
    }
    return keyframe;
  }

  /// Row numbers, from an index alone: no cloud is touched.
  std::vector<std::int64_t> rows_in(const MapRegion& region) {
    const auto inside = [&](double x, double y) {
      return std::abs(x - region.center_odom_m.x()) <= region.half_side_m &&
             std::abs(y - region.center_odom_m.y()) <= region.half_side_m;
    };
    std::vector<std::int64_t> rows;
    Statement found(database,
                    std::string("SELECT row, x_odom_m, y_odom_m FROM keyframes "
                                "WHERE odom_epoch = ?1 ") +
                        (region.recent_stretch ? "ORDER BY stamp_ns DESC, row DESC"
                                               : "AND x_odom_m BETWEEN ?2 AND ?3 "
                                                 "ORDER BY stamp_ns DESC, row DESC"));
    found.bind(1, region.odom_epoch);
    if (!region.recent_stretch) {
      found.bind_number(2, region.center_odom_m.x() - region.half_side_m);
      found.bind_number(3, region.center_odom_m.x() + region.half_side_m);
    }
    while (found.step()) {
      if (inside(found.number(1), found.number(2))) {
        rows.push_back(found.integer(0));
      } else if (region.recent_stretch) {
        break;
      }
    }
    std::reverse(rows.begin(), rows.end());
    return rows;
  }

  StoredRow row_of(const Statement& s) const {
    StoredRow row;
    row.update.fix_stamp_ns = s.integer(0);
    row.odom_epoch = static_cast<std::uint32_t>(s.integer(1));
    row.update.mode = s.integer(2) == 0 ? UpdateMode::kRows : UpdateMode::kOverwrite;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      row.update.decision[axis] = static_cast<AxisDecision>(s.integer(3 + static_cast<int>(axis)));
    }
    s.copy(6, row.update.position_map_m.data(), sizeof(double) * 3);
    s.copy(7, row.update.covariance_map_m2.data(), sizeof(double) * 9);
    s.copy(8, row.update.lever_arm_base_m.data(), sizeof(double) * 3);
    row.applied = s.integer(9) != 0;
    row.verdict = s.text(10);
    return row;
  }

  static void copy_covariance(const Statement& s, int column, Eigen::MatrixXd& covariance) {
    const auto size = static_cast<Eigen::Index>(
        std::lround(std::sqrt(static_cast<double>(s.size(column) / sizeof(double)))));
    covariance.resize(size, size);
    s.copy(column, covariance.data(), sizeof(double) * static_cast<std::size_t>(size * size));
  }

  Checkpoint checkpoint_of(const Statement& s) const {
    Checkpoint c;
    c.stamp_ns = s.integer(0);
    c.odom_epoch = static_cast<std::uint32_t>(s.integer(1));
    c.aligned = s.integer(2) != 0;
    c.distance_m = s.number(3);
    std::uint64_t* const counts[] = {&c.next_keyframe,
                                     &c.scans_received,
                                     &c.scans_used,
                                     &c.imu_received,
                                     &c.rows_applied,
                                     &c.rows_refused};
    int column = 4;
    for (std::uint64_t* count : counts) {
      *count = static_cast<std::uint64_t>(s.integer(column++));
    }
    c.last_row_fix_ns = s.integer(10);
    c.reset.counter = static_cast<std::uint32_t>(s.integer(11));
    c.scans_refused = store::counts_of(s.text(12));
    store::StateNumbers state{};
    s.copy(13, state.data(), sizeof state);
    store::set_state(state, c);
    copy_covariance(s, 14, c.covariance);
    s.copy(15, c.drift_covariance.data(), sizeof(double) * 36);
    const bool finite = std::all_of(
        state.begin(), state.end(), [](double number) { return std::isfinite(number); });
    if (!finite || !c.covariance.allFinite() || !c.drift_covariance.allFinite()) {
      s.fail("the checkpoint holds a number that is not finite");
    }
    return c;
  }

  /// The small columns alone: clouds lie in pages of their own.
  void look_up_order() {
    order.emplace();
    Statement found(database, "SELECT row FROM keyframes ORDER BY stamp_ns, row");
    while (found.step()) {
      order->push_back(found.integer(0));
    }
  }

  Database database;
  UntouchedLog log;
  std::int64_t version{0};
  std::optional<std::vector<std::int64_t>> order;  ///< row numbers by time
};

KeyframeReader::KeyframeReader(const std::string& file) : impl_(std::make_unique<Impl>(file)) {}

KeyframeReader::~KeyframeReader() = default;

std::uint64_t KeyframeReader::visit(const std::function<void(const Keyframe&)>& visit) {
  Statement rows(impl_->database, std::string(kColumns) + "ORDER BY stamp_ns, row");
  std::uint64_t count = 0;
  while (rows.step()) {
    visit(impl_->keyframe_of(rows));
    ++count;
  }
  return count;
}

std::uint64_t KeyframeReader::visit_places(const std::function<void(const Keyframe&)>& visit) {
  // Sorting must not carry the clouds along.
  Statement rows(impl_->database,
                 "SELECT id, stamp_ns, odom_epoch, T_odom_base, pose_covariance, aligned, "
                 "T_map_odom, NULL FROM keyframes ORDER BY stamp_ns, row");
  std::uint64_t count = 0;
  while (rows.step()) {
    visit(impl_->keyframe_of(rows, Clouds::kLeave));
    ++count;
  }
  return count;
}

std::uint64_t KeyframeReader::visit(const MapRegion& region,
                                    const std::function<void(const Keyframe&)>& visit) {
  if (!impl_->has_all()) {
    impl_->database.fail("has format version 3, whose keyframes cannot be found by place");
  }
  const std::vector<std::int64_t> rows = impl_->rows_in(region);
  Statement one(impl_->database, std::string(kColumns) + "WHERE row = ?1");
  for (const std::int64_t row : rows) {
    one.reset();
    one.bind(1, row);
    if (one.step()) {
      visit(impl_->keyframe_of(one));
    }
  }
  return rows.size();
}

std::optional<Keyframe> KeyframeReader::at(std::size_t place) {
  if (!impl_->order) {
    impl_->look_up_order();
  }
  if (place >= impl_->order->size()) {
    return std::nullopt;
  }
  Statement one(impl_->database, std::string(kColumns) + "WHERE row = ?1");
  one.bind(1, (*impl_->order)[place]);
  return one.step() ? std::optional(impl_->keyframe_of(one)) : std::nullopt;
}

std::uint64_t KeyframeReader::visit_rows(const std::function<void(const StoredRow&)>& visit) {
  if (!impl_->has_all()) {
    return 0;
  }
  Statement rows(impl_->database,
                 "SELECT fix_stamp_ns, odom_epoch, mode, decision_x, decision_y, decision_z, "
                 "position_map, covariance_map, lever_arm_base, applied, verdict "
                 "FROM gps_rows ORDER BY row");
  std::uint64_t count = 0;
  while (rows.step()) {
    visit(impl_->row_of(rows));
    ++count;
  }
  return count;
}

std::optional<Checkpoint> KeyframeReader::checkpoint() {
  if (impl_->version != store::kFormatVersion) {
    return std::nullopt;
  }
  Statement newest(impl_->database,
                   "SELECT stamp_ns, odom_epoch, aligned, distance_m, next_keyframe, "
                   "scans_received, scans_used, imu_received, rows_applied, rows_refused, "
                   "last_row_fix_ns, reset_counter, scans_refused, state, covariance, "
                   "drift_covariance FROM checkpoint");
  return newest.step() ? std::optional(impl_->checkpoint_of(newest)) : std::nullopt;
}

CloudSizes KeyframeReader::cloud_sizes() {
  Statement clouds(impl_->database, "SELECT points_base, id FROM keyframes");
  CloudSizes sizes;
  while (clouds.step()) {
    ++sizes.keyframes;
    sizes.bytes += clouds.size(0);
    if (!impl_->has_all()) {
      sizes.points += clouds.size(0) / sizeof(PointXyzi);
      continue;
    }
    try {
      sizes.points += packed_count(clouds.blob(0), clouds.size(0));
    } catch (const std::exception& error) {
      clouds.fail("points_base of keyframe " + std::to_string(clouds.integer(1)) + ": " +
                  error.what());
    }
  }
  return sizes;
}

std::optional<Pose> KeyframeReader::first_pose(std::uint32_t odom_epoch) {
  Statement first(impl_->database,
                  "SELECT T_odom_base FROM keyframes WHERE odom_epoch = ?1 "
                  "ORDER BY stamp_ns, row LIMIT 1");
  first.bind(1, odom_epoch);
  if (!first.step()) {
    return std::nullopt;
  }
  store::PoseNumbers pose{};
  first.copy(0, pose.data(), sizeof pose);
  return store::pose_of(pose);
}

std::uint64_t read_keyframes(const std::string& file,
                             const std::function<void(const Keyframe&)>& visit) {
  return KeyframeReader(file).visit(visit);
}

StoredPoints stored_points_of(const std::string& file) {
  return [file](const MapRegion& region, const auto& visit) {
    KeyframeReader(file).visit(region, [&](const Keyframe& keyframe) {
      visit(moved(keyframe.points_base, keyframe.T_odom_base));
    });
  };
}

}  // namespace trigpoint::lio_mapper
