// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Figures of all rows, modes and seeds, as a table and as CSV.
#pragma once

#include "fusion_rows.hpp"

#include <cstdint>
#include <fstream>
#include <map>
#include <string>
#include <vector>

namespace trigpoint::fusion_table {

class Scoreboard {
 public:
  /// `csv`: file for every single figure as it comes, or empty. Throws std::runtime_error when it
  /// cannot be written.
  Scoreboard(std::vector<std::string> modes, const std::string& csv);

  void add(const Row& row, const std::string& mode, std::uint64_t seed, const Figures& figures);

  /// A row's lines: mean and worst over the seeds of each mode, the bound, and how often it was
  /// met.
  std::string print(const Row& row) const;
  std::string head() const;
  /// The verdicts' words of a row.
  std::string print_words(const Row& row) const;
  /// Means of `mode` over those of each other mode.
  std::string print_ratios(const std::string& mode) const;
  /// How many judged lines each mode met.
  std::string print_summary() const;

 private:
  struct Line {
    std::string name;
    std::map<std::string, std::vector<Figure>> by_mode;
  };

  struct Group {
    std::string scenario;
    std::string what;
    std::vector<Line> lines;  ///< in the order of the figures
  };

  const Group* group_of(const Row& row) const;
  Line& line_of(const Row& row, const std::string& name);
  static bool is_met(const std::vector<Figure>& figures);

  std::vector<std::string> modes_;
  std::vector<Group> groups_;
  std::ofstream csv_;
};

}  // namespace trigpoint::fusion_table
