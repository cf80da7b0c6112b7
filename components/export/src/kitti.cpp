// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Format: development kit of the KITTI odometry benchmark, readme.txt.
#include "trigpoint/export/trajectory_formats.hpp"

#include "csv.hpp"
#include <Eigen/LU>

#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

constexpr std::size_t kColumns = 12;
constexpr Nanoseconds kMadeUpInterval_ns = 100'000'000;
/// Matrices are printed with six to twelve decimals.
constexpr double kRotationTolerance = 1e-3;

struct Line {
  std::string place;  ///< FILE:NUMBER
  std::vector<std::string> words;
};

std::vector<Line> lines_of(const std::string& file) {
  std::vector<Line> result;
  const auto lines = read_lines(file);
  for (std::size_t i = 0; i < lines.size(); ++i) {
    Line line{file + ":" + std::to_string(i + 1), {}};
    std::istringstream in(lines[i]);
    for (std::string word; in >> word;) {
      line.words.push_back(word);
    }
    if (!line.words.empty() && !line.words.front().starts_with('#')) {
      result.push_back(std::move(line));
    }
  }
  return result;
}

double number_of(const Line& line, std::size_t column) {
  double value = 0.0;
  if (!parse_number(line.words[column], value) || !std::isfinite(value)) {
    throw std::runtime_error(line.place + ": '" + shown(line.words[column]) +
                             "' is not a finite number");
  }
  return value;
}

Pose pose_of(const Line& line) {
  if (line.words.size() != kColumns) {
    throw std::runtime_error(line.place + ": " + std::to_string(line.words.size()) +
                             " columns, expected 12 (three rows of a 3 x 4 matrix)");
  }
  Eigen::Matrix<double, 3, 4> m;
  for (std::size_t i = 0; i < kColumns; ++i) {
    m(static_cast<Eigen::Index>(i / 4), static_cast<Eigen::Index>(i % 4)) = number_of(line, i);
  }
  const Eigen::Matrix3d R = m.leftCols<3>();
  const double off = (R * R.transpose() - Eigen::Matrix3d::Identity()).cwiseAbs().maxCoeff();
  if (!(off < kRotationTolerance) || R.determinant() < 0.0) {
    throw std::runtime_error(line.place + ": the first three columns are no rotation (R R^T is " +
                             number_text(off) + " off)");
  }
  return {Eigen::Quaterniond(R).normalized(), m.col(3)};
}

Nanoseconds stamp_of(const Line& line) {
  Nanoseconds stamp_ns = 0;
  if (!parse_stamp(line.words.front(), stamp_ns)) {
    throw std::runtime_error(line.place + ": '" + shown(line.words.front()) +
                             "' is not a time in seconds");
  }
  return stamp_ns;
}

}  // namespace

TrajectoryFormat format_of(const std::string& file) {
  const auto lines = lines_of(file);
  return !lines.empty() && lines.front().words.size() == kColumns ? TrajectoryFormat::kKitti
                                                                  : TrajectoryFormat::kTum;
}

Trajectory read_kitti(const std::string& file, const std::string& times_file) {
  const auto lines = lines_of(file);
  const auto times = times_file.empty() ? std::vector<Line>{} : lines_of(times_file);
  if (!times_file.empty() && times.size() != lines.size()) {
    throw std::runtime_error(times_file + ": " + std::to_string(times.size()) + " times for the " +
                             std::to_string(lines.size()) + " poses of " + file);
  }
  Trajectory trajectory;
  for (std::size_t i = 0; i < lines.size(); ++i) {
    const Nanoseconds stamp_ns =
        times.empty() ? static_cast<Nanoseconds>(i) * kMadeUpInterval_ns : stamp_of(times[i]);
    if (!trajectory.empty() && stamp_ns <= trajectory.back().stamp_ns) {
      throw std::runtime_error(times[i].place + ": the time is not later than the one before it");
    }
    trajectory.push_back({stamp_ns, pose_of(lines[i])});
  }
  return trajectory;
}

std::string times_file_of(const std::string& kitti_file) {
  namespace fs = std::filesystem;
  const fs::path path(kitti_file);
  const fs::path folder = path.parent_path();
  const std::string stem = path.stem().string();  // of NAME.kitti.txt: NAME.kitti
  for (const fs::path& candidate : {folder / (stem + "_times.txt"), folder / "times.txt"}) {
    if (fs::exists(candidate)) {
      return candidate.string();
    }
  }
  return "";
}

}  // namespace trigpoint::exporter
