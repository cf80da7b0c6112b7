// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One table of all figures of a test binary: what, filter, figure, bound, met?
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint {

/// Printed when all tests have run.
class EvidenceTable : public testing::Environment {
 public:
  struct Row {
    std::string what;
    std::string filter;
    double figure;
    std::string unit;
    std::string bound;  ///< empty: none is set
    bool met;
  };

  static EvidenceTable& instance() {
    static auto* table =
        dynamic_cast<EvidenceTable*>(testing::AddGlobalTestEnvironment(new EvidenceTable));
    return *table;
  }

  /// A figure without a bound.
  void note(const std::string& what,
            const std::string& filter,
            double figure,
            const std::string& unit) {
    rows_.push_back({what, filter, figure, unit, "", true});
  }

  /// A figure that must be at most (or at least) the bound.
  void at_most(const std::string& what,
               const std::string& filter,
               double figure,
               double bound,
               const std::string& unit) {
    const bool met = figure <= bound;
    rows_.push_back({what, filter, figure, unit, "<= " + text(bound), met});
    EXPECT_TRUE(met) << what << ", " << filter << ": " << figure << " " << unit
                     << ", expected at most " << bound;
  }

  void at_least(const std::string& what,
                const std::string& filter,
                double figure,
                double bound,
                const std::string& unit) {
    const bool met = figure >= bound;
    rows_.push_back({what, filter, figure, unit, ">= " + text(bound), met});
    EXPECT_TRUE(met) << what << ", " << filter << ": " << figure << " " << unit
                     << ", expected at least " << bound;
  }

  /// A line for each figure, a column for each filter; a bound stands beside the figure.
  void TearDown() override {
    std::vector<std::string> filters;
    std::vector<std::string> whats;
    std::map<std::pair<std::string, std::string>, const Row*> cells;
    for (const Row& row : rows_) {
      if (std::find(filters.begin(), filters.end(), row.filter) == filters.end()) {
        filters.push_back(row.filter);
      }
      if (std::find(whats.begin(), whats.end(), row.what) == whats.end()) {
        whats.push_back(row.what);
      }
      cells[{row.what, row.filter}] = &row;
    }
    std::printf("\n| figure (bound) |");
    for (const std::string& filter : filters) {
      std::printf(" %s |", filter.c_str());
    }
    std::printf("\n|---|");
    for (std::size_t i = 0; i < filters.size(); ++i) {
      std::printf("---|");
    }
    for (const std::string& what : whats) {
      std::printf("\n| %s |", what.c_str());
      for (const std::string& filter : filters) {
        const auto cell = cells.find({what, filter});
        std::printf(" %s |", cell == cells.end() ? "" : cell_text(*cell->second).c_str());
      }
    }
    std::printf("\n");
    const auto unmet =
        std::count_if(rows_.begin(), rows_.end(), [](const Row& row) { return !row.met; });
    std::printf("bounds not met: %ld\n", static_cast<long>(unmet));
    std::fflush(stdout);
  }

 private:
  static std::string text(double value) {
    char number[40];
    std::snprintf(number, sizeof(number), "%.*g", std::abs(value) >= 1000.0 ? 5 : 3, value);
    return number;
  }

  static std::string cell_text(const Row& row) {
    const std::string figure = text(row.figure) + (row.unit.empty() ? "" : " " + row.unit);
    return row.bound.empty() ? figure : figure + " (" + row.bound + (row.met ? ")" : ", NOT MET)");
  }

  std::vector<Row> rows_;
};

}  // namespace trigpoint
