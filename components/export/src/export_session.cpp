// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/export_session.hpp"

#include "trigpoint/base/config.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/session.hpp"

#include "cloud_export.hpp"
#include "geo_files.hpp"
#include "trajectory_files.hpp"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

namespace fs = std::filesystem;

/// More poses a second make Google Earth and hiking programs slow and show nothing.
constexpr Nanoseconds kTrackInterval_ns = 100'000'000;
/// The tiles' names tell their corners in metres.
constexpr double kSmallestTile_m = 1.0;
constexpr const char* kPicture = "top_view.png";
constexpr const char* kHidden = ".map_for_export.pcd";

/// One export on its way.
struct Work {
  std::string session;
  std::string out;
  ExportOptions options;
  std::optional<geodesy::MapOnEarth> earth;
  std::vector<NamedTrajectory> trajectories;
  std::function<void(double)> progress;
  ExportReport report;

  bool wants(const std::string& format) const {
    return std::find(options.formats.begin(), options.formats.end(), format) !=
           options.formats.end();
  }

  bool wants_any(const std::vector<std::string>& formats) const {
    return std::any_of(
        formats.begin(), formats.end(), [&](const auto& format) { return wants(format); });
  }

  std::string in_out(const std::string& name) const { return path_in(out, name); }

  void written(const std::string& file, const std::string& content, const std::string& format) {
    report.written.push_back({file, content, format});
  }
};

std::string names_of_formats() {
  std::string names;
  for (const ExportFormat& format : export_formats()) {
    names += (names.empty() ? "" : ", ") + format.name;
  }
  return names;
}

/// truth.tum alone is no result: it comes with a log.
void check_for_results(const std::string& session) {
  for (const char* name : {session_file::kKeyframes,
                           session_file::kMap,
                           session_file::kFused,
                           session_file::kFusedSmoothed,
                           session_file::kLio,
                           session_file::kGps}) {
    if (fs::exists(path_in(session, name))) {
      return;
    }
  }
  throw std::runtime_error(
      session +
      ": nothing to export: it holds neither keyframes.sqlite, map.pcd, fused.tum, "
      "lio.tum nor gps.tum" +
      (fs::exists(path_in(session, session_file::kTruth))
           ? "; a simulated drive becomes a session by `trigpoint map`"
           : ""));
}

/// What is wrong with the call, as ConfigError: found before anything is written.
void check(const Work& work) {
  if (!fs::is_directory(work.session)) {
    throw ConfigError(work.session + ": is not a session folder");
  }
  const auto& known = export_formats();
  for (const std::string& name : work.options.formats) {
    if (std::none_of(known.begin(), known.end(), [&](const auto& f) { return f.name == name; })) {
      throw ConfigError("unknown format '" + name + "', there are: " + names_of_formats());
    }
  }
  if (work.options.tile_m > 0.0 && work.options.tile_m < kSmallestTile_m) {
    throw ConfigError("tiles must have an edge of 1 m or more, got " +
                      std::to_string(work.options.tile_m) + " m");
  }
  if (fs::exists(work.out) && fs::equivalent(work.session, work.out)) {
    throw ConfigError(work.out + ": is the session itself, choose another folder");
  }
  if (fs::exists(work.out) && !fs::is_directory(work.out)) {
    throw ConfigError(work.out + ": is no folder, choose another name");
  }
  check_for_results(work.session);
}

/// Everything that could be written.
std::vector<std::string> targets_of(const Work& work) {
  std::vector<std::string> targets{session_file::kDatum};
  const auto add = [&](const std::string& format, const std::vector<std::string>& names) {
    if (work.wants(format)) {
      targets.insert(targets.end(), names.begin(), names.end());
    }
  };
  for (const char* format : {"pcd", "ply", "las"}) {
    add(format, {(work.options.tile_m > 0.0 ? "map_" : "map.") + std::string(format)});
  }
  for (const NamedTrajectory& trajectory : work.trajectories) {
    add("tum", {trajectory.name + ".tum"});
    add("kitti", {trajectory.name + ".kitti.txt", trajectory.name + ".kitti_times.txt"});
    add("csv", {trajectory.name + ".csv"});
  }
  add("geojson", {"trajectories.geojson"});
  add("gpx", {"trajectories.gpx"});
  add("kml", {"session.kml", kPicture});
  add("kmz", {"session.kmz"});
  add("geotiff", {"top_view.tif", "height.tif"});
  return targets;
}

