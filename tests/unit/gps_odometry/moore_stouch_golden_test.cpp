// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The strict filter against cases that were computed by the published one. The file is
// golden_rl_ekf.csv of the shared data, or the one that the environment variable
// TRIGPOINT_GOLDEN_EKF names: case, dt, mask (bit i = state i), x0[15], P0[225], z[15], R[225],
// x_pred[15], P_pred[225], x_upd[15], P_upd[225], row-major; lines with # are comments.
#include "moore_stouch.hpp"
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace trigpoint::gps_odometry {
namespace {

// Element by element: |a - b| <= kRelative max(|b|, kFloor largest |element of the same matrix|).
// The floor is for elements that are what remains of a difference of larger ones.
constexpr double kRelative = 1e-9;
constexpr double kFloor = 1e-6;

struct Case {
  std::string name;
  double dt_s;
  MeasuredStates measured;
  Vector15d x0, z, x_predicted, x_updated;
  Matrix15d P0, R, P_predicted, P_updated;
};

class Cells {
 public:
  explicit Cells(const std::string& line) : line_(line) {}

  std::string text() {
    std::string cell;
    if (!std::getline(line_, cell, ',')) {
      throw std::runtime_error("the line has too few columns");
    }
    return cell;
  }

  double number() {
    const std::string cell = text();
    std::size_t used = 0;
    const double value = std::stod(cell, &used);
    if (cell.find_first_not_of(" \r", used) != std::string::npos) {
      throw std::runtime_error("not a number: " + cell);
    }
    return value;
  }

  MeasuredStates mask() {
    const double bits = number();
    if (bits != std::floor(bits) || bits < 0.0 || bits >= 32768.0) {
      throw std::runtime_error("not a mask of 15 bits: " + std::to_string(bits));
    }
    return MeasuredStates(static_cast<unsigned long>(bits));
  }

  Vector15d vector() {
    Vector15d values;
    for (double& value : values) {
      value = number();
    }
    return values;
  }

  Matrix15d matrix() {
    Matrix15d values;
    for (int row = 0; row < 15; ++row) {
      values.row(row) = vector().transpose();
    }
    return values;
  }

  bool at_end() { return (line_ >> std::ws).eof(); }

 private:
  std::istringstream line_;
};

Case read_case(const std::string& line) {
  Cells cells(line);
  Case read;
  read.name = cells.text();
  read.dt_s = cells.number();
  read.measured = cells.mask();
  read.x0 = cells.vector();
  read.P0 = cells.matrix();
  read.z = cells.vector();
  read.R = cells.matrix();
  read.x_predicted = cells.vector();
  read.P_predicted = cells.matrix();
  read.x_updated = cells.vector();
  read.P_updated = cells.matrix();
  if (!cells.at_end()) {
    throw std::runtime_error("the line has too many columns");
  }
  return read;
}

std::vector<Case> read_cases(const std::string& path) {
  std::ifstream file(path);
  std::vector<Case> cases;
  for (std::string line; std::getline(file, line);) {
    if (line.find_first_not_of(" \r") != std::string::npos && line.front() != '#') {
      cases.push_back(read_case(line));
    }
  }
  return cases;
}

/// The largest |a - b| / max(|b|, floor) of two matrices of one shape; infinite when either has a
/// value that is not finite.
template <class Matrix>
double largest_relative_difference(const Matrix& actual, const Matrix& expected, double floor) {
  if (!actual.allFinite() || !expected.allFinite()) {
    return HUGE_VAL;
  }
  const double least = std::max(floor * expected.cwiseAbs().maxCoeff(), 1e-300);
  const auto scale = expected.cwiseAbs().cwiseMax(least);
  return (actual - expected).cwiseAbs().cwiseQuotient(scale).maxCoeff();
}

struct Worst {
  double with_floor{0.0};
  double without_floor{0.0};
};

template <class Matrix>
void expect_equal(const Matrix& actual, const Matrix& expected, const char* what, Worst& worst) {
  const double difference = largest_relative_difference(actual, expected, kFloor);
  EXPECT_LE(difference, kRelative) << what;
  worst.with_floor = std::max(worst.with_floor, difference);
  worst.without_floor =
      std::max(worst.without_floor, largest_relative_difference(actual, expected, 0.0));
}

void check(const Case& golden, Worst& worst) {
  MooreStouch filter;
  filter.initialised = true;
  filter.x = golden.x0;
  filter.P = golden.P0;
  filter.predict(golden.dt_s);
  expect_equal(filter.x, golden.x_predicted, "x_pred", worst);
  expect_equal(filter.P, golden.P_predicted, "P_pred", worst);
  filter.correct(golden.z, golden.R, golden.measured);
  expect_equal(filter.x, golden.x_updated, "x_upd", worst);
  expect_equal(filter.P, golden.P_updated, "P_upd", worst);
}

TEST(Ekf15Strict, equals_the_published_filter_case_by_case) {
  const char* const named = std::getenv("TRIGPOINT_GOLDEN_EKF");
  const std::string path =
      named != nullptr ? named : std::string(TRIGPOINT_SHARED_DATA) + "/golden_rl_ekf.csv";
  if (named == nullptr && !std::filesystem::exists(TRIGPOINT_SHARED_DATA)) {
    GTEST_SKIP() << "no shared data in " << TRIGPOINT_SHARED_DATA;
  }
  std::vector<Case> cases;
  ASSERT_NO_THROW(cases = read_cases(path)) << path;
  ASSERT_FALSE(cases.empty()) << path << " cannot be read or has no cases";
  Worst worst;
  for (const Case& golden : cases) {
    SCOPED_TRACE("case " + golden.name);
    check(golden, worst);
  }
  std::printf(
      "%s: %zu cases, largest relative difference %.2e (element by element without floor %.2e)\n",
      path.c_str(),
      cases.size(),
      worst.with_floor,
      worst.without_floor);
}

}  // namespace
}  // namespace trigpoint::gps_odometry
