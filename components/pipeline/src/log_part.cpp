// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include <variant>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

LogPart::LogPart(const std::string& session, exporter::Opening opening)
    : session_(session),
      fixes_(path_in(session, file::kFixes), opening),
      counts_(session, "log", opening) {}

void LogPart::on_entry(const recording::LogEntry& entry) {
  if (first_ns_ == 0) {
    first_ns_ = entry.receive_ns;
  }
  last_ns_ = entry.receive_ns;
  if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
    fixes_.append(*fix, entry.receive_ns, entry.withheld);
    ++(entry.withheld ? fixes_withheld_ : fixes_fed_);
  } else if (std::holds_alternative<ImuSample>(entry.measurement)) {
    ++imu_;
  } else if (std::holds_alternative<TwistMeasurement>(entry.measurement)) {
    ++twists_;
  } else if (std::holds_alternative<YawMeasurement>(entry.measurement)) {
    ++yaws_;
  } else {
    ++sweeps_;
  }
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
  if (truth && *truth != kept) {
    exporter::copy_file(*truth, kept);
  }
}

}  // namespace trigpoint::pipeline