void refuse_to_overwrite(const Work& work) {
  std::string there;
  for (const std::string& target : targets_of(work)) {
    if (fs::exists(work.in_out(target))) {
      there += (there.empty() ? "" : ", ") + target;
    }
  }
  if (!there.empty()) {
    throw ConfigError(work.out + ": holds " + there +
                      " already, and nothing is ever written over; choose another folder");
  }
}

void find_earth(Work& work) {
  const std::string file = path_in(work.session, session_file::kDatum);
  if (!fs::exists(file)) {
    return;
  }
  geodesy::MapOnEarth earth(read_datum(file));
  if (earth.has_utm()) {
    work.earth = std::move(earth);
  } else {
    work.report.missing.push_back(
        "the datum is too near a pole for UTM: nothing is written that needs a place on the Earth");
  }
}

/// Removed with its owner.
struct HiddenFile {
  std::string file;

  explicit HiddenFile(std::string name) : file(std::move(name)) {}

  ~HiddenFile() {
    std::error_code ignored;
    fs::remove(file, ignored);
  }

  HiddenFile(const HiddenFile&) = delete;
  HiddenFile& operator=(const HiddenFile&) = delete;
};

void render_points(Work& work, const std::string& target) {
  const std::string alignment = path_in(work.session, session_file::kAlignment);
  std::optional<Alignment> fallback;
  if (fs::exists(alignment)) {
    fallback = read_alignment(alignment).alignment;
  }
  const std::optional<CorrectedPoses> corrected = read_corrected(work.session);
  work.report.map = render_map(path_in(work.session, session_file::kKeyframes),
                               fallback,
                               work.options.voxel_m,
                               target,
                               [&](double share) { work.progress(0.5 * share); },
                               {corrected ? &*corrected : nullptr,
                                corrected.has_value(),
                                past_settings_of(work.session).lidar_position_base_m});
}

/// Writes map.pcd when it was asked for whole. Returns the file to read the points from: `hidden`,
/// if need be.
std::string provide_points(Work& work, const std::string& hidden) {
  const bool whole_pcd = work.wants("pcd") && work.options.tile_m <= 0.0;
  const std::string target = work.in_out(session_file::kMap);
  const std::string finished = path_in(work.session, session_file::kMap);
  if (fs::exists(path_in(work.session, session_file::kKeyframes))) {
    const std::string rendered = whole_pcd ? target : hidden;
    render_points(work, rendered);
    if (whole_pcd) {
      work.written(target,
                   "frame " + work.report.map.frame + ", " +
                       std::to_string(work.report.map.points_written) + " points",
                   "pcd");
    }
    return rendered;
  }
  if (whole_pcd) {
    copy_file(finished, target);
    const std::string frame = frame_of_pcd(target);
    work.written(
        target,
        (frame.empty() ? "" : "frame " + frame + ", ") + "copied: the session holds no keyframes",
        "pcd");
  }
  return finished;
}

