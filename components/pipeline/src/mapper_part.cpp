// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/pipeline/session_parts.hpp"

#include "damaged_files.hpp"

#include <filesystem>
#include <stdexcept>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

namespace {

exporter::Opening opening_of(bool goes_on) {
  return goes_on ? exporter::Opening::kContinue : exporter::Opening::kFresh;
}

}  // namespace

std::optional<Datum> read_stored_datum(const std::string& session) {
  const std::string datum = path_in(session, file::kDatum);
  if (!std::filesystem::exists(datum)) {
    return std::nullopt;
  }
  return exporter::read_datum(datum);
}

std::optional<Datum> stored_datum(const std::string& session, Events& events) {
  try {
    return read_stored_datum(session);
  } catch (const std::runtime_error& damaged) {
    events.push_back(warning_of(damaged,
                                "going on as if it had not been there: unless another program "
                                "still has the datum, a new one is elected, and `map` lies there"));
    return std::nullopt;
  }
}

std::optional<lio_mapper::Checkpoint> stored_checkpoint(const std::string& session) {
  const std::string store = path_in(session, file::kKeyframes);
  if (!std::filesystem::exists(store)) {
    return std::nullopt;
  }
  return lio_mapper::KeyframeReader(store).checkpoint();
}

StoredSession open_stored_session(const std::string& session) {
  StoredSession stored;
  const std::string store = path_in(session, file::kKeyframes);
  if (!std::filesystem::exists(store)) {
    throw ConfigError(session + " is no session with a keyframe store: no " + file::kKeyframes +
                      " in it");
  }
  lio_mapper::KeyframeReader reader(store);
  const auto checkpoint = reader.checkpoint();
  if (!checkpoint) {
    throw ConfigError(store + " holds no checkpoint: it was written before format 4, or no sweep " +
                      "was used; nothing can go on from it");
  }
  stored.checkpoint = *checkpoint;
  stored.points = lio_mapper::stored_points_of(store);
  stored.first_pose = reader.first_pose(checkpoint->odom_epoch);
  return stored;
}

MapperPart::MapperPart(const std::string& session, Continuing continuing)
    : trajectory_(path_in(session, file::kLio),
                  "base_link in odom, LiDAR-inertial odometry",
                  opening_of(continuing == Continuing::kYes)),
      scans_(path_in(session, file::kScans), opening_of(continuing == Continuing::kYes)),
      store_(path_in(session, file::kKeyframes)),
      counts_(session, "lio_mapper") {
  if (continuing != Continuing::kNoStore) {
    keyframes_.emplace(store_);
  }
}

void MapperPart::on_scan(const lio_mapper::ScanResult& scan) {
  trajectory_.append(scan.odometry.stamp_ns, scan.odometry.T_frame_child);
  scans_.append(scan.status, scan.points_odom.size());
  if (!keyframes_ && scan.keyframe) {
    keyframes_.emplace(store_);
  }
  if (keyframes_) {
    keyframes_->commit(scan.checkpoint, scan.rows, scan.keyframe);
  }
}

void MapperPart::close(const LioStatus& status,
                       const std::optional<lio_mapper::Checkpoint>& checkpoint,
                       const std::vector<lio_mapper::StoredRow>& rows) {
  if (keyframes_ && checkpoint) {
    keyframes_->commit(*checkpoint, rows, std::nullopt);
  }
  counts_.write(exporter::counts_of(status));
}

}  // namespace trigpoint::pipeline
