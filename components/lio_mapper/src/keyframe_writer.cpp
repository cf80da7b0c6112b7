// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "point_codec.hpp"
#include "store_format.hpp"

namespace trigpoint::lio_mapper {

namespace {

bool has_tables(Database& database) {
  Statement statement(database, "SELECT name FROM sqlite_master WHERE type = 'table'");
  return statement.step();
}

std::int64_t signed_of(std::uint64_t count) {
  return static_cast<std::int64_t>(count);
}

/// Begins at construction, rolls back unless it was committed.
class Transaction {
 public:
  explicit Transaction(Database& database) : database_(database) {
    database_.run("BEGIN IMMEDIATE");
  }

  ~Transaction() {
    if (!done_) {
      sqlite3_exec(database_.handle(), "ROLLBACK", nullptr, nullptr, nullptr);
    }
  }

  Transaction(const Transaction&) = delete;
  Transaction& operator=(const Transaction&) = delete;

  void commit() {
    database_.run("COMMIT");
    done_ = true;
  }

 private:
  Database& database_;
  bool done_{false};
};

}  // namespace

struct KeyframeWriter::Impl {
  explicit Impl(const std::string& file)
      : database(file, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE) {
    prepare();
  }

  /// Write-ahead log: a killed writer loses at most the transaction that it was in. NORMAL leaves
  /// the flush to the disk to the system, which only a power cut can exploit.
  void prepare() {
    if (store::version_of(database) == 0) {
      create();
    }
    const std::int64_t version = store::version_of(database);
    if (version != store::kFormatVersion) {
      database.fail("has format version " + std::to_string(version) + ", this program writes " +
                    std::to_string(store::kFormatVersion) +
                    (version >= store::kRawPointsVersion && version < store::kFormatVersion
                         ? "; it can be read, but a new session needs a new folder"
                         : ""));
    }
    database.run("PRAGMA journal_mode=WAL; PRAGMA synchronous=NORMAL;");
    keyframes = std::make_unique<Statement>(
        database,
        "INSERT INTO keyframes(id, stamp_ns, odom_epoch, x_odom_m, y_odom_m, T_odom_base, "
        "pose_covariance, aligned, T_map_odom, points_base) "
        "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10)");
    rows = std::make_unique<Statement>(
        database,
        "INSERT INTO gps_rows(fix_stamp_ns, odom_epoch, mode, decision_x, decision_y, decision_z, "
        "position_map, covariance_map, lever_arm_base, applied, verdict) "
        "VALUES(?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11)");
    checkpoints = std::make_unique<Statement>(
        database,
        "INSERT OR REPLACE INTO checkpoint(id, stamp_ns, odom_epoch, aligned, distance_m, "
        "next_keyframe, scans_received, scans_used, imu_received, rows_applied, rows_refused, "
        "last_row_fix_ns, reset_counter, scans_refused, state, covariance, drift_covariance) "
        "VALUES(1, ?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13, ?14, ?15, ?16)");
  }

  /// In one transaction, so that no death leaves tables without a version.
  void create() {
    Transaction transaction(database);
    if (store::version_of(database) != 0) {
      return;  // another writer was faster
    }
    if (has_tables(database)) {
      database.fail("is a database of another program, it has tables but no format version");
    }
    database.run(std::string(store::kSchema) +
                 " PRAGMA user_version=" + std::to_string(store::kFormatVersion));
    transaction.commit();
  }

  static void step(Statement& statement) {
    statement.step();
    statement.reset();
  }

  void write(const Keyframe& keyframe) {
    const store::PoseNumbers pose = store::numbers_of(keyframe.T_odom_base);
    const store::YawPoseNumbers yaw_pose = store::numbers_of(keyframe.T_map_odom);
    const std::vector<std::uint8_t> points = packed(keyframe);
    Statement& s = *keyframes;
    s.reset();
    s.bind(1, signed_of(keyframe.id));
    s.bind(2, keyframe.stamp_ns);
    s.bind(3, keyframe.odom_epoch);
    s.bind_number(4, keyframe.T_odom_base.p.x());
    s.bind_number(5, keyframe.T_odom_base.p.y());
    s.bind_bytes(6, pose.data(), sizeof pose);
    s.bind_bytes(7, keyframe.pose_covariance.data(), sizeof(double) * 36);
    s.bind(8, keyframe.aligned ? 1 : 0);
    s.bind_bytes(9, yaw_pose.data(), sizeof yaw_pose);
    s.bind_bytes(10, points.data(), points.size());
    step(s);
  }

  std::vector<std::uint8_t> packed(const Keyframe& keyframe) const {
    try {
      return pack_points(keyframe.points_base);
    } catch (const std::runtime_error& error) {
      database.fail("the cloud of keyframe " + std::to_string(keyframe.id) + ": " + error.what());
    }
  }

  void write(const StoredRow& row) {
    Statement& s = *rows;
    s.reset();
    s.bind(1, row.update.fix_stamp_ns);
    s.bind(2, row.odom_epoch);
    s.bind(3, static_cast<int>(row.update.mode));
    for (std::size_t axis = 0; axis < 3; ++axis) {
      s.bind(4 + static_cast<int>(axis), static_cast<int>(row.update.decision[axis]));
    }
    s.bind_bytes(7, row.update.position_map_m.data(), sizeof(double) * 3);
    s.bind_bytes(8, row.update.covariance_map_m2.data(), sizeof(double) * 9);
    s.bind_bytes(9, row.update.lever_arm_base_m.data(), sizeof(double) * 3);
    s.bind(10, row.applied ? 1 : 0);
    s.bind_text(11, row.verdict);
    step(s);
  }

  void write(const Checkpoint& c) {
    const store::StateNumbers state = store::state_numbers_of(c);
    Statement& s = *checkpoints;
    s.reset();
    s.bind(1, c.stamp_ns);
    s.bind(2, c.odom_epoch);
    s.bind(3, c.aligned ? 1 : 0);
    s.bind_number(4, c.distance_m);
    const std::uint64_t counts[] = {c.next_keyframe,
                                    c.scans_received,
                                    c.scans_used,
                                    c.imu_received,
                                    c.rows_applied,
                                    c.rows_refused};
    int column = 5;
    for (const std::uint64_t count : counts) {
      s.bind(column++, signed_of(count));
    }
    s.bind(11, c.last_row_fix_ns);
    s.bind(12, c.reset.counter);
    s.bind_text(13, store::text_of(c.scans_refused));
    s.bind_bytes(14, state.data(), sizeof state);
    s.bind_bytes(
        15, c.covariance.data(), sizeof(double) * static_cast<std::size_t>(c.covariance.size()));
    s.bind_bytes(16, c.drift_covariance.data(), sizeof(double) * 36);
    step(s);
  }

  Database database;
  std::unique_ptr<Statement> keyframes;
  std::unique_ptr<Statement> rows;
  std::unique_ptr<Statement> checkpoints;
};

KeyframeWriter::KeyframeWriter(const std::string& file) : impl_(std::make_unique<Impl>(file)) {}

KeyframeWriter::~KeyframeWriter() = default;

void KeyframeWriter::append(const Keyframe& keyframe) {
  impl_->write(keyframe);
}

void KeyframeWriter::commit(const Checkpoint& checkpoint,
                            const std::vector<StoredRow>& rows,
                            const std::optional<Keyframe>& keyframe) {
  Transaction transaction(impl_->database);
  if (keyframe) {
    impl_->write(*keyframe);
  }
  for (const StoredRow& row : rows) {
    impl_->write(row);
  }
  impl_->write(checkpoint);
  transaction.commit();
}

}  // namespace trigpoint::lio_mapper
