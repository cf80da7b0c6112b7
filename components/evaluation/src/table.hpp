// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// A Markdown table whose columns are padded, so that it also reads well in a terminal.
class Table {
 public:
  explicit Table(std::vector<std::string> head);

  /// Fewer cells than the head are filled up; the first column is left-aligned, the others right.
  void add(std::vector<std::string> cells);

  bool is_empty() const { return rows_.size() == 1; }

  std::string str() const;

 private:
  std::vector<std::vector<std::string>> rows_;
};

/// `decimals` digits after the point; "-" when not finite.
std::string fixed(double value, int decimals);

/// "97.3 %" of 0.973, never rounded up to 100; "-" when not finite.
std::string share(double value);

}  // namespace trigpoint::evaluation
