// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "cloud_layout.hpp"

#include <array>
#include <bit>

namespace trigpoint::lio_mapper {
namespace {

static_assert(std::endian::native == std::endian::little, "values are copied as they lie");

struct TypeInfo {
  const char* name;
  std::uint32_t size;
};

/// By code; 0 is no type.
constexpr std::array<TypeInfo, 9> kTypes{{{"", 0},
                                          {"int8", 1},
                                          {"uint8", 1},
                                          {"int16", 2},
                                          {"uint16", 2},
                                          {"int32", 4},
                                          {"uint32", 4},
                                          {"float32", 4},
                                          {"float64", 8}}};

/// Velodyne; Ouster; Hesai, Robosense and Livox; Livox' custom message; other converters.
constexpr std::array kTimeNames{"time",
                                "t",
                                "timestamp",
                                "offset_time",
                                "time_offset",
                                "time_stamp"};
constexpr std::array kIntensityNames{"intensity", "reflectivity"};

/// A size that is certainly wrong, and keeps products of sizes far from overflow.
constexpr std::uint64_t kMostPoints = 100'000'000;

std::string number(std::uint64_t value) {
  return std::to_string(value);
}

const PointField* find_field(const PointCloudMessage& cloud, const std::string& name) {
  for (const PointField& field : cloud.fields) {
    if (field.name == name) {
      return &field;
    }
  }
  return nullptr;
}

template <std::size_t N>
const PointField* find_first(const PointCloudMessage& cloud,
                             const std::array<const char*, N>& names) {
  for (const char* name : names) {
    if (const PointField* field = find_field(cloud, name)) {
      return field;
    }
  }
  return nullptr;
}

std::string names_of_fields(const PointCloudMessage& cloud) {
  constexpr std::size_t kShown = 20;
  std::string names;
  for (std::size_t i = 0; i < cloud.fields.size() && i < kShown; ++i) {
    names += (i == 0 ? "" : " ") + cloud.fields[i].name.substr(0, 40);
  }
  return names.empty() ? "none" : names;
}

std::optional<SweepRefusal> check_field(const PointField& field,
                                        std::uint32_t point_step,
                                        FieldReader& reader) {
  if (field.datatype < 1 || field.datatype >= kTypes.size()) {
    return SweepRefusal{"bad_field_type",
                        "Field '" + field.name + "' has datatype " + number(field.datatype) +
                            ", expected a code from 1 (int8) to 8 (float64)."};
  }
  const std::uint64_t end = std::uint64_t{field.offset} + kTypes[field.datatype].size;
  if (end > point_step) {
    return SweepRefusal{"field_outside_point",
                        "Field '" + field.name + "' (" + type_name(field.datatype) + " at offset " +
                            number(field.offset) + ") ends at byte " + number(end) +
                            ", expected at most point_step = " + number(point_step) + "."};
  }
  reader = {field.offset, static_cast<FieldType>(field.datatype)};
  return std::nullopt;
}

std::optional<SweepRefusal> check_sizes(const PointCloudMessage& cloud, CloudLayout& layout) {
  if (cloud.is_bigendian) {
    return SweepRefusal{"big_endian", "is_bigendian is true, expected little-endian data."};
  }
  const std::uint64_t points = std::uint64_t{cloud.width} * cloud.height;
  if (points == 0) {
    return SweepRefusal{"cloud_without_points",
                        "width x height is " + number(cloud.width) + " x " + number(cloud.height) +
                            ", expected at least one point."};
  }
  if (points > kMostPoints) {
    return SweepRefusal{"cloud_too_large",
                        "width x height is " + number(cloud.width) + " x " + number(cloud.height) +
                            ", expected at most " + number(kMostPoints) + " points."};
  }
  const std::uint64_t row_bytes = std::uint64_t{cloud.width} * cloud.point_step;
  // A single row needs no row_step, and some drivers leave it 0.
  layout.row_step = cloud.height == 1 && cloud.row_step == 0 ? row_bytes : cloud.row_step;
  if (layout.row_step < row_bytes) {
    return SweepRefusal{"bad_row_step",
                        "row_step is " + number(cloud.row_step) +
                            ", expected at least width x point_step = " + number(row_bytes) + "."};
  }
  const std::uint64_t bytes = layout.row_step * cloud.height;
  if (bytes > cloud.data.size()) {
    return SweepRefusal{"truncated_data",
                        "data has " + number(cloud.data.size()) +
                            " bytes, expected row_step x height = " + number(bytes) + "."};
  }
  return std::nullopt;
}

std::optional<SweepRefusal> find_coordinate(const PointCloudMessage& cloud,
                                            const std::string& name,
                                            FieldReader& reader) {
  const PointField* field = find_field(cloud, name);
  if (field == nullptr) {
    return SweepRefusal{"field_missing",
                        "Field '" + name + "' is missing, expected x, y and z; the cloud has: " +
                            names_of_fields(cloud) + "."};
  }
  return check_field(*field, cloud.point_step, reader);
}

std::optional<SweepRefusal> find_time(const PointCloudMessage& cloud,
                                      const std::string& name,
                                      CloudLayout& layout) {
  const PointField* field =
      name == "auto" ? find_first(cloud, kTimeNames) : find_field(cloud, name);
  if (field == nullptr) {
    const std::string wanted =
        name == "auto" ? "time, t, timestamp, offset_time, time_offset or time_stamp" : name;
    return SweepRefusal{"points_without_time",
                        "The points have no time of their own: expected a field " + wanted +
                            ", the cloud has: " + names_of_fields(cloud) +
                            ". Set time_field, or point_time to azimuth or snapshot."};
  }
  layout.time_field = field->name;
  return check_field(*field, cloud.point_step, layout.time.emplace());
}

}  // namespace

std::string type_name(std::uint8_t datatype) {
  return datatype >= 1 && datatype < kTypes.size() ? kTypes[datatype].name
                                                   : "code " + number(datatype);
}

std::optional<SweepRefusal> find_layout(const PointCloudMessage& cloud,
                                        const std::string& time_field,
                                        CloudLayout& layout) {
  layout = {};
  std::optional<SweepRefusal> refusal = check_sizes(cloud, layout);
  refusal = refusal ? refusal : find_coordinate(cloud, "x", layout.x);
  refusal = refusal ? refusal : find_coordinate(cloud, "y", layout.y);
  refusal = refusal ? refusal : find_coordinate(cloud, "z", layout.z);
  if (const PointField* field = find_first(cloud, kIntensityNames); !refusal && field != nullptr) {
    refusal = check_field(*field, cloud.point_step, layout.intensity.emplace());
  }
  if (!refusal && !time_field.empty()) {
    refusal = find_time(cloud, time_field, layout);
  }
  return refusal;
}

}  // namespace trigpoint::lio_mapper
