// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "point_codec.hpp"

#include <zstd.h>

#include <bit>
#include <cmath>
#include <cstring>
#include <memory>
#include <stdexcept>
#include <string>

namespace trigpoint::lio_mapper {

static_assert(std::endian::native == std::endian::little, "stored numbers are little-endian");

namespace {

constexpr std::size_t kPlanes = 16;  // 4 bytes each of x, y, z, intensity
constexpr std::size_t kHead = 4;     // number of points
constexpr int kLevel = 3;            // higher ones gain 2 % for several times the time
constexpr double kFarthest_m = 1e6;
/// No sweep has more points; keeps a damaged length from filling the memory.
constexpr std::size_t kMostCodedPoints = 50'000'000;

std::int32_t steps_of(float coordinate_m) {
  if (!(std::abs(static_cast<double>(coordinate_m)) < kFarthest_m)) {
    throw std::runtime_error("a point of the cloud is not finite or beyond 1000 km");
  }
  return static_cast<std::int32_t>(std::lround(coordinate_m / kStoredResolution_m));
}

/// Small numbers of either sign become small numbers without one: 0, -1, 1, -2 to 0, 1, 2, 3.
std::uint32_t folded(std::uint32_t difference) {
  return (difference << 1U) ^ (0U - (difference >> 31U));
}

std::uint32_t unfolded(std::uint32_t code) {
  return (code >> 1U) ^ (0U - (code & 1U));
}

/// The four bytes of word `i` go to four planes of `count` bytes.
void scatter(std::uint32_t word, std::uint8_t* plane, std::size_t i, std::size_t count) {
  for (std::size_t byte = 0; byte < 4; ++byte) {
    plane[byte * count + i] = static_cast<std::uint8_t>(word >> (8U * byte));
  }
}

std::uint32_t gather(const std::uint8_t* plane, std::size_t i, std::size_t count) {
  std::uint32_t word = 0;
  for (std::size_t byte = 0; byte < 4; ++byte) {
    word |= static_cast<std::uint32_t>(plane[byte * count + i]) << (8U * byte);
  }
  return word;
}

std::vector<std::uint8_t> planes_of(const PointCloud& points) {
  const std::size_t count = points.size();
  std::vector<std::uint8_t> planes(kPlanes * count);
  std::uint32_t before[3] = {0, 0, 0};
  for (std::size_t i = 0; i < count; ++i) {
    const float coordinates[3] = {points[i].x, points[i].y, points[i].z};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto steps = static_cast<std::uint32_t>(steps_of(coordinates[axis]));
      scatter(folded(steps - before[axis]), planes.data() + 4 * axis * count, i, count);
      before[axis] = steps;
    }
    scatter(
        std::bit_cast<std::uint32_t>(points[i].intensity), planes.data() + 12 * count, i, count);
  }
  return planes;
}

PointCloud points_of(const std::vector<std::uint8_t>& planes) {
  const std::size_t count = planes.size() / kPlanes;
  PointCloud points(count);
  std::uint32_t steps[3] = {0, 0, 0};
  for (std::size_t i = 0; i < count; ++i) {
    float coordinates[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      steps[axis] += unfolded(gather(planes.data() + 4 * axis * count, i, count));
      coordinates[axis] =
          static_cast<float>(static_cast<std::int32_t>(steps[axis]) * kStoredResolution_m);
    }
    points[i] = {coordinates[0],
                 coordinates[1],
                 coordinates[2],
                 std::bit_cast<float>(gather(planes.data() + 12 * count, i, count))};
  }
  return points;
}

/// Contexts are costly to make and not to be shared by threads.
ZSTD_CCtx* compressor() {
  thread_local const std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)> context = [] {
    ZSTD_CCtx* made = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(made, ZSTD_c_compressionLevel, kLevel);
    ZSTD_CCtx_setParameter(made, ZSTD_c_checksumFlag, 1);
    return std::unique_ptr<ZSTD_CCtx, std::size_t (*)(ZSTD_CCtx*)>(made, ZSTD_freeCCtx);
  }();
  return context.get();
}

}  // namespace

std::vector<std::uint8_t> pack_points(const PointCloud& points) {
  const std::vector<std::uint8_t> planes = planes_of(points);
  std::vector<std::uint8_t> packed(kHead + ZSTD_compressBound(planes.size()));
  const auto count = static_cast<std::uint32_t>(points.size());
  std::memcpy(packed.data(), &count, kHead);
  const std::size_t size = ZSTD_compress2(
      compressor(), packed.data() + kHead, packed.size() - kHead, planes.data(), planes.size());
  if (ZSTD_isError(size) != 0) {
    throw std::runtime_error(std::string("cannot be compressed: ") + ZSTD_getErrorName(size));
  }
  packed.resize(kHead + size);
  return packed;
}

std::size_t packed_count(const void* bytes, std::size_t size) {
  if (size < kHead) {
    throw std::runtime_error("has " + std::to_string(size) + " bytes, at least 4 expected");
  }
  std::uint32_t count = 0;
  std::memcpy(&count, bytes, kHead);
  return count;
}

PointCloud unpack_points(const void* bytes, std::size_t size) {
  const std::size_t count = packed_count(bytes, size);
  const auto* frame = static_cast<const std::uint8_t*>(bytes) + kHead;
  const std::size_t planes_size = kPlanes * count;
  if (count > kMostCodedPoints || ZSTD_getFrameContentSize(frame, size - kHead) != planes_size) {
    throw std::runtime_error("does not hold the " + std::to_string(count) +
                             " points that it names");
  }
  std::vector<std::uint8_t> planes(planes_size);
  const std::size_t got = ZSTD_decompress(planes.data(), planes.size(), frame, size - kHead);
  if (ZSTD_isError(got) != 0) {
    throw std::runtime_error(std::string("is damaged: ") + ZSTD_getErrorName(got));
  }
  return points_of(planes);
}

}  // namespace trigpoint::lio_mapper
