// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The small YAML files of a session: written by hand (few keys, fixed order), read strictly.
#include "trigpoint/base/rejections.hpp"
#include "trigpoint/export/session.hpp"

#include "csv.hpp"
#include "line_file.hpp"
#include <unistd.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <numbers>
#include <sstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

namespace fs = std::filesystem;

/// Order of the alignment's covariance.
constexpr std::array<const char*, 4> kAlignmentAxes{"yaw", "x", "y", "z"};

std::string quoted(const std::string& text) {
  YAML::Emitter out;
  out << YAML::DoubleQuoted << text;
  return out.c_str();
}

/// A mapping whose keys are asked for one by one; errors name file, line and key.
class Record {
 public:
  explicit Record(const std::string& file) : file_(file) {
    std::ifstream in(file);
    if (!in) {
      throw_errno(file, "open for reading");
    }
    try {
      node_ = YAML::Load(in);
    } catch (const YAML::Exception& error) {
      throw std::runtime_error(file + ": not valid YAML: " + error.what());
    }
    require_lines();
  }

  /// A part of the file that has lines of its own.
  Record(const std::string& file, const YAML::Node& node) : file_(file), node_(node) {
    require_lines();
  }

  template <typename Value>
  Value get(const std::string& key) const {
    return convert<Value>(key, node_[key]);
  }

  template <typename Value>
  std::vector<Value> get_list(const std::string& key, std::size_t size) const {
    const YAML::Node node = node_[key];
    if (!node || !node.IsSequence() || node.size() != size) {
      throw std::runtime_error(file_ + ": " + key + " must be a list of " + std::to_string(size));
    }
    std::vector<Value> values;
    for (const auto& item : node) {
      values.push_back(convert<Value>(key, item));
    }
    return values;
  }

  const YAML::Node& node() const { return node_; }

  template <typename Value>
  Value convert(const std::string& key, const YAML::Node& node) const {
    if (!node) {
      throw std::runtime_error(file_ + ": the key " + key + " is missing");
    }
    try {
      return node.as<Value>();
    } catch (const YAML::Exception&) {
      throw std::runtime_error(file_ + ":" + std::to_string(node.Mark().line + 1) + ": " + key +
                               " has a value of the wrong type");
    }
  }

 private:
  void require_lines() const {
    if (!node_.IsMap() && !node_.IsNull()) {
      throw std::runtime_error(file_ + ": expected `key: value` lines");
    }
  }

  std::string file_;
  YAML::Node node_;
};

std::string covariance_text(const Eigen::Matrix4d& covariance) {
  std::string text = "[";
  for (int i = 0; i < 16; ++i) {
    text += (i == 0 ? "" : ", ") + number_text(covariance(i / 4, i % 4));
  }
  return text + "]";
}

}  // namespace

std::string path_in(const std::string& folder, const std::string& name) {
  return (fs::path(folder) / name).string();
}

void create_session_folder(const std::string& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder)) {
    throw std::runtime_error(
        folder + ": cannot create the folder: " + (error ? error.message() : "it is a file"));
  }
}

void write_text(const std::string& file, const std::string& text) {
  const std::string beside = file + ".part" + std::to_string(::getpid());
  try {
    LineFile(beside, text, Opening::kFresh);
  } catch (const std::runtime_error&) {
    ::unlink(beside.c_str());
    throw;
  }
  if (std::rename(beside.c_str(), file.c_str()) != 0) {
    throw_errno(file, "replace");
  }
}

void copy_file(const std::string& from, const std::string& to) {
  std::error_code error;
  fs::copy_file(from, to, fs::copy_options::overwrite_existing, error);
  if (error) {
    throw std::runtime_error(to + ": cannot copy from " + from + ": " + error.message());
  }
}

void write_datum(const std::string& file, const Datum& datum) {
  write_text(file,
             "# Origin of the frame map: WGS 84, height above the ellipsoid\nlatitude_deg: " +
                 number_text(datum.latitude_deg) + "\nlongitude_deg: " +
                 number_text(datum.longitude_deg) + "\nheight_m: " + number_text(datum.height_m) +
                 "\nelected_ns: " + std::to_string(datum.elected_ns) +
                 "\nid: " + quoted(datum.id()) + "\n");
}

Datum read_datum(const std::string& file) {
  const Record record(file);
  Datum datum;
  datum.latitude_deg = record.get<double>("latitude_deg");
  datum.longitude_deg = record.get<double>("longitude_deg");
  datum.height_m = record.get<double>("height_m");
  datum.elected_ns = record.get<Nanoseconds>("elected_ns");
  const bool sane = std::abs(datum.latitude_deg) <= 90.0 &&
                    std::abs(datum.longitude_deg) <= 180.0 && std::isfinite(datum.height_m);
  if (!sane) {
    throw std::runtime_error(file + ": not a place on the Earth: " + datum.id());
  }
  return datum;
}

