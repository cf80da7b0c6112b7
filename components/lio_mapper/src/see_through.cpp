// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/see_through.hpp"

#include "plane_fit.hpp"
#include "voxel_key.hpp"
#include "workers.hpp"
#include <tsl/robin_map.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

namespace trigpoint::lio_mapper {

using Eigen::Vector3d;

namespace {

constexpr double kPixel_rad = std::numbers::pi / 180.0;
constexpr int kColumns = 360;
constexpr int kRows = 180;
constexpr double kNearest_m = 1.0;  // the robot itself
constexpr double kBlock_m = 8.0;    // voxels are kept by blocks, to find those near a scan
/// Of the plane through a voxel's neighbourhood.
constexpr double kFlat = 0.1;       // smallest over middle eigenvalue
constexpr double kOnPlane_m = 0.1;  // of the voxel's own mean
constexpr int kFewestForPlane = 6;
/// A single ring on the ground is a line; so is one across a walker, who has ground below.
constexpr double kUprightSigma_m = 0.06;
constexpr double kLeastBelow_m = 0.4;
constexpr double kMostBelow_m = 2.4;
/// Next to a moving voxel less evidence is enough.
constexpr std::uint16_t kFewHits = 3;
constexpr std::size_t kThreads = 2;
constexpr std::size_t kNobody = ~std::size_t{0};

struct Voxel {
  VoxelIndex index;
  std::uint16_t hits{0};   ///< scans that have a point in it
  std::uint16_t views{0};  ///< scans that look through it
  std::uint32_t count{0};
  std::size_t last_scan{kNobody};
  /// Sums about the voxel's centre, m and m^2.
  Eigen::Array3f sum{Eigen::Array3f::Zero()};
  Eigen::Array3f squares{Eigen::Array3f::Zero()};
  Eigen::Array3f products{Eigen::Array3f::Zero()};
  /// kFloor: too few points to tell, and perhaps ground, which every ray skims.
  enum class Shape : std::uint8_t { kUnknown, kPlane, kNone, kFloor } shape{Shape::kUnknown};
  bool moving{false};
  Eigen::Vector3f normal{Eigen::Vector3f::Zero()};
};

/// Voxels near each other, and where their points are: most are asked for no more than that.
struct Block {
  std::vector<std::uint32_t> voxels;
  std::vector<Eigen::Vector3f> means_m;  ///< about the block's first voxel; of the second pass
  Vector3d origin_m{Vector3d::Zero()};
};

struct Ray {
  Eigen::Vector3f direction{Eigen::Vector3f::Zero()};
  float range_m{0.0F};  ///< 0: none
};

/// May be a turn too small or too large.
int column_of(double azimuth_rad) {
  return static_cast<int>(std::floor((azimuth_rad + std::numbers::pi) / kPixel_rad));
}

int row_of(double elevation_rad) {
  const double row = std::floor((elevation_rad + 0.5 * std::numbers::pi) / kPixel_rad);
  return std::clamp(static_cast<int>(row), 0, kRows - 1);
}

std::uint16_t one_more(std::uint16_t count) {
  return count == UINT16_MAX ? count : static_cast<std::uint16_t>(count + 1);
}

}  // namespace

struct SeeThrough::Impl {
  explicit Impl(const SeeThroughOptions& chosen)
      : options(chosen), inverse_voxel_per_m(1.0 / chosen.voxel_m) {}

  Vector3d centre_of(const VoxelIndex& i) const {
    return options.voxel_m * (Vector3d(i.x, i.y, i.z) + Vector3d::Constant(0.5));
  }

  Vector3d mean_of(const Voxel& voxel) const {
    return centre_of(voxel.index) +
           (voxel.sum / static_cast<float>(voxel.count)).matrix().cast<double>();
  }

  const Voxel* find(const Vector3d& p) const {
    if (!voxel_index_fits(p.x(), p.y(), p.z(), inverse_voxel_per_m)) {
      return nullptr;
    }
    const auto found = index.find(voxel_key(voxel_index(p.x(), p.y(), p.z(), inverse_voxel_per_m)));
    return found == index.end() ? nullptr : &voxels[found->second];
  }

