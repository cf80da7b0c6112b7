// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/measurements.hpp"
#include "trigpoint/lio_mapper/config.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <variant>
#include <vector>

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
  Nanoseconds begin_ns{0};    ///< time of the first point
  Nanoseconds end_ns{0};      ///< time of the last point
  double clock_sigma_s{0.0};  ///< of both, besides what they have in common with earlier sweeps
  std::vector<TimedPoint> points;
  std::size_t points_received{0};
  std::size_t points_refused{0};  ///< not finite or out of range
  double decoding_ms{0.0};        ///< as the shell measured it
};

/// Why a cloud was refused: a short stable code and a sentence with field, value and what was
/// expected.
struct SweepRefusal {
  std::string code;
  std::string text;
};

struct DecodedPoints;

/// Decodes clouds by field name and offset (Velodyne, Ouster, Hesai, Livox, KITTI layouts:
/// README), detects unit and origin of the point times and says so once as an event.
/// The unit is kept once found, as long as it makes the times a sweep.
class SweepDecoder {
 public:
  /// Throws std::invalid_argument for a word that is no choice of its key.
  explicit SweepDecoder(const SweepTimingConfig& config);
  /// On success the sweep has at least one point. Otherwise nothing of the cloud was used.
  std::variant<Sweep, SweepRefusal> decode(const PointCloudMessage& cloud, Events& events);

 private:
  std::optional<SweepRefusal> time_by_field(const PointCloudMessage& cloud,
                                            const DecodedPoints& decoded,
                                            Sweep& sweep,
                                            Events& events);
  void announce(Nanoseconds stamp_ns,
                const std::string& meaning,
                const std::string& details,
                Events& events);

  SweepTimingConfig config_;
  std::string announced_;
  std::optional<double> unit_s_;
};

}  // namespace trigpoint::lio_mapper
