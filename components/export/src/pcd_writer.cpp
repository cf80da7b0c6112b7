// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Format: https://pointclouds.org/documentation/tutorials/pcd_file_format.html
#include "pcd_writer.hpp"

#include <bit>
#include <iomanip>
#include <sstream>

namespace trigpoint::exporter {

static_assert(std::endian::native == std::endian::little, "PCD's binary data is little-endian");
static_assert(sizeof(PointXyzi) == 4 * sizeof(float), "points are written as they lie in memory");

namespace {

/// The header is written again at the end with the true number, so it must keep its length.
constexpr int kCountWidth = 12;

}  // namespace

PcdWriter::PcdWriter(const std::string& file, const std::string& frame)
    : frame_(frame), file_(file, header()) {}

std::string PcdWriter::header() const {
  std::ostringstream text;
  text << "# .PCD v0.7 - Point Cloud Data file format\n"
       << (frame_.empty() ? "" : "# frame " + frame_ + "\n")
       << "VERSION 0.7\nFIELDS x y z intensity\n"
       << "SIZE 4 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n"
       << std::setfill('0') << "WIDTH " << std::setw(kCountWidth) << points_
       << "\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\n"
       << "POINTS " << std::setw(kCountWidth) << points_ << "\nDATA binary\n";
  return text.str();
}

void PcdWriter::append(const PointCloud& points) {
  file_.append(reinterpret_cast<const char*>(points.data()), points.size() * sizeof(PointXyzi));
  points_ += points.size();
}

std::uint64_t PcdWriter::finish() {
  file_.finish(header());
  return points_;
}

}  // namespace trigpoint::exporter
