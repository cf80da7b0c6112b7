// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html
#include "pcd_head.hpp"

#include "csv.hpp"

#include <algorithm>
#include <fstream>
#include <map>
#include <sstream>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

using Lines = std::map<std::string, std::vector<std::string>>;

/// The words of each line of the head by its first one; the stream is left at the first point.
Lines read_lines_of_head(std::ifstream& in) {
  Lines lines;
  for (std::string line; lines.count("DATA") == 0 && std::getline(in, line);) {
    std::istringstream words(line);
    std::string key;
    words >> key;
    if (key.empty() || key.starts_with('#')) {
      continue;
    }
    auto& values = lines[key];
    for (std::string word; words >> word;) {
      values.push_back(word);
    }
  }
  return lines;
}

std::uint64_t number_in(const std::vector<std::string>& words, std::size_t i) {
  std::int64_t value = -1;
  if (i >= words.size() || !parse_integer(words[i], value) || value < 0) {
    throw std::invalid_argument("number");
  }
  return static_cast<std::uint64_t>(value);
}

/// Of one number, byte: the format has no longer ones.
constexpr std::uint64_t kLargestSize = 8;
/// Numbers of one field: the longest of PCL's descriptors has some 2000.
constexpr std::uint64_t kLargestCount = 65536;

PcdHead head_of(const Lines& lines) {
  PcdHead head;
  const auto& names = lines.at("FIELDS");
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::uint64_t size = number_in(lines.at("SIZE"), i);
    const std::uint64_t count = lines.count("COUNT") == 0 ? 1 : number_in(lines.at("COUNT"), i);
    if (size > kLargestSize || count > kLargestCount) {
      throw std::invalid_argument("field");  // or the bytes of a point would overflow
    }
    const bool is_float32 = size == 4 && count == 1 && lines.at("TYPE").at(i) == "F";
    head.fields.push_back({names[i], head.point_bytes, is_float32});
    head.point_bytes += size * count;
  }
  head.points = number_in(lines.at("POINTS"), 0);
  head.storage = lines.at("DATA").at(0);
  return head;
}

}  // namespace

int PcdHead::offset_of(const std::string& name) const {
  const auto field = std::find_if(fields.begin(), fields.end(), [&](const Field& each) {
    return each.name == name && each.is_float32;
  });
  return field == fields.end() ? -1 : static_cast<int>(field->offset);
}

PcdHead read_pcd_head(const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  try {
    PcdHead head = head_of(read_lines_of_head(in));
    head.data_begin = static_cast<std::uint64_t>(in.tellg());
    return head;
  } catch (const std::logic_error&) {  // a line, a word or a number is missing
    throw std::runtime_error(file + ": not a readable PCD file");
  }
}

}  // namespace trigpoint::exporter