  Voxel* find_or_create(const Vector3d& p) {
    if (!voxel_index_fits(p.x(), p.y(), p.z(), inverse_voxel_per_m)) {
      return nullptr;
    }
    const VoxelIndex i = voxel_index(p.x(), p.y(), p.z(), inverse_voxel_per_m);
    const auto [place, is_new] =
        index.try_emplace(voxel_key(i), static_cast<std::uint32_t>(voxels.size()));
    if (is_new) {
      blocks[block_key_of(p)].voxels.push_back(static_cast<std::uint32_t>(voxels.size()));
      voxels.emplace_back().index = i;
    }
    return &voxels[place->second];
  }

  static VoxelKey block_key_of(const Vector3d& p) {
    return voxel_key(voxel_index(p.x(), p.y(), 0.0, 1.0 / kBlock_m));
  }

  /// Moments of a voxel about the centre of another.
  Moments moments_about(const Voxel& voxel, const Vector3d& centre_m) const {
    const Eigen::Array3d d = (centre_of(voxel.index) - centre_m).array();
    const Eigen::Array3d sum = voxel.sum.cast<double>();
    const auto n = static_cast<double>(voxel.count);
    const auto turned = [](const Eigen::Array3d& a) { return Eigen::Array3d(a[1], a[2], a[0]); };
    Moments moments;
    moments.count = static_cast<int>(voxel.count);
    moments.sum = sum + n * d;
    moments.squares = voxel.squares.cast<double>() + 2.0 * d * sum + n * d * d;
    moments.products =
        voxel.products.cast<double>() + d * turned(sum) + turned(d) * sum + n * d * turned(d);
    return moments;
  }

  /// The voxels that exist of the 27 around a place, itself included.
  template <typename Visit>
  void for_each_around(const VoxelIndex& i, const Visit& visit) const {
    for (int dx = -1; dx <= 1; ++dx) {
      for (int dy = -1; dy <= 1; ++dy) {
        for (int dz = -1; dz <= 1; ++dz) {
          const auto found = index.find(voxel_key({i.x + dx, i.y + dy, i.z + dz}));
          if (found != index.end()) {
            visit(found->second);
          }
        }
      }
    }
  }

  void fit(Voxel& voxel) {
    const Vector3d centre_m = centre_of(voxel.index);
    Moments moments;
    for_each_around(voxel.index,
                    [&](std::uint32_t near) { moments += moments_about(voxels[near], centre_m); });
    voxel.shape = Voxel::Shape::kNone;
    const std::optional<PlaneFit> plane =
        moments.count < kFewestForPlane ? std::nullopt : fit_plane(moments);
    if (plane && plane->eigenvalues[0] < kFlat * plane->eigenvalues[1] &&
        std::abs(plane->normal.dot(mean_of(voxel) - centre_m - plane->centroid)) < kOnPlane_m) {
      voxel.shape = Voxel::Shape::kPlane;
      voxel.normal = plane->normal.cast<float>();
    } else if (height_of(moments) < kUprightSigma_m && !stands_on_something(voxel.index)) {
      voxel.shape = Voxel::Shape::kFloor;
    }
  }

  static double height_of(const Moments& moments) {
    const double n = moments.count;
    const double mean = moments.sum[2] / n;
    return std::sqrt(std::max(0.0, moments.squares[2] / n - mean * mean));
  }

  /// Whether anything was seen some way below.
  bool stands_on_something(const VoxelIndex& i) const {
    const int nearest = static_cast<int>(std::ceil(kLeastBelow_m * inverse_voxel_per_m));
    const int farthest = static_cast<int>(std::ceil(kMostBelow_m * inverse_voxel_per_m));
    for (int dz = nearest; dz <= farthest; ++dz) {
      for (int dx = -1; dx <= 1; ++dx) {
        for (int dy = -1; dy <= 1; ++dy) {
          if (index.find(voxel_key({i.x + dx, i.y + dy, i.z - dz})) != index.end()) {
            return true;
          }
        }
      }
    }
    return false;
  }

