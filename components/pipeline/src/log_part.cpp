// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include "damaged_files.hpp"

#include <filesystem>
#include <stdexcept>
#include <utility>
#include <variant>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

namespace {

/// What `from` has after the newest pose of `kept`; nothing when its `map` is at another datum.
exporter::Trajectory later_truth(const std::string& from, const std::string& kept) {
  const auto old_datum = exporter::datum_named_in(kept);
  const auto new_datum = exporter::datum_named_in(from);
  if (old_datum && new_datum && old_datum->id() != new_datum->id()) {
    return {};
  }
  const exporter::Trajectory old = exporter::read_trajectory(kept);
  exporter::Trajectory later = exporter::read_trajectory(from);
  std::erase_if(later, [&](const exporter::StampedPose& pose) {
    return !old.empty() && pose.stamp_ns <= old.back().stamp_ns;
  });
  return later;
}

}  // namespace

LogPart::LogPart(const std::string& session, exporter::Opening opening)
    : session_(session),
      opening_(opening),
      fixes_(path_in(session, file::kFixes), opening),
      sweep_log_(path_in(session, file::kSweeps), opening),
      counts_(open_counts(session, "log", opening, events_)) {}

Events LogPart::take_events() {
  return std::exchange(events_, {});
}

void LogPart::on_entry(const recording::LogEntry& entry) {
  first_ns_ = first_ns_.value_or(entry.receive_ns);
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
  begin_ns_ = begin_ns_.value_or(sample.stamp_ns);
  newest_imu_ = sample;
  for (const Moment& sweep : early_sweeps_) {
    write(sweep, sample);
  }
  early_sweeps_.clear();
}

void LogPart::on_sweep(Moment sweep) {
  ++sweeps_;
  if (newest_imu_) {
    write(sweep, *newest_imu_);
  } else {
    early_sweeps_.push_back(sweep);
  }
}

void LogPart::write(Moment sweep, Moment imu) {
  sweep_log_.append(
      {sweep.stamp_ns, sweep.receive_ns, imu.stamp_ns + sweep.receive_ns - imu.receive_ns});
}

double LogPart::data_s() const {
  return first_ns_ && last_ns_ ? to_seconds(*last_ns_ - *first_ns_) : 0.0;
}

void LogPart::close(const recording::LogReader& log) {
  write_without_imu();
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

/// Without IMU there are no estimates, so that any clock does; but a file that goes on is on one.
void LogPart::write_without_imu() {
  if (opening_ == exporter::Opening::kFresh) {
    for (const Moment& sweep : early_sweeps_) {
      write(sweep, {sweep.receive_ns, sweep.receive_ns});
    }
  } else if (!early_sweeps_.empty()) {
    events_.push_back({Severity::kWarning,
                       last_ns_.value_or(0),
                       "sweeps_left_out",
                       "The log has no IMU sample, so nobody knows when its " +
                           std::to_string(early_sweeps_.size()) +
                           " sweeps arrived on the clock of the session: they are not added to " +
                           path_in(session_, file::kSweeps) + "."});
  }
  early_sweeps_.clear();
}

void LogPart::keep_truth(const recording::LogReader& log) {
  const std::string kept = path_in(session_, file::kTruth);
  const auto truth = log.truth_file();
  if (!truth || *truth == kept) {
    return;
  }
  if (opening_ != exporter::Opening::kContinue || !std::filesystem::exists(kept)) {
    exporter::copy_file(*truth, kept);
    return;
  }
  exporter::Trajectory later;
  try {
    later = later_truth(*truth, kept);
  } catch (const std::runtime_error& damaged) {
    events_.push_back({Severity::kWarning,
                       last_ns_.value_or(0),
                       "truth_left_out",
                       std::string(damaged.what()) + "; nothing of " + *truth + " is added to " +
                           kept + ", and what was driven is not scored against it"});
  }
  if (!later.empty()) {
    exporter::TrajectoryWriter writer(kept, "base_link in map", exporter::Opening::kContinue);
    for (const exporter::StampedPose& pose : later) {
      writer.append(pose.stamp_ns, pose.pose);
    }
  }
}

}  // namespace trigpoint::pipeline
