// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

namespace trigpoint::lio_mapper {

struct TimedPoint {
  float x{0.0F};  ///< lidar frame at the moment of this point, m
  float y{0.0F};
  float z{0.0F};
  float intensity{0.0F};
  float time_s{0.0F};  ///< since Sweep::begin_ns
};

/// A decoded sweep: finite points within the range limits, each with its own time.
struct Sweep {
  Nanoseconds begin_ns{0};  ///< time of the first point
  Nanoseconds end_ns{0};    ///< time of the last point
  std::vector<TimedPoint> points;
  std::size_t points_received{0};
  std::size_t points_refused{0};  ///< not finite or out of range
};

/// Why a cloud was refused: a short stable code and a sentence with field, value and what was expected.
struct SweepRefusal {
  std::string code;
  std::string text;
};

/// Decodes clouds by field name and offset (Velodyne, Ouster, Hesai, Livox, KITTI layouts:
/// research/dds section 3), detects unit and origin of the point times and says so once as an event.
class SweepDecoder {
 public:
  explicit SweepDecoder(const SweepTimingConfig& config);
  std::variant<Sweep, SweepRefusal> decode(const PointCloudMessage& cloud, Events& events);

 private:
  SweepTimingConfig config_;
  std::string announced_;
};

}  // namespace trigpoint::lio_mapper