bool is_known(const Alignment& alignment) {
  return (alignment.covariance.diagonal().array() < kUnknownVariance).all();
}

void write_alignment(const std::string& file, const AlignmentRecord& record) {
  const YawPose& T_map_odom = record.alignment.T_map_odom;
  const Eigen::Matrix4d& covariance = record.alignment.covariance;
  std::string text =
      "# Best known T_map_odom: p_map = Rz(yaw_rad) exp((tilt_rad, 0)) p_odom + translation_m\n";
  text += "odom_epoch: " + std::to_string(record.alignment.odom_epoch);
  text += "\nyaw_rad: " + number_text(T_map_odom.yaw_rad);
  text += "\ntranslation_m: [" + number_text(T_map_odom.p.x()) + ", " +
          number_text(T_map_odom.p.y()) + ", " + number_text(T_map_odom.p.z()) + "]";
  text += "\ntilt_rad: [" + number_text(T_map_odom.tilt_rad.x()) + ", " +
          number_text(T_map_odom.tilt_rad.y()) + "]";
  for (int i = 0; i < 4; ++i) {
    text += std::string("\n") + kAlignmentAxes[static_cast<std::size_t>(i)] +
            (i == 0 ? "_sigma_rad: " : "_sigma_m: ") +
            number_text(covariance(i, i) < kUnknownVariance ? std::sqrt(covariance(i, i)) : kNaN);
  }
  text += "\n# rows of yaw, x, y, z\ncovariance: " + covariance_text(covariance);
  text += std::string("\nadmitted: ") + (record.admitted ? "true" : "false");
  text += record.was_admitted ? "\nwas_admitted: true" : "";
  text += "\ncomment: " + quoted(record.comment) + "\n";
  write_text(file, text);
}

AlignmentRecord read_alignment(const std::string& file) {
  const Record record(file);
  AlignmentRecord result;
  result.alignment.odom_epoch = record.get<std::uint32_t>("odom_epoch");
  result.alignment.T_map_odom.yaw_rad = record.get<double>("yaw_rad");
  const auto p = record.get_list<double>("translation_m", 3);
  result.alignment.T_map_odom.p = {p[0], p[1], p[2]};
  const auto tilt = record.get_list<double>("tilt_rad", 2);
  result.alignment.T_map_odom.tilt_rad = {tilt[0], tilt[1]};
  const auto covariance = record.get_list<double>("covariance", 16);
  for (int i = 0; i < 16; ++i) {
    result.alignment.covariance(i / 4, i % 4) = covariance[static_cast<std::size_t>(i)];
  }
  result.admitted = record.get<bool>("admitted");
  result.was_admitted = record.node()["was_admitted"] && record.get<bool>("was_admitted");
  result.comment = record.get<std::string>("comment");
  return result;
}

bool differs_substantially(const AlignmentRecord& next, const AlignmentRecord& written) {
  // Half of what a map's points are averaged over, at the end of a lever of 50 m.
  constexpr double kLeast_m = 0.05;
  constexpr double kLeast_rad = 0.001;
  const YawPose& a = next.alignment.T_map_odom;
  const YawPose& b = written.alignment.T_map_odom;
  return next.admitted != written.admitted ||
         next.alignment.odom_epoch != written.alignment.odom_epoch ||
         !((a.p - b.p).norm() < kLeast_m) ||
         !(std::abs(std::remainder(a.yaw_rad - b.yaw_rad, 2.0 * std::numbers::pi)) < kLeast_rad) ||
         !((a.tilt_rad - b.tilt_rad).norm() < kLeast_rad);
}

std::optional<Datum> datum_named_in(const std::string& trajectory_file) {
  const std::string key = "# datum ";
  std::ifstream in(trajectory_file);
  for (std::string line; std::getline(in, line) && line.starts_with('#');) {
    Datum datum;
    std::istringstream words(line.substr(std::min(key.size(), line.size())));
    if (line.starts_with(key) &&
        words >> datum.latitude_deg >> datum.longitude_deg >> datum.height_m) {
      return datum;
    }
  }
  return std::nullopt;
}

