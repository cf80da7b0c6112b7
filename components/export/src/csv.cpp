// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "csv.hpp"

#include "line_file.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <iterator>
#include <sstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

std::vector<std::string> split_line(const std::string& line) {
  std::vector<std::string> cells(1);
  bool quoted = false;
  for (std::size_t i = 0; i < line.size(); ++i) {
    const char c = line[i];
    if (quoted && c == '"' && i + 1 < line.size() && line[i + 1] == '"') {
      cells.back() += '"';
      ++i;
    } else if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      cells.emplace_back();
    } else {
      cells.back() += c;
    }
  }
  return cells;
}

}  // namespace

std::string number_text(double value) {
  if (std::isnan(value)) {
    return "nan";
  }
  std::array<char, 40> buffer{};
  const auto end = std::to_chars(buffer.data(), buffer.data() + buffer.size(), value).ptr;
  return {buffer.data(), end};
}

bool parse_number(const std::string& text, double& value) {
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  return result.ec == std::errc{} && result.ptr == end;
}

bool parse_integer(const std::string& text, std::int64_t& value) {
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  return result.ec == std::errc{} && result.ptr == end;
}

void CsvLine::separate() {
  if (!text_.empty()) {
    text_ += ',';
  }
}

std::string shown(const std::string& text) {
  constexpr std::size_t kLongest = 80;
  std::string result;
  for (const char c : text.substr(0, kLongest)) {
    const auto byte = static_cast<unsigned char>(c);
    std::array<char, 5> code{};
    std::snprintf(code.data(), code.size(), "\\x%02X", byte);
    result += byte >= 0x20 && byte < 0x7F ? std::string(1, c) : std::string(code.data());
  }
  return text.size() > kLongest ? result + "..." : result;
}

CsvLine& CsvLine::add(const std::string& text) {
  separate();
  std::string cell = text;
  std::replace_if(
      cell.begin(), cell.end(), [](char c) { return c == '\n' || c == '\r'; }, ' ');
  if (cell.find_first_of(",\"") == std::string::npos) {
    text_ += cell;
    return *this;
  }
  text_ += '"';
  for (const char c : cell) {
    text_ += c == '"' ? std::string("\"\"") : std::string(1, c);
  }
  text_ += '"';
  return *this;
}

CsvLine& CsvLine::add(double value) {
  separate();
  text_ += number_text(value);
  return *this;
}

CsvLine& CsvLine::add(std::int64_t value) {
  separate();
  text_ += std::to_string(value);
  return *this;
}

CsvLine& CsvLine::add(std::uint64_t value) {
  separate();
  text_ += std::to_string(value);
  return *this;
}

CsvLine& CsvLine::add(bool value) {
  separate();
  text_ += value ? '1' : '0';
  return *this;
}

CsvCells::CsvCells(const std::string& place,
                   const std::vector<std::string>& columns,
                   const std::vector<std::string>& cells)
    : place_(place), columns_(columns), cells_(cells) {
  if (cells.size() != columns.size()) {
    throw std::runtime_error(place + ": " + std::to_string(cells.size()) + " columns, expected " +
                             std::to_string(columns.size()));
  }
}

void CsvCells::fail(const std::string& expected) const {
  throw std::runtime_error(place_ + ": column " + columns_[next_] + " is '" + shown(cells_[next_]) +
                           "', expected " + expected);
}

std::string CsvCells::text() {
  return cells_[next_++];
}

double CsvCells::number() {
  double value = 0.0;
  if (!parse_number(cells_[next_], value)) {
    fail("a number");
  }
  ++next_;
  return value;
}

std::int64_t CsvCells::integer() {
  std::int64_t value = 0;
  if (!parse_integer(cells_[next_], value)) {
    fail("a whole number");
  }
  ++next_;
  return value;
}

std::uint64_t CsvCells::count() {
  std::int64_t value = 0;
  if (!parse_integer(cells_[next_], value) || value < 0) {
    fail("a whole number from 0");
  }
  ++next_;
  return static_cast<std::uint64_t>(value);
}

bool CsvCells::flag() {
  return one_of({"0", "1"}) == 1;
}

std::vector<NamedCount> CsvCells::counts() {
  std::vector<NamedCount> counts;
  std::istringstream in(cells_[next_]);
  for (std::string part; std::getline(in, part, ';');) {
    const auto colon = part.rfind(':');
    std::int64_t value = 0;
    if (colon == std::string::npos || !parse_integer(part.substr(colon + 1), value) || value < 0) {
      fail("name:number;name:number");
    }
    counts.push_back({part.substr(0, colon), static_cast<std::uint64_t>(value)});
  }
  ++next_;
  return counts;
}

std::size_t CsvCells::one_of(const std::vector<std::string>& names) {
  const auto found = std::find(names.begin(), names.end(), cells_[next_]);
  if (found == names.end()) {
    std::string list;
    for (const auto& name : names) {
      list += (list.empty() ? "one of " : ", ") + name;
    }
    fail(list);
  }
  ++next_;
  return static_cast<std::size_t>(found - names.begin());
}

std::vector<std::string> read_lines(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) {
    throw_errno(file, "open for reading");
  }
  std::vector<std::string> lines;
  std::string line;
  while (std::getline(in, line)) {
    if (in.eof()) {
      break;  // no newline: its writer died in it
    }
    if (!line.empty() && line.back() == '\r') {
      line.pop_back();
    }
    lines.push_back(line);
  }
  if (in.bad()) {
    throw_errno(file, "read");
  }
  return lines;
}

void read_csv(const std::string& file,
              const std::string& header,
              const std::function<void(CsvCells&)>& visit) {
  const auto lines = read_lines(file);
  if (lines.empty()) {
    throw std::runtime_error(file + ": is empty, expected the header '" + header + "'");
  }
  if (lines.front() != header) {
    throw std::runtime_error(file + ":1: is '" + shown(lines.front()) + "', expected the header '" +
                             header + "'");
  }
  const auto columns = split_line(header);
  for (std::size_t i = 1; i < lines.size(); ++i) {
    const auto cells = split_line(lines[i]);
    CsvCells line(file + ":" + std::to_string(i + 1), columns, cells);
    visit(line);
  }
}

std::string join_counts(const std::vector<NamedCount>& counts) {
  std::string text;
  for (const auto& [name, count] : counts) {
    std::string key = name;
    std::replace(key.begin(), key.end(), ';', '_');
    text += (text.empty() ? "" : ";") + key + ":" + std::to_string(count);
  }
  return text;
}

}  // namespace trigpoint::exporter
