// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "downsample.hpp"

#include "voxel_key.hpp"

#include <bit>
#include <cmath>
#include <cstdint>

namespace trigpoint::lio_mapper {
namespace {

/// Open addressing without removal, made for one pass: numbers voxels in the order of their coming.
class VoxelNumbering {
 public:
  explicit VoxelNumbering(std::size_t most_voxels)
      : slots_(std::bit_ceil(2 * most_voxels + 1)), mask_(slots_.size() - 1) {}

  /// The voxel's number; `next` is given to it when it is new.
  std::uint32_t number_of(VoxelKey key, std::uint32_t next) {
    std::size_t i = VoxelKeyHash{}(key)&mask_;
    while (slots_[i].number != kFree && slots_[i].key != key) {
      i = (i + 1) & mask_;
    }
    if (slots_[i].number == kFree) {
      slots_[i] = {key, next};
    }
    return slots_[i].number;
  }

 private:
  static constexpr std::uint32_t kFree = 0xFFFFFFFF;

  struct Slot {
    VoxelKey key{0};
    std::uint32_t number{kFree};
  };

  std::vector<Slot> slots_;
  std::size_t mask_;
};

template <typename Point>
std::vector<Point> keep_centre_most(const std::vector<Point>& points, double voxel_m) {
  if (!(voxel_m > 0.0)) {
    return points;
  }
  const double inverse_voxel_per_m = 1.0 / voxel_m;
  VoxelNumbering voxels(points.size());
  std::vector<Point> kept;
  std::vector<double> distances2;  // of `kept` from their centres, in voxels
  for (const Point& point : points) {
    if (!voxel_index_fits(point.x, point.y, point.z, inverse_voxel_per_m)) {
      continue;
    }
    const VoxelIndex index = voxel_index(point.x, point.y, point.z, inverse_voxel_per_m);
    const double dx = point.x * inverse_voxel_per_m - (index.x + 0.5);
    const double dy = point.y * inverse_voxel_per_m - (index.y + 0.5);
    const double dz = point.z * inverse_voxel_per_m - (index.z + 0.5);
    const double distance2 = dx * dx + dy * dy + dz * dz;
    const std::uint32_t number =
        voxels.number_of(voxel_key(index), static_cast<std::uint32_t>(kept.size()));
    if (number == kept.size()) {
      kept.push_back(point);
      distances2.push_back(distance2);
    } else if (distance2 < distances2[number]) {
      kept[number] = point;
      distances2[number] = distance2;
    }
  }
  return kept;
}

}  // namespace

PointCloud downsample(const PointCloud& points, double voxel_m) {
  return keep_centre_most(points, voxel_m);
}

std::vector<TimedPoint> downsample(const std::vector<TimedPoint>& points, double voxel_m) {
  return keep_centre_most(points, voxel_m);
}

}  // namespace trigpoint::lio_mapper
