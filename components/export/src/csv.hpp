// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Comma-separated lines as RFC 4180 has them, with a header of column names; a number that is not
// known is `nan`.
#pragma once

#include "trigpoint/base/messages.hpp"

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace trigpoint::exporter {

/// A file's own text for an error: what is no printable ASCII as \xNN, the rest of a long one left
/// out. A file may hold anything, also what a terminal obeys.
std::string shown(const std::string& text);

/// One line in the making.
class CsvLine {
 public:
  CsvLine& add(const std::string& text);  ///< quoted when needed; line breaks become spaces
  CsvLine& add(double value);             ///< enough digits to read the same bits back
  CsvLine& add(std::int64_t value);
  CsvLine& add(std::uint64_t value);
  CsvLine& add(bool value);

  std::string str() const { return text_ + "\n"; }

 private:
  void separate();

  std::string text_;
};

/// The cells of one line by order of reading; every error names file:line and column.
class CsvCells {
 public:
  CsvCells(const std::string& place,
           const std::vector<std::string>& columns,
           const std::vector<std::string>& cells);

  std::string text();
  double number();
  std::int64_t integer();
  std::uint64_t count();
  bool flag();
  std::vector<NamedCount> counts();  ///< written by join_counts
  /// Index of the text in `names`.
  std::size_t one_of(const std::vector<std::string>& names);

 private:
  [[noreturn]] void fail(const std::string& expected) const;

  std::string place_;
  const std::vector<std::string>& columns_;
  const std::vector<std::string>& cells_;
  std::size_t next_{0};
};

/// Calls `visit` for every line below the header, which must equal `header`. A last line without
/// its end is left out.
void read_csv(const std::string& file,
              const std::string& header,
              const std::function<void(CsvCells&)>& visit);

/// "a:1;b:2"; separators inside names become underscores.
std::string join_counts(const std::vector<NamedCount>& counts);
/// Whole lines of a file (without their ends); throws when it cannot be read.
std::vector<std::string> read_lines(const std::string& file);

/// The whole text as a number; false when it is not one.
bool parse_number(const std::string& text, double& value);
bool parse_integer(const std::string& text, std::int64_t& value);
/// "12.5" (seconds) to 12500000000 without going through a double, which cannot hold 19 digits.
bool parse_stamp(const std::string& text, Nanoseconds& stamp_ns);

/// Shortest text that reads back to the same bits.
std::string number_text(double value);

}  // namespace trigpoint::exporter