namespace {

/// Lines of `key: value`, each after `indent`.
std::string run_text(const RunInfo& run, const std::string& indent) {
  const auto line = [&](const std::string& key, const std::string& value) {
    return indent + key + ": " + value + "\n";
  };
  std::string text = line("log", quoted(run.log)) + line("how", quoted(run.how)) +
                     line("mode", quoted(run.mode)) + line("gps_filter", quoted(run.gps_filter)) +
                     line("data_s", number_text(run.data_s)) +
                     line("wall_s", number_text(run.wall_s));
  if (run.begin_ns && run.end_ns) {
    text += line("begin_ns", std::to_string(*run.begin_ns)) +
            line("end_ns", std::to_string(*run.end_ns));
  }
  return text + (run.interrupted ? line("interrupted", "true") : "");
}

RunInfo run_of(const Record& record) {
  RunInfo run;
  run.log = record.get<std::string>("log");
  run.how = record.get<std::string>("how");
  run.mode = record.get<std::string>("mode");
  run.gps_filter = record.get<std::string>("gps_filter");
  run.data_s = record.get<double>("data_s");
  run.wall_s = record.get<double>("wall_s");
  run.interrupted = record.node()["interrupted"] && record.get<bool>("interrupted");
  if (record.node()["begin_ns"]) {
    run.begin_ns = record.get<Nanoseconds>("begin_ns");
    run.end_ns = record.get<Nanoseconds>("end_ns");
  }
  return run;
}

}  // namespace

void write_run(const std::string& file, const RunInfo& run) {
  std::string text = run_text(run, "");
  text += run.before.empty() ? "" : "before:\n";
  for (const RunInfo& earlier : run.before) {
    std::string item = run_text(earlier, "    ");
    text += item.replace(2, 1, "-");
  }
  write_text(file, text);
}

RunInfo read_run(const std::string& file) {
  const Record record(file);
  RunInfo run = run_of(record);
  for (const auto& earlier : record.node()["before"]) {
    run.before.push_back(run_of(Record(file, earlier)));
  }
  return run;
}

std::vector<RunInfo> runs_in(const std::string& session) {
  const std::string file = path_in(session, session_file::kRun);
  if (!fs::exists(file)) {
    RunInfo unknown;
    unknown.log = "not recorded";
    return fs::exists(path_in(session, session_file::kLio)) ? std::vector{unknown}
                                                            : std::vector<RunInfo>{};
  }
  RunInfo newest = read_run(file);
  std::vector<RunInfo> runs = std::move(newest.before);
  newest.before.clear();
  runs.push_back(std::move(newest));
  return runs;
}

CountsWriter::CountsWriter(const std::string& folder, const std::string& program, Opening opening)
    : file_(path_in(folder, program + session_file::kCountsSuffix)) {
  if (opening == Opening::kContinue && std::filesystem::exists(file_)) {
    before_ = read_counts(file_);
  }
}

void CountsWriter::write(const std::vector<NamedCount>& counts) const {
  std::vector<NamedCount> sums = before_;
  for (const NamedCount& count : counts) {
    const auto same = std::find_if(
        sums.begin(), sums.end(), [&](const NamedCount& sum) { return sum.name == count.name; });
    if (same == sums.end()) {
      sums.push_back(count);
    } else {
      same->count += count.count;
    }
  }
  std::string text = "# messages: stream.what[.reason]\n";
  for (const auto& [name, count] : sums) {
    text += quoted(name) + ": " + std::to_string(count) + "\n";
  }
  write_text(file_, text);
}

std::vector<NamedCount> read_counts(const std::string& file) {
  const Record record(file);
  if (std::filesystem::file_size(file) == 0) {  // a file without a count has its comment
    throw std::runtime_error(file + ": empty, which no program leaves: what it counted is lost");
  }
  std::vector<NamedCount> counts;
  for (const auto& item : record.node()) {
    const auto name = item.first.as<std::string>();
    counts.push_back({name, record.convert<std::uint64_t>(name, item.second)});
  }
  return counts;
}

std::vector<NamedCount> counts_of(const GpsStatus& status) {
  std::vector<NamedCount> counts{{"imu.received", status.imu_received},
                                 {"fix.received", status.fixes_received},
                                 {"fix.used", status.fixes_accepted}};
  const auto add = [&](const char* prefix, RejectionKind kind) {
    for (const auto& [reason, count] : rejections_of_kind(status.rejections, kind)) {
      counts.push_back({prefix + reason, count});
    }
  };
  add("fix.refused.", RejectionKind::kFixRefused);
  add("fix.note.", RejectionKind::kNote);
  add("imu.refused.", RejectionKind::kImu);
  add("twist.refused.", RejectionKind::kTwist);
  add("yaw.refused.", RejectionKind::kYaw);
  return counts;
}

std::vector<NamedCount> counts_of(const LioStatus& status) {
  std::vector<NamedCount> counts{{"imu.received", status.imu_received},
                                 {"points.received", status.scans_received},
                                 {"points.used", status.scans_used}};
  for (const auto& [reason, count] : status.scans_refused) {
    counts.push_back({"points.refused." + reason, count});
  }
  return counts;
}

std::vector<NamedCount> counts_of(const FusionStatus& status) {
  std::vector<NamedCount> counts{{"fix.judged", status.fixes_seen},
                                 {"fix.used", status.fixes_used}};
  for (const auto& [reason, count] : status.verdicts) {
    counts.push_back({"fix.verdict." + reason, count});
  }
  return counts;
}

}  // namespace trigpoint::exporter
