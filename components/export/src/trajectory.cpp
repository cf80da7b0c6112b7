// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// TUM trajectories: https://cvg.cit.tum.de/data/datasets/rgbd-dataset/file_formats
#include "csv.hpp"
#include "line_file.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

constexpr std::size_t kFractionDigits = 9;
/// Half a unit of the sixth decimal in each of four components, with room for foreign files.
constexpr double kNormTolerance = 1e-3;

[[noreturn]] void fail(const std::string& place, const std::string& what) {
  throw std::runtime_error(place + ": " + what);
}

StampedPose parse_pose(const std::string& place, const std::string& line) {
  std::istringstream in(line);
  std::vector<std::string> words;
  for (std::string word; in >> word;) {
    words.push_back(word);
  }
  if (words.size() != 8) {
    fail(place, std::to_string(words.size()) + " columns, expected 8 (t x y z qx qy qz qw)");
  }
  StampedPose result;
  if (!parse_stamp(words[0], result.stamp_ns)) {
    fail(place, "'" + shown(words[0]) + "' is not a time in seconds");
  }
  std::array<double, 7> v{};
  for (std::size_t i = 0; i < v.size(); ++i) {
    if (!parse_number(words[i + 1], v[i]) || !std::isfinite(v[i])) {
      fail(place, "'" + shown(words[i + 1]) + "' is not a finite number");
    }
  }
  result.pose.p = {v[0], v[1], v[2]};
  result.pose.q = Eigen::Quaterniond(v[6], v[3], v[4], v[5]);
  const double norm = result.pose.q.norm();
  if (std::abs(norm - 1.0) > kNormTolerance) {
    fail(place, "the quaternion's length is " + number_text(norm) + ", expected 1");
  }
  result.pose.q.normalize();
  return result;
}

}  // namespace

bool parse_stamp(const std::string& text, Nanoseconds& stamp_ns) {
  if (text.find_first_of("eE") != std::string::npos) {
    double seconds = 0.0;
    if (!parse_number(text, seconds) || !(std::abs(seconds) < 9e9)) {
      return false;
    }
    stamp_ns = from_seconds(seconds);
    return true;
  }
  const bool negative = text.starts_with('-');
  const std::string digits = negative ? text.substr(1) : text;
  const auto dot = digits.find('.');
  std::string fraction = dot == std::string::npos ? "" : digits.substr(dot + 1);
  if (fraction.find_first_not_of("0123456789") != std::string::npos) {
    return false;
  }
  fraction.resize(kFractionDigits, '0');
  const std::string whole = digits.substr(0, dot);
  if (whole.empty() || whole.find_first_not_of("0123456789") != std::string::npos) {
    return false;
  }
  const bool parsed = parse_integer(whole + fraction, stamp_ns);
  stamp_ns = negative ? -stamp_ns : stamp_ns;
  return parsed;
}

std::string stamp_text(Nanoseconds stamp_ns) {
  const bool negative = stamp_ns < 0;
  // Unsigned, because the lowest integer has no positive twin.
  const auto magnitude =
      negative ? 0U - static_cast<std::uint64_t>(stamp_ns) : static_cast<std::uint64_t>(stamp_ns);
  constexpr auto kSecond = static_cast<std::uint64_t>(kNanosecondsPerSecond);
  std::string fraction = std::to_string(magnitude % kSecond);
  fraction.insert(0, kFractionDigits - fraction.size(), '0');
  return (negative ? "-" : "") + std::to_string(magnitude / kSecond) + "." + fraction;
}

TrajectoryWriter::TrajectoryWriter(const std::string& file,
                                   const std::string& frame_comment,
                                   Opening opening)
    : lines_(std::make_unique<LineFile>(file,
                                        "# " + frame_comment + ": t[s] x y z[m] qx qy qz qw\n",
                                        opening)),
      last_stamp_ns_(std::numeric_limits<Nanoseconds>::min()) {
  const auto written = opening == Opening::kContinue ? read_trajectory(file) : Trajectory{};
  if (!written.empty()) {
    last_stamp_ns_ = written.back().stamp_ns;
  }
}

TrajectoryWriter::~TrajectoryWriter() = default;

bool TrajectoryWriter::append(Nanoseconds stamp_ns, const Pose& T_frame_base) {
  if (!T_frame_base.is_finite() || stamp_ns <= last_stamp_ns_) {
    return false;
  }
  const auto& [q, p] = T_frame_base;
  // A micrometre and 1e-9 of a rotation: below every sensor, and equal bits give equal text.
  std::array<char, 256> numbers{};
  std::snprintf(numbers.data(),
                numbers.size(),
                " %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n",
                p.x(),
                p.y(),
                p.z(),
                q.x(),
                q.y(),
                q.z(),
                q.w());
  lines_->append(stamp_text(stamp_ns) + numbers.data());
  last_stamp_ns_ = stamp_ns;
  return true;
}

Trajectory read_trajectory(const std::string& file) {
  Trajectory trajectory;
  const auto lines = read_lines(file);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const std::string place = file + ":" + std::to_string(i + 1);
    const auto first = lines[i].find_first_not_of(" \t");
    if (first == std::string::npos || lines[i][first] == '#') {
      continue;
    }
    trajectory.push_back(parse_pose(place, lines[i]));
    const auto n = trajectory.size();
    if (n > 1 && trajectory[n - 1].stamp_ns <= trajectory[n - 2].stamp_ns) {
      fail(place,
           "the stamp " + stamp_text(trajectory[n - 1].stamp_ns) + " is not later than " +
               stamp_text(trajectory[n - 2].stamp_ns) + " before it");
    }
  }
  return trajectory;
}

}  // namespace trigpoint::exporter
