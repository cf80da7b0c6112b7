// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cloud_layout.hpp"
#include "point_times.hpp"
#include "sweep.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <numbers>
#include <stdexcept>
#include <utility>

namespace trigpoint::lio_mapper {

/// Points whose time_s is still the raw value of the time field less `first_time`.
struct DecodedPoints {
  std::vector<TimedPoint> points;
  double first_time{0.0};
  TimeRange kept;  ///< raw times of `points`
  TimeRange all;   ///< and of those out of range
  std::uint64_t received{0};
  const CloudLayout* layout{nullptr};
};

namespace {

constexpr double kTwoPi = 2.0 * std::numbers::pi;

/// Stamps outside this are no time of day (the year 2096), and leave room for sums.
constexpr Nanoseconds kLatestStamp_ns = 4'000'000'000'000'000'000;

void require_choice(const char* key,
                    const std::string& value,
                    std::initializer_list<const char*> choices) {
  std::string listed;
  for (const char* choice : choices) {
    if (value == choice) {
      return;
    }
    listed += std::string(listed.empty() ? "" : ", ") + choice;
  }
  throw std::invalid_argument(std::string(key) + " is '" + value + "', expected one of " + listed);
}

std::string text_of(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.9g", value);
  return text.data();
}

/// Reads fields of whatever type.
class AnyPoint {
 public:
  explicit AnyPoint(const CloudLayout& layout) : layout_(layout) {}

  TimedPoint operator()(const std::uint8_t* data) const {
    return {static_cast<float>(layout_.x(data)),
            static_cast<float>(layout_.y(data)),
            static_cast<float>(layout_.z(data)),
            layout_.intensity ? static_cast<float>((*layout_.intensity)(data)) : 0.0F,
            0.0F};
  }

