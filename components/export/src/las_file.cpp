// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// ASPRS, LAS Specification 1.4 - R15, 2019: public header block (section 2.4, table 3), variable
// length record (2.5), WKT record (3.4), point data record format 6 (2.6.7).
#include "cloud_file.hpp"
#include "part_file.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

constexpr double kStep_m = 0.001;
constexpr std::uint16_t kHeaderBytes = 375;
constexpr std::uint16_t kRecordHeadBytes = 54;
constexpr std::uint16_t kPointBytes = 30;
constexpr std::uint16_t kWktBit = 1U << 4U;
constexpr std::uint16_t kWktRecord = 2112;
constexpr std::uint8_t kPointFormat = 6;
/// Return 1 of 1: what the pulse's other returns were is not kept.
constexpr std::uint8_t kOnlyReturn = 0x11;

/// Little-endian, as the processor has it.
class Bytes {
 public:
  template <typename Number>
  void put(Number number) {
    text_.append(reinterpret_cast<const char*>(&number), sizeof(number));
  }

  void put_text(std::string text, std::size_t length) {
    text.resize(length, '\0');
    text_ += text;
  }

  void put_zeros(std::size_t count) { text_.append(count, '\0'); }

  const std::string& text() const { return text_; }

 private:
  std::string text_;
};

class LasFile : public CloudFile {
 public:
  LasFile(const std::string& file, const LasSettings& settings)
      : settings_(settings),
        today_(std::chrono::floor<std::chrono::days>(std::chrono::system_clock::now())),
        file_(file, head()) {}

  void append(const std::vector<FilePoint>& points) override;

  std::uint64_t finish() override {
    file_.finish(head());
    return points_;
  }

 private:
  using Steps = Eigen::Matrix<std::int32_t, 3, 1>;

  std::string head() const;
  void put_bounds(Bytes& bytes) const;
  Steps steps_of(const Eigen::Vector3d& position_m) const;
  std::uint16_t intensity_of(float intensity) const;

  LasSettings settings_;
  std::chrono::year_month_day today_;
  std::uint64_t points_{0};
  Steps lowest_{Steps::Constant(std::numeric_limits<std::int32_t>::max())};
  Steps highest_{Steps::Constant(std::numeric_limits<std::int32_t>::min())};
  PartFile file_;
};

LasFile::Steps LasFile::steps_of(const Eigen::Vector3d& position_m) const {
  const Eigen::Vector3d steps = (position_m - settings_.offset_m) / kStep_m;
  if (!(steps.cwiseAbs().maxCoeff() < std::numeric_limits<std::int32_t>::max())) {
    throw std::runtime_error(file_.file() +
                             ": a point lies more than 2147 km from the datum, farther than LAS "
                             "can tell in millimetres");
  }
  return steps.array().round().matrix().cast<std::int32_t>();
}

std::uint16_t LasFile::intensity_of(float intensity) const {
  const double scaled = settings_.intensity_factor * intensity;
  return scaled > 0.0 ? static_cast<std::uint16_t>(std::min(std::round(scaled), 65535.0)) : 0;
}

void LasFile::append(const std::vector<FilePoint>& points) {
  Bytes bytes;
  for (const FilePoint& point : points) {
    const Steps steps = steps_of(point.position_m);
    lowest_ = lowest_.cwiseMin(steps);
    highest_ = highest_.cwiseMax(steps);
    bytes.put(steps.x());
    bytes.put(steps.y());
    bytes.put(steps.z());
    bytes.put(intensity_of(point.intensity));
    bytes.put(kOnlyReturn);
    bytes.put(std::uint8_t{0});   // flags, scanner channel
    bytes.put(std::uint8_t{0});   // class: never classified
    bytes.put(std::uint8_t{0});   // user data
    bytes.put(std::int16_t{0});   // scan angle
    bytes.put(std::uint16_t{0});  // source
    bytes.put(0.0);               // time: a point is the mean of many moments
  }
  file_.append(bytes.text().data(), bytes.text().size());
  points_ += points.size();
}

void LasFile::put_bounds(Bytes& bytes) const {
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double offset_m = settings_.offset_m[axis];
    bytes.put(points_ == 0 ? 0.0 : highest_[axis] * kStep_m + offset_m);
    bytes.put(points_ == 0 ? 0.0 : lowest_[axis] * kStep_m + offset_m);
  }
}

std::string LasFile::head() const {
  const auto wkt_bytes = static_cast<std::uint16_t>(settings_.wkt.size() + 1);
  const std::chrono::sys_days new_year{today_.year() / std::chrono::January / 1};
  const auto day = (std::chrono::sys_days{today_} - new_year).count() + 1;
  Bytes bytes;
  bytes.put_text("LASF", 4);
  bytes.put(std::uint16_t{0});  // file source
  bytes.put(kWktBit);
  bytes.put_zeros(16);  // project
  bytes.put(std::uint8_t{1});
  bytes.put(std::uint8_t{4});
  bytes.put_text("Trigpoint", 32);
  bytes.put_text("trigpoint export", 32);
  bytes.put(static_cast<std::uint16_t>(day));
  bytes.put(static_cast<std::uint16_t>(static_cast<int>(today_.year())));
  bytes.put(kHeaderBytes);
  bytes.put(static_cast<std::uint32_t>(kHeaderBytes + kRecordHeadBytes + wkt_bytes));
  bytes.put(std::uint32_t{1});  // variable length records
  bytes.put(kPointFormat);
  bytes.put(kPointBytes);
  bytes.put_zeros(4 + 5 * 4);  // legacy counts, which format 6 must leave at 0
  for (int axis = 0; axis < 3; ++axis) {
    bytes.put(kStep_m);
  }
  for (const double offset_m : settings_.offset_m) {
    bytes.put(offset_m);
  }
  put_bounds(bytes);
  bytes.put_zeros(8 + 8 + 4);  // no waveforms, no extended records
  bytes.put(points_);
  bytes.put(points_);  // by return: all are the first
  bytes.put_zeros(14 * 8);
  bytes.put(std::uint16_t{0});
  bytes.put_text("LASF_Projection", 16);
  bytes.put(kWktRecord);
  bytes.put(wkt_bytes);
  bytes.put_text("WKT", 32);
  bytes.put_text(settings_.wkt, wkt_bytes);
  return bytes.text();
}

}  // namespace

std::unique_ptr<CloudFile> open_las(const std::string& file, const LasSettings& settings) {
  if (settings.wkt.size() + 1 > std::numeric_limits<std::uint16_t>::max()) {
    throw std::runtime_error(file + ": the text of the coordinate system is too long for LAS");
  }
  return std::make_unique<LasFile>(file, settings);
}

}  // namespace trigpoint::exporter
