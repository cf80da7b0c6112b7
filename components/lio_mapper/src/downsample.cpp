// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "downsample.hpp"

#include "plane_fit.hpp"
#include "voxel_key.hpp"
#include <Eigen/Eigenvalues>

#include <cstdint>
#include <limits>
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

/// Fewer points tell nothing of how they scatter.
constexpr int kFewestOfSurface = 6;
/// One that scatters by less along an axis (standard deviation) does so by noise.
constexpr double kThin_m = 0.03;

struct Voxel {
  Eigen::Vector3d centre_m;
  Moments offsets;           ///< of its points from the centre, m
  Eigen::Vector3f target_m;  ///< the point nearest to it is kept
  float least_distance2_m2{std::numeric_limits<float>::max()};
};

/// The centre, but the mean of the points along the axes along which they only scatter by noise.
Eigen::Vector3f target_of(const Voxel& voxel) {
  Eigen::Vector3d target_m = voxel.centre_m;
  if (voxel.offsets.count >= kFewestOfSurface) {
    const Eigen::Vector3d mean_m = voxel.offsets.sum.matrix() / voxel.offsets.count;
    const Eigen::Matrix3d covariance_m2 =
        voxel.offsets.outer() / voxel.offsets.count - mean_m * mean_m.transpose();
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
    axes.computeDirect(covariance_m2);
    for (int i = 0; i < 3 && axes.eigenvalues()[i] < kThin_m * kThin_m; ++i) {
      const auto axis = axes.eigenvectors().col(i);
      target_m += axis.dot(mean_m) * axis;
    }
  }
  return target_m.cast<float>();
}

template <typename Point>
std::vector<Point> keep_one_a_voxel(const std::vector<Point>& points, double voxel_m) {
  if (!(voxel_m > 0.0)) {
    return points;
  }
  constexpr std::uint32_t kNone = 0xFFFFFFFF;
  const double inverse_voxel_per_m = 1.0 / voxel_m;
  VoxelNumbering numbering;
  std::vector<Voxel> voxels;
  std::vector<std::uint32_t> numbers(points.size(), kNone);
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector3d p(points[i].x, points[i].y, points[i].z);
    if (!voxel_index_fits(p.x(), p.y(), p.z(), inverse_voxel_per_m)) {
      continue;
    }
    const VoxelIndex index = voxel_index(p.x(), p.y(), p.z(), inverse_voxel_per_m);
    numbers[i] = numbering.number_of(voxel_key(index));
    if (numbers[i] == voxels.size()) {
      voxels.emplace_back().centre_m =
          voxel_m * Eigen::Vector3d(index.x + 0.5, index.y + 0.5, index.z + 0.5);
    }
    Voxel& voxel = voxels[numbers[i]];
    voxel.offsets.add(p - voxel.centre_m);
  }
  for (Voxel& voxel : voxels) {
    voxel.target_m = target_of(voxel);
  }
  std::vector<Point> kept(voxels.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (numbers[i] == kNone) {
      continue;
    }
    Voxel& voxel = voxels[numbers[i]];
    const Eigen::Vector3f p(points[i].x, points[i].y, points[i].z);
    const float distance2_m2 = (p - voxel.target_m).squaredNorm();
    if (distance2_m2 < voxel.least_distance2_m2) {
      voxel.least_distance2_m2 = distance2_m2;
      kept[numbers[i]] = points[i];
    }
  }
  return kept;
}

}  // namespace

PointCloud downsample(const PointCloud& points, double voxel_m) {
  return keep_one_a_voxel(points, voxel_m);
}

std::vector<TimedPoint> downsample(const std::vector<TimedPoint>& points, double voxel_m) {
  return keep_one_a_voxel(points, voxel_m);
}

}  // namespace trigpoint::lio_mapper