 private:
  const CloudLayout& layout_;
};

/// One pass over the data: keeps what is finite and in range.
DecodedPoints read_points(const PointCloudMessage& cloud,
                          const CloudLayout& layout,
                          const SweepTimingConfig& config) {
  DecodedPoints decoded;
  decoded.layout = &layout;
  decoded.received = std::uint64_t{cloud.width} * cloud.height;
  decoded.points.reserve(decoded.received);
  const auto min2 = static_cast<float>(config.min_range_m * config.min_range_m);
  const auto max2 = static_cast<float>(config.max_range_m * config.max_range_m);
  const AnyPoint point_at(layout);
  for (std::uint32_t row = 0; row < cloud.height; ++row) {
    const std::uint8_t* data = cloud.data.data() + row * layout.row_step;
    for (std::uint32_t column = 0; column < cloud.width; ++column, data += cloud.point_step) {
      const double time = layout.time ? (*layout.time)(data) : 0.0;
      if (!std::isfinite(time)) {
        continue;
      }
      decoded.all.add(time);
      TimedPoint point = point_at(data);
      const float range2 = point.x * point.x + point.y * point.y + point.z * point.z;
      if (!(range2 >= min2 && range2 <= max2)) {  // also refuses NaN
        continue;
      }
      if (decoded.points.empty()) {
        decoded.first_time = time;
      }
      decoded.kept.add(time);
      point.time_s = static_cast<float>(time - decoded.first_time);
      point.intensity = std::isfinite(point.intensity) ? point.intensity : 0.0F;
      decoded.points.push_back(point);
    }
  }
  return decoded;
}

/// Shift of the stamp to the sweep's begin, for a sweep of the configured period.
double begin_after_stamp_s(const SweepTimingConfig& config) {
  if (config.stamp_is == "end") {
    return -config.sweep_period_s;
  }
  return config.stamp_is == "middle" ? -0.5 * config.sweep_period_s : 0.0;
}

/// A spinning LiDAR turns evenly: the angle travelled since the first azimuth is the time.
void time_by_azimuth(const SweepTimingConfig& config, Nanoseconds stamp_ns, Sweep& sweep) {
  float last_s = 0.0F;
  for (TimedPoint& point : sweep.points) {
    const double azimuth_rad = std::atan2(point.y, point.x);
    double travelled_rad = config.clockwise ? config.first_azimuth_rad - azimuth_rad
                                            : azimuth_rad - config.first_azimuth_rad;
    travelled_rad -= kTwoPi * std::floor(travelled_rad / kTwoPi);
    point.time_s = static_cast<float>(travelled_rad / kTwoPi * config.sweep_period_s);
    last_s = std::max(last_s, point.time_s);
  }
  sweep.begin_ns = stamp_ns + from_seconds(begin_after_stamp_s(config));
  sweep.end_ns = sweep.begin_ns + from_seconds(last_s);
}

void time_by_snapshot(Nanoseconds stamp_ns, Sweep& sweep) {
  for (TimedPoint& point : sweep.points) {
    point.time_s = 0.0F;
  }
  sweep.begin_ns = stamp_ns;
  sweep.end_ns = stamp_ns;
}

SweepRefusal no_usable_points(const DecodedPoints& decoded, const SweepTimingConfig& config) {
  return {"no_usable_points",
          "None of " + std::to_string(decoded.received) +
              " points is finite and between min_range_m = " + text_of(config.min_range_m) +
              " and max_range_m = " + text_of(config.max_range_m) + "."};
}

SweepRefusal not_a_sweep(const std::string& field,
                         const TimeRange& range,
                         const std::string& unit) {
  const std::string values = "Field '" + field + "' ranges from " + text_of(range.lowest) + " to " +
                             text_of(range.highest) + " over the cloud";
  if (range.span() == 0.0) {
    return {"points_without_time",
            values +
                ": all points have the same time. Expected a time for each point; set "
                "point_time to azimuth or snapshot for a sensor without."};
  }
  return {"implausible_point_times",
          values + ", expected a sweep of " + text_of(kShortestSweep_s) + " to " +
              text_of(kLongestSweep_s) + " s with time_unit = " + unit + "."};
}

std::string describe_origin(TimeOrigin origin, const std::string& stamp_is) {
  if (stamp_is != "auto") {
    return "with the cloud's stamp taken for the " + stamp_is + " of the sweep, as configured";
  }
  switch (origin) {
    case TimeOrigin::kStamp:
      return "counted from the cloud's stamp";
    case TimeOrigin::kEpoch:
      return "absolute, on the clock of the cloud's stamp";
    case TimeOrigin::kForeignClock:
      break;
  }
  return "on a clock that is not the stamp's, so the stamp is taken for the begin of the sweep";
}

std::string describe_place(TimeOrigin origin, const TimeRange& range) {
  if (origin != TimeOrigin::kStamp) {
    return "";
  }
  if (range.lowest >= 0.0) {
    return "; the stamp is the begin of the sweep";
  }
  return range.highest <= 0.0 ? "; the stamp is the end of the sweep"
                              : "; the stamp lies within the sweep";
}

}  // namespace

SweepDecoder::SweepDecoder(const SweepTimingConfig& config) : config_(config) {
  require_choice("point_time", config.point_time, {"field", "azimuth", "snapshot"});
  require_choice("stamp_is", config.stamp_is, {"auto", "begin", "middle", "end"});
  require_choice("time_unit", config.time_unit, {"auto", "s", "ms", "us", "ns"});
}

std::variant<Sweep, SweepRefusal> SweepDecoder::decode(const PointCloudMessage& cloud,
                                                       Events& events) {
  if (cloud.stamp_ns < 0 || cloud.stamp_ns > kLatestStamp_ns) {
    return SweepRefusal{"implausible_stamp",
                        "The cloud's stamp is " + std::to_string(cloud.stamp_ns) +
                            " ns, expected 0 to " + std::to_string(kLatestStamp_ns) + "."};
  }
  CloudLayout layout;
  const bool by_field = config_.point_time == "field";
  if (auto refusal = find_layout(cloud, by_field ? config_.time_field : "", layout)) {
    return *refusal;
  }
  DecodedPoints decoded = read_points(cloud, layout, config_);
  if (decoded.points.empty()) {
    return no_usable_points(decoded, config_);
  }
  Sweep sweep;
  sweep.points = std::move(decoded.points);
  sweep.points_received = decoded.received;
  sweep.points_refused = decoded.received - sweep.points.size();
  if (by_field) {
    if (auto refusal = time_by_field(cloud, decoded, sweep, events)) {
      return *refusal;
    }
  } else if (config_.point_time == "azimuth") {
    time_by_azimuth(config_, cloud.stamp_ns, sweep);
  } else {
    time_by_snapshot(cloud.stamp_ns, sweep);
  }
  const Nanoseconds offset_ns = from_seconds(config_.time_offset_s);
  sweep.begin_ns += offset_ns;
  sweep.end_ns += offset_ns;
  return sweep;
}

std::optional<SweepRefusal> SweepDecoder::time_by_field(const PointCloudMessage& cloud,
                                                        const DecodedPoints& decoded,
                                                        Sweep& sweep,
                                                        Events& events) {
  std::optional<double> known_unit_s = unit_of(config_.time_unit);
  if (!known_unit_s && unit_s_ && is_plausible(decoded.kept, *unit_s_)) {
    known_unit_s = unit_s_;
  }
  const auto meaning = detect_time_meaning(decoded.kept, cloud.stamp_ns, known_unit_s);
  if (!meaning) {
    return not_a_sweep(decoded.layout->time_field, decoded.kept, config_.time_unit);
  }
  unit_s_ = meaning->unit_s;

  const bool relative = meaning->origin == TimeOrigin::kStamp;
  const bool all_are_sane = is_plausible(decoded.all, meaning->unit_s);
  const TimeRange& range = relative && all_are_sane ? decoded.all : decoded.kept;
  const auto time = [&](double value) {
    return time_of(value, *meaning, range, cloud.stamp_ns, config_.stamp_is);
  };
  sweep.begin_ns = time(decoded.kept.lowest);
  sweep.end_ns = time(decoded.kept.highest);
  const double before_first = decoded.kept.lowest - decoded.first_time;
  for (TimedPoint& point : sweep.points) {
    point.time_s = static_cast<float>((point.time_s - before_first) * meaning->unit_s);
  }
  announce(cloud.stamp_ns,
           "Point times: field '" + decoded.layout->time_field + "' (" +
               type_name(static_cast<std::uint8_t>(decoded.layout->time->type)) + ") in " +
               name_of_unit(meaning->unit_s) + ", " +
               describe_origin(meaning->origin, config_.stamp_is),
           config_.stamp_is == "auto" ? describe_place(meaning->origin, range) : "",
           events);
  return std::nullopt;
}

void SweepDecoder::announce(Nanoseconds stamp_ns,
                            const std::string& meaning,
                            const std::string& details,
                            Events& events) {
  if (meaning == announced_) {
    return;
  }
  const bool is_change = !announced_.empty();
  announced_ = meaning;
  events.push_back({is_change ? Severity::kWarning : Severity::kInfo,
                    stamp_ns,
                    is_change ? "point_times_changed" : "point_times_detected",
                    meaning + details + "."});
}

}  // namespace trigpoint::lio_mapper