/// Returns the top view for KML.
std::optional<TopView> export_points(Work& work) {
  if (!work.wants_any({"pcd", "ply", "las", "geotiff", "kml", "kmz"})) {
    return std::nullopt;
  }
  if (!fs::exists(path_in(work.session, session_file::kKeyframes)) &&
      !fs::exists(path_in(work.session, session_file::kMap))) {
    work.report.missing.push_back("no map: the session holds neither keyframes.sqlite nor map.pcd");
    return std::nullopt;
  }
  const HiddenFile hidden(work.in_out(kHidden));
  CloudExport job;
  job.pcd_file = provide_points(work, hidden.file);
  job.frame = frame_of_pcd(job.pcd_file);
  job.out_folder = work.out;
  job.formats = work.options.formats;
  job.tile_m = work.options.tile_m;
  job.cell_m = work.options.cell_m;
  if (work.earth && job.frame == "map") {
    job.earth = &*work.earth;
  } else if (work.earth && work.wants_any({"las", "geotiff", "kml", "kmz"})) {
    work.report.missing.push_back(
        "the map is in the frame " + (job.frame.empty() ? "(not named)" : job.frame) +
        ", which has no place on the Earth: no LAS, GeoTIFF or picture for Google Earth");
  }
  if (!work.wants_any({"ply", "las", "geotiff", "kml", "kmz"}) && work.options.tile_m <= 0.0) {
    return std::nullopt;
  }
  CloudExportResult result =
      export_cloud(job, [&](double share) { work.progress(0.5 + 0.4 * share); });
  auto& written = work.report.written;
  written.insert(written.end(), result.written.begin(), result.written.end());
  return std::move(result.overlay);
}

void export_texts(Work& work) {
  for (const NamedTrajectory& trajectory : work.trajectories) {
    const std::string poses = std::to_string(trajectory.poses.size()) + " poses, " +
                              (trajectory.is_in_map ? "map" : "odom");
    const std::string target = work.in_out(trajectory.name);
    if (work.wants("tum")) {
      copy_file(path_in(work.session, trajectory.name + ".tum"), target + ".tum");
      work.written(target + ".tum", poses, "tum");
    }
    if (work.wants("kitti")) {
      write_kitti(target + ".kitti.txt", target + ".kitti_times.txt", trajectory.poses);
      work.written(target + ".kitti.txt", poses + "; stamps in .kitti_times.txt", "kitti");
    }
    if (work.wants("csv")) {
      write_trajectory_csv(target + ".csv",
                           trajectory.poses,
                           trajectory.is_in_map && work.earth ? &*work.earth : nullptr);
      work.written(target + ".csv", poses, "csv");
    }
  }
}

void export_kml(Work& work, const std::vector<Track>& tracks, const std::optional<TopView>& view) {
  if (tracks.empty() && !view) {
    return;
  }
  const std::string content =
      std::to_string(tracks.size()) + " trajectories" + (view ? " over the map from above" : "");
  const Grid grid = view ? view->grid() : Grid{};
  // The archive's picture is a file first.
  const HiddenFile hidden(work.in_out(".top_view_for_kmz.png"));
  const std::string png = work.wants("kml") ? work.in_out(kPicture) : hidden.file;
  if (view) {
    write_png(png, *view);
  }
  if (work.wants("kml")) {
    write_kml(work.in_out("session.kml"), tracks, view ? kPicture : "", grid);
    work.written(work.in_out("session.kml"), content, "kml");
  }
  if (work.wants("kmz")) {
    write_kmz(work.in_out("session.kmz"), tracks, view ? png : "", grid);
    work.written(work.in_out("session.kmz"), content, "kmz");
  }
}

void export_tracks(Work& work, const std::optional<TopView>& view) {
  if (!work.earth || !work.wants_any({"geojson", "gpx", "kml", "kmz"})) {
    return;
  }
  const std::vector<Track> tracks = tracks_of(work.trajectories, *work.earth);
  const std::string count = std::to_string(tracks.size()) + " trajectories";
  if (work.wants("geojson") && !tracks.empty()) {
    write_geojson(work.in_out("trajectories.geojson"), tracks);
    work.written(work.in_out("trajectories.geojson"), count, "geojson");
  }
  std::vector<Track> thin;
  for (const Track& track : tracks) {
    thin.push_back(thinned(track, kTrackInterval_ns));
  }
  if (work.wants("gpx") && !tracks.empty()) {
    write_gpx(work.in_out("trajectories.gpx"), thin);
    work.written(work.in_out("trajectories.gpx"), count + ", at most 10 poses a second", "gpx");
  }
  export_kml(work, thin, view);
}

