// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The rows of the fusion table: which scenario, which figures of a run, which bound. A new row is a
// function and a line in fusion_rows.cpp.
#pragma once

#include "fusion_drive.hpp"

#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::fusion_table {

struct Bound {
  std::optional<double> lowest;
  std::optional<double> highest;

  bool holds(double value) const;
};

struct Figure {
  std::string name;  ///< with unit; the same for every mode and seed
  double value{kNaN};
  Bound bound;                 ///< of this run; none: told, not judged
  std::optional<bool> met;     ///< instead of the bound, where it is no number alone
  std::string words;           ///< what was said, where the row asks for it
  std::string detail;          ///< for the CSV only
  bool judged_by_mean{false};  ///< the mean over the seeds is what the bound is about

  bool is_judged() const { return met || bound.lowest || bound.highest; }

  bool is_met() const { return met.value_or(bound.holds(value)); }
};

using Figures = std::vector<Figure>;

struct MapTask;

struct Row {
  std::string scenario;  ///< with its changes
  std::string what;      ///< the table's words
  std::function<Figures(const Drive&, const std::string& mode)> score;
  bool sorted{false};      ///< also with sorted fixes
  bool many_short{false};  ///< over many seeds (--short-runs)
  /// Instead of `score`: of the map and the corrected past, from drives of its own.
  std::function<Figures(const MapTask&)> score_map{};
};

const std::vector<Row>& rows();

}  // namespace trigpoint::fusion_table
