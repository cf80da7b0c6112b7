// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "downsample.hpp"

#include "voxel_key.hpp"

#include <cmath>
#include <cstdint>
#include <utility>

namespace trigpoint::lio_mapper {
namespace {

/// Open addressing without removal, made for one pass: numbers voxels in the order of their coming.
/// Begins small, because it is fast only while it fits into the cache.
class VoxelNumbering {
 public:
  VoxelNumbering() : slots_(kFirstSlots), mask_(slots_.size() - 1) {}

  /// The voxel's number; the next one is given to it when it is new.
  std::uint32_t number_of(VoxelKey key) {
    if (2 * static_cast<std::size_t>(count_) >= slots_.size()) {
      grow();
    }
    Slot& slot = slot_of(key);
    if (slot.number == kFree) {
      slot = {key, count_++};
    }
    return slot.number;
  }

 private:
  static constexpr std::uint32_t kFree = 0xFFFFFFFF;
  static constexpr std::size_t kFirstSlots = 8192;

  struct Slot {
    VoxelKey key{0};
    std::uint32_t number{kFree};
  };

  Slot& slot_of(VoxelKey key) {
    std::size_t i = VoxelKeyHash{}(key)&mask_;
    while (slots_[i].number != kFree && slots_[i].key != key) {
      i = (i + 1) & mask_;
    }
    return slots_[i];
  }

  void grow() {
    const std::vector<Slot> old = std::exchange(slots_, std::vector<Slot>(2 * slots_.size()));
    mask_ = slots_.size() - 1;
    for (const Slot& slot : old) {
      if (slot.number != kFree) {
        slot_of(slot.key) = slot;
      }
    }
  }

  std::vector<Slot> slots_;
  std::size_t mask_;
  std::uint32_t count_{0};
};

template <typename Point>
std::vector<Point> keep_centre_most(const std::vector<Point>& points, double voxel_m) {
  if (!(voxel_m > 0.0)) {
    return points;
  }
  const double inverse_voxel_per_m = 1.0 / voxel_m;
  VoxelNumbering voxels;
  std::vector<Point> kept;
  std::vector<float> distances2;  // of `kept` from their centres, in voxels
  for (const Point& point : points) {
    if (!voxel_index_fits(point.x, point.y, point.z, inverse_voxel_per_m)) {
      continue;
    }
    const VoxelIndex index = voxel_index(point.x, point.y, point.z, inverse_voxel_per_m);
    const double dx = point.x * inverse_voxel_per_m - (index.x + 0.5);
    const double dy = point.y * inverse_voxel_per_m - (index.y + 0.5);
    const double dz = point.z * inverse_voxel_per_m - (index.z + 0.5);
    const auto distance2 = static_cast<float>(dx * dx + dy * dy + dz * dz);
    const std::uint32_t number = voxels.number_of(voxel_key(index));
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