std::string sentence_without_datum(const std::string& formats) {
  return "no datum.yaml in the session (no fix was good enough to place the map): " + formats +
         " need a place on the Earth and are left out; pcd, ply, tum, kitti and csv do not";
}

/// Rendering the map takes minutes: what nothing can come of is told before.
void refuse_without_earth(const Work& work) {
  std::string formats;
  for (const ExportFormat& format : export_formats()) {
    if (work.wants(format.name)) {
      if (work.earth || !format.needs_datum) {
        return;
      }
      formats += (formats.empty() ? "" : ", ") + format.name;
    }
  }
  const bool has_datum = fs::exists(path_in(work.session, session_file::kDatum));
  throw std::runtime_error(work.session + ": nothing to export: " +
                           (has_datum ? work.report.missing.back()  // too near a pole
                                      : sentence_without_datum(formats)));
}

void say_what_is_missing(Work& work) {
  const auto& written = work.report.written;
  std::string without_datum;
  for (const ExportFormat& format : export_formats()) {
    const bool is_written = std::any_of(written.begin(), written.end(), [&](const auto& file) {
      return file.format == format.name;
    });
    if (!work.wants(format.name) || is_written) {
      continue;
    }
    work.report.formats_missing.push_back(format.name);
    if (format.needs_datum && !work.earth) {
      without_datum += (without_datum.empty() ? "" : ", ") + format.name;
    }
  }
  const bool has_datum = fs::exists(path_in(work.session, session_file::kDatum));
  if (!without_datum.empty() && !has_datum) {
    work.report.missing.push_back(sentence_without_datum(without_datum));
  }
}

}  // namespace

const std::vector<ExportFormat>& export_formats() {
  static const std::vector<ExportFormat> kFormats{
      {"pcd", "points in map, float32 (map.pcd)", false},
      {"ply", "points in UTM, or in map without a datum, double (map.ply)", false},
      {"las", "points in UTM, LAS 1.4 with the coordinate system (map.las)", true},
      {"tum", "every trajectory as the session has it (NAME.tum)", false},
      {"kitti", "every trajectory as rows of matrices (NAME.kitti.txt)", false},
      {"csv", "every trajectory with its places on the Earth (NAME.csv)", false},
      {"geojson", "all trajectories (trajectories.geojson)", true},
      {"gpx", "all trajectories (trajectories.gpx)", true},
      {"kml", "trajectories over the map from above (session.kml, top_view.png)", true},
      {"kmz", "the same in one file for Google Earth (session.kmz)", true},
      {"geotiff", "the map from above and its height (top_view.tif, height.tif)", true}};
  return kFormats;
}

ExportReport export_session(const std::string& session_folder,
                            const std::string& out_folder,
                            const ExportOptions& options,
                            const std::function<void(double)>& progress) {
  Work work;
  work.session = session_folder;
  work.out = out_folder;
  work.options = options;
  work.progress = progress ? progress : [](double) {};
  if (work.options.formats.empty()) {
    for (const ExportFormat& format : export_formats()) {
      work.options.formats.push_back(format.name);
    }
  }
  check(work);
  work.trajectories = read_trajectories(session_folder, work.report.missing);
  refuse_to_overwrite(work);
  find_earth(work);
  refuse_without_earth(work);
  create_session_folder(out_folder);
  const std::optional<TopView> overlay = export_points(work);
  export_texts(work);
  export_tracks(work, overlay);
  say_what_is_missing(work);
  if (work.report.written.empty()) {
    std::string reasons;
    for (const auto& sentence : work.report.missing) {
      reasons += (reasons.empty() ? "" : "; ") + sentence;
    }
    throw std::runtime_error(session_folder + ": nothing to export: " + reasons);
  }
  const auto datum = path_in(session_folder, session_file::kDatum);
  if (fs::exists(datum)) {
    copy_file(datum, work.in_out(session_file::kDatum));
    work.written(work.in_out(session_file::kDatum), "origin of map", "");
  }
  work.progress(1.0);
  return work.report;
}

}  // namespace trigpoint::exporter
