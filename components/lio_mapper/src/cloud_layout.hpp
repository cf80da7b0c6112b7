// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/measurements.hpp"

#include "sweep.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::lio_mapper {

/// The codes of sensor_msgs/PointField.
enum class FieldType : std::uint8_t {
  kInt8 = 1,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kFloat32,
  kFloat64
};

/// Where a value lies in a point and how it is written. Offsets are not checked here.
struct FieldReader {
  std::uint32_t offset{0};
  FieldType type{FieldType::kFloat32};

  double operator()(const std::uint8_t* point) const {
    const std::uint8_t* const bytes = point + offset;
    switch (type) {
      case FieldType::kFloat32:
        return value<float>(bytes);
      case FieldType::kFloat64:
        return value<double>(bytes);
      case FieldType::kUint32:
        return value<std::uint32_t>(bytes);
      case FieldType::kInt32:
        return value<std::int32_t>(bytes);
      case FieldType::kUint16:
        return value<std::uint16_t>(bytes);
      case FieldType::kInt16:
        return value<std::int16_t>(bytes);
      case FieldType::kUint8:
        return value<std::uint8_t>(bytes);
      case FieldType::kInt8:
        return value<std::int8_t>(bytes);
    }
    return kNaN;
  }

 private:
  template <typename T>
  static T value(const std::uint8_t* bytes) {
    T result;
    std::memcpy(&result, bytes, sizeof result);
    return result;
  }
};

/// What the decoder reads of a cloud. Every reader stays within every point of the data.
struct CloudLayout {
  FieldReader x;
  FieldReader y;
  FieldReader z;
  std::optional<FieldReader> intensity;
  std::optional<FieldReader> time;
  std::string time_field;  ///< empty without `time`
  std::uint64_t row_step{0};
};

/// Finds the fields and checks the description against itself and the data. `time_field` is a name,
/// "auto" for the first of the names that drivers use, or empty for none.
/// On refusal nothing of the cloud may be read.
std::optional<SweepRefusal> find_layout(const PointCloudMessage& cloud,
                                        const std::string& time_field,
                                        CloudLayout& layout);

/// "float32", or "code 42" for what is no type.
std::string type_name(std::uint8_t datatype);

}  // namespace trigpoint::lio_mapper
