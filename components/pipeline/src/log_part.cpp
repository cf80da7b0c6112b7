// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <limits>
#include <sstream>
#include <variant>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

namespace {

/// The lines of `file` whose poses are later than `after_ns`.
std::string poses_after(const std::string& file, Nanoseconds after_ns) {
  const exporter::Trajectory poses = exporter::read_trajectory(file);  // strict
  const auto first = std::find_if(
      poses.begin(), poses.end(), [&](const auto& pose) { return pose.stamp_ns > after_ns; });
  auto passed_over = std::distance(poses.begin(), first);
  std::string text;
  std::ifstream in(file);
  for (std::string line; std::getline(in, line) && !in.eof();) {
    if (line.empty() || line.starts_with('#')) {
      continue;
    }
    if (passed_over-- <= 0) {
      text += line + "\n";
    }
  }
  return text;
}

/// Nothing is appended from `map` at another datum.
void append_truth(const std::string& from, const std::string& kept) {
  const auto old_datum = exporter::datum_named_in(kept);
  const auto new_datum = exporter::datum_named_in(from);
  if (old_datum && new_datum && old_datum->id() != new_datum->id()) {
    return;
  }
  const exporter::Trajectory old = exporter::read_trajectory(kept);
  const std::string later = poses_after(
      from, old.empty() ? std::numeric_limits<Nanoseconds>::min() : old.back().stamp_ns);
  if (later.empty()) {
    return;
  }
  std::ostringstream text;
  text << std::ifstream(kept).rdbuf();
  std::string whole = std::move(text).str();
  whole.resize(whole.rfind('\n') + 1);  // what a writer that died has left of a line
  exporter::write_text(kept, whole + later);
}

}  // namespace

LogPart::LogPart(const std::string& session, exporter::Opening opening)
    : session_(session),
      opening_(opening),
      fixes_(path_in(session, file::kFixes), opening),
      sweep_log_(path_in(session, file::kSweeps), opening),
      counts_(session, "log", opening) {}

void LogPart::on_entry(const recording::LogEntry& entry) {
  if (first_ns_ == 0) {
    first_ns_ = entry.receive_ns;
  }
  last_ns_ = entry.receive_ns;
  if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
    fixes_.append(*fix, entry.receive_ns, entry.withheld);
    ++(entry.withheld ? fixes_withheld_ : fixes_fed_);
  } else if (const auto* imu = std::get_if<ImuSample>(&entry.measurement)) {
    on_imu({imu->stamp_ns, entry.receive_ns});
  } else if (std::holds_alternative<TwistMeasurement>(entry.measurement)) {
    ++twists_;
  } else if (std::holds_alternative<YawMeasurement>(entry.measurement)) {
    ++yaws_;
  } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
    on_sweep({cloud->stamp_ns, entry.receive_ns});
  }
}

void LogPart::on_imu(Moment sample) {
  ++imu_;
  begin_ns_ = begin_ns_ == 0 ? sample.stamp_ns : begin_ns_;
  newest_imu_ = sample;
}

void LogPart::on_sweep(Moment sweep) {
  ++sweeps_;
  const bool clock_known = newest_imu_.stamp_ns != 0;
  sweep_log_.append({sweep.stamp_ns,
                     sweep.receive_ns,
                     clock_known ? newest_imu_.stamp_ns + sweep.receive_ns - newest_imu_.receive_ns
                                 : sweep.stamp_ns});
}

void LogPart::close(const recording::LogReader& log) {
  const auto undecodable = [&](const std::string& input) {
    std::uint64_t count = 0;
    for (const recording::Undecodable& skipped : log.undecodable()) {
      count += skipped.input == input ? skipped.count : 0;
    }
    return count;
  };
  const std::uint64_t sweeps_lost = undecodable("points");
  const std::uint64_t imu_lost = undecodable("imu");
  const std::uint64_t fixes_lost = undecodable("fix");
  std::vector<NamedCount> counts{{"points.in_log", sweeps_ + sweeps_lost},
                                 {"points.undecodable", sweeps_lost},
                                 {"points.published", sweeps_},
                                 {"imu.in_log", imu_ + imu_lost},
                                 {"imu.undecodable", imu_lost},
                                 {"imu.published", imu_},
                                 {"fix.in_log", fixes_fed_ + fixes_withheld_ + fixes_lost},
                                 {"fix.undecodable", fixes_lost},
                                 {"fix.withheld", fixes_withheld_},
                                 {"fix.published", fixes_fed_}};
  const auto add_optional = [&](const std::string& input, std::uint64_t fed) {
    if (const std::uint64_t lost = undecodable(input); fed + lost > 0) {
      counts.push_back({input + ".in_log", fed + lost});
      counts.push_back({input + ".undecodable", lost});
      counts.push_back({input + ".published", fed});
    }
  };
  add_optional("twist", twists_);
  add_optional("yaw", yaws_);
  counts_.write(counts);
}

void LogPart::keep_truth(const recording::LogReader& log) const {
  const std::string kept = path_in(session_, file::kTruth);
  const auto truth = log.truth_file();
  if (!truth || *truth == kept) {
    return;
  }
  if (opening_ == exporter::Opening::kContinue && std::filesystem::exists(kept)) {
    append_truth(*truth, kept);
  } else {
    exporter::copy_file(*truth, kept);
  }
}

}  // namespace trigpoint::pipeline