  /// The nearest point of each pixel: what is in front decides.
  void draw(const PointCloud& points, const Vector3d& origin_m) {
    image.assign(static_cast<std::size_t>(kColumns) * kRows, Ray{});
    for (const PointXyzi& point : points) {
      const Vector3d v = point.position().cast<double>() - origin_m;
      const double range_m = v.norm();
      if (!(range_m > kNearest_m)) {
        continue;
      }
      const int column = column_of(std::atan2(v.y(), v.x())) % kColumns;
      Ray& ray = pixel(column, row_of(std::asin(v.z() / range_m)));
      if (ray.range_m == 0.0F || range_m < ray.range_m) {
        ray = {(v / range_m).cast<float>(), static_cast<float>(range_m)};
      }
    }
  }

  Ray& pixel(int column, int row) {
    return image[static_cast<std::size_t>(row * kColumns + column)];
  }

  /// The margin behind a plane counts along its normal as well: range noise of skimming rays.
  bool goes_through(Voxel& voxel, const Vector3d& mean_m, const Ray& ray) {
    if (voxel.shape == Voxel::Shape::kUnknown) {
      fit(voxel);
    }
    if (voxel.shape != Voxel::Shape::kPlane) {
      return voxel.shape == Voxel::Shape::kNone;
    }
    const Vector3d normal = voxel.normal.cast<double>();
    const double sine = normal.dot(ray.direction.cast<double>());
    if (std::abs(sine) < options.least_incidence) {
      return false;
    }
    return ray.range_m > normal.dot(mean_m) / sine + options.margin_m;
  }

  /// Whether the scan looks through the voxel: a ray does, and none ends in it or before it. Only
  /// pixels that a ray within the radius may lie in are asked.
  bool is_looked_through(std::uint32_t voxel, const Eigen::Vector3f& mean_m, float range_m) {
    const auto radius_m = static_cast<float>(options.ray_radius_m);
    const float level_m = std::max(mean_m.head<2>().norm(), radius_m);
    const float azimuth = std::atan2(mean_m.y(), mean_m.x());
    const float elevation = std::atan2(mean_m.z(), level_m);
    const int first_row = row_of(elevation - radius_m / range_m);
    const int last_row = row_of(elevation + radius_m / range_m);
    const int first_column = column_of(azimuth - radius_m / level_m);
    const int last_column = column_of(azimuth + radius_m / level_m);
    bool through = false;
    for (int row = first_row; row <= last_row; ++row) {
      for (int column = first_column; column <= last_column; ++column) {
        const Ray& ray = pixel((column + kColumns) % kColumns, row);
        const float along_m = ray.direction.dot(mean_m);
        const float aside2 = range_m * range_m - along_m * along_m;
        if (ray.range_m == 0.0F || aside2 > radius_m * radius_m) {
          continue;
        }
        if (ray.range_m < along_m + static_cast<float>(options.margin_m)) {
          return false;
        }
        through = through || goes_through(voxels[voxel], mean_m.cast<double>(), ray);
      }
    }
    return through;
  }

  void look_at(const Block& block, const Vector3d& origin_map_m) {
    const Eigen::Vector3f origin_m = (origin_map_m - block.origin_m).cast<float>();
    const auto nearest2 = static_cast<float>(kNearest_m * kNearest_m);
    const auto farthest2 = static_cast<float>(options.range_m * options.range_m);
    for (std::size_t i = 0; i < block.voxels.size(); ++i) {
      const Eigen::Vector3f mean_m = block.means_m[i] - origin_m;
      const float range2 = mean_m.squaredNorm();
      if (range2 > nearest2 && range2 < farthest2 &&
          is_looked_through(block.voxels[i], mean_m, std::sqrt(range2))) {
        Voxel& voxel = voxels[block.voxels[i]];
        voxel.views = one_more(voxel.views);
      }
    }
  }

  void find_means() {
    for (auto block = blocks.begin(); block != blocks.end(); ++block) {
      Block& b = block.value();
      b.origin_m = centre_of(voxels[b.voxels.front()].index);
      for (const std::uint32_t voxel : b.voxels) {
        b.means_m.push_back((mean_of(voxels[voxel]) - b.origin_m).cast<float>());
      }
    }
    has_means = true;
  }

