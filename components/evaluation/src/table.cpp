// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "table.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <utility>

namespace trigpoint::evaluation {

Table::Table(std::vector<std::string> head) {
  rows_.push_back(std::move(head));
}

void Table::add(std::vector<std::string> cells) {
  cells.resize(rows_.front().size());
  for (auto& cell : cells) {
    std::replace(cell.begin(), cell.end(), '|', '/');  // would end the cell
  }
  rows_.push_back(std::move(cells));
}

std::string Table::str() const {
  std::vector<std::size_t> widths(rows_.front().size(), 3);
  for (const auto& row : rows_) {
    for (std::size_t i = 0; i < row.size(); ++i) {
      widths[i] = std::max(widths[i], row[i].size());
    }
  }
  std::string text;
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    text += "|";
    for (std::size_t i = 0; i < widths.size(); ++i) {
      const std::string padding(widths[i] - rows_[r][i].size(), ' ');
      text += " " + (i == 0 ? rows_[r][i] + padding : padding + rows_[r][i]) + " |";
    }
    text += "\n";
    if (r == 0) {
      text += "|";
      for (std::size_t i = 0; i < widths.size(); ++i) {
        text += (i == 0 ? ":" : "-") + std::string(widths[i], '-') + (i == 0 ? "-|" : ":|");
      }
      text += "\n";
    }
  }
  return text;
}

std::string fixed(double value, int decimals) {
  if (!std::isfinite(value)) {
    return "-";
  }
  std::array<char, 64> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%.*f", decimals, value);
  return buffer.data();
}

std::string share(double value) {
  return std::isfinite(value) ? fixed(std::floor(value * 1000.0 + 1e-9) / 10.0, 1) + " %" : "-";
}

}  // namespace trigpoint::evaluation