  std::vector<const Block*> blocks_near(const Vector3d& origin_m) const {
    const int reach = static_cast<int>(std::ceil(options.range_m / kBlock_m));
    std::vector<const Block*> near;
    for (int dx = -reach; dx <= reach; ++dx) {
      for (int dy = -reach; dy <= reach; ++dy) {
        const auto block = blocks.find(block_key_of(origin_m + kBlock_m * Vector3d(dx, dy, 0.0)));
        if (block != blocks.end()) {
          near.push_back(&block->second);
        }
      }
    }
    return near;
  }

  bool is_outvoted(const Voxel& voxel) const {
    return voxel.views >= options.least_views &&
           static_cast<double>(voxel.views) > options.views_per_hit * voxel.hits;
  }

  /// What little is known of a voxel beside a moving one.
  bool goes_along(const Voxel& voxel) const {
    return !voxel.moving && voxel.hits <= kFewHits && voxel.views >= 1 && voxel.views >= voxel.hits;
  }

  void spread_from(const Voxel& voxel, std::vector<std::uint32_t>& next) const {
    for_each_around(voxel.index, [&](std::uint32_t near) {
      if (goes_along(voxels[near])) {
        next.push_back(near);
      }
    });
  }

  SeeThroughOptions options;
  double inverse_voxel_per_m;
  std::vector<Voxel> voxels;
  tsl::robin_map<VoxelKey, std::uint32_t, VoxelKeyHash> index;
  tsl::robin_map<VoxelKey, Block, VoxelKeyHash> blocks;
  bool has_means{false};
  std::vector<Ray> image;
  Workers workers{kThreads};
  std::size_t scans{0};
  std::size_t moving{0};
};

SeeThrough::SeeThrough(const SeeThroughOptions& options) : impl_(std::make_unique<Impl>(options)) {}

SeeThrough::~SeeThrough() = default;

void SeeThrough::add(const PointCloud& points_map) {
  for (const PointXyzi& point : points_map) {
    const Vector3d p = point.position().cast<double>();
    Voxel* const voxel = impl_->find_or_create(p);
    if (voxel == nullptr) {
      continue;
    }
    const Eigen::Array3f d = (p - impl_->centre_of(voxel->index)).cast<float>().array();
    ++voxel->count;
    voxel->sum += d;
    voxel->squares += d * d;
    voxel->products += d * Eigen::Array3f(d[1], d[2], d[0]);
    if (voxel->last_scan != impl_->scans) {
      voxel->last_scan = impl_->scans;
      voxel->hits = one_more(voxel->hits);
    }
  }
  ++impl_->scans;
}

void SeeThrough::look(const PointCloud& points_map, const Vector3d& origin_map_m) {
  impl_->draw(points_map, origin_map_m);
  if (!impl_->has_means) {
    impl_->find_means();
  }
  const std::vector<const Block*> near = impl_->blocks_near(origin_map_m);
  impl_->workers.run(near.size(), [&](std::size_t i) {  // a voxel is of one block only
    impl_->look_at(*near[i], origin_map_m);
  });
}

void SeeThrough::decide() {
  std::vector<std::uint32_t> edge;
  for (std::uint32_t i = 0; i < impl_->voxels.size(); ++i) {
    impl_->voxels[i].moving = impl_->is_outvoted(impl_->voxels[i]);
    if (impl_->voxels[i].moving) {
      edge.push_back(i);
    }
  }
  impl_->moving = edge.size();
  while (!edge.empty()) {
    std::vector<std::uint32_t> next;
    for (const std::uint32_t i : edge) {
      impl_->spread_from(impl_->voxels[i], next);
    }
    std::erase_if(next,
                  [&](std::uint32_t i) { return std::exchange(impl_->voxels[i].moving, true); });
    impl_->moving += next.size();
    edge = std::move(next);
  }
}

bool SeeThrough::is_moving(const PointXyzi& point_map) const {
  const Voxel* const voxel = impl_->find(point_map.position().cast<double>());
  return voxel != nullptr && voxel->moving;
}

std::size_t SeeThrough::voxels() const {
  return impl_->voxels.size();
}

std::size_t SeeThrough::moving_voxels() const {
  return impl_->moving;
}

}  // namespace trigpoint::lio_mapper
