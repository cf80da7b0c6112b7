// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "world.hpp"

#include "random.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::simulator {

namespace {

constexpr double kCell_m = 4.0;
constexpr double kGroundReflectivity = 0.25;
constexpr double kFirstStep_m = 0.5;  ///< no wave of the relief is shorter than many of these
constexpr double kStepGrowth = 0.02;
constexpr int kRefinements = 3;
constexpr double kGrassFreePath_m = 0.3;  ///< mean way of light between blades, as in a crown
constexpr double kGrassReflectivity = 0.4;
constexpr std::uint64_t kGrassKey = 0x6772617373;

Eigen::Vector2d lowest_of(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d lowest = points.front();
  for (const Eigen::Vector2d& p : points) {
    lowest = lowest.cwiseMin(p);
  }
  return lowest;
}

Eigen::Vector2d highest_of(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Vector2d highest = points.front();
  for (const Eigen::Vector2d& p : points) {
    highest = highest.cwiseMax(p);
  }
  return highest;
}

int cell_of(double offset_m, int count) {
  return std::clamp(static_cast<int>(std::floor(offset_m / kCell_m)), 0, count - 1);
}

/// Where a ray enters and leaves a rectangle in plan view; empty when it misses.
struct Span {
  double enter_m{0.0};
  double leave_m{0.0};
};

Span clip(const Ray& ray,
          const Eigen::Vector2d& lowest,
          const Eigen::Vector2d& size,
          double max_m) {
  Span span{0.0, max_m};
  for (int i = 0; i < 2; ++i) {
    const double o = ray.origin_m[i] - lowest[i];
    const double d = ray.direction[i];
    if (std::abs(d) < 1e-12) {
      if (o < 0.0 || o > size[i]) {
        return {1.0, 0.0};
      }
      continue;
    }
    span.enter_m = std::max(span.enter_m, std::min(-o / d, (size[i] - o) / d));
    span.leave_m = std::min(span.leave_m, std::max(-o / d, (size[i] - o) / d));
  }
  return span;
}

/// One axis of the walk through the cells, [1].
struct Walk {
  Walk(double origin_m, double direction, double start_m, int cells) {
    const double at = origin_m + start_m * direction;
    cell = cell_of(at, cells);
    step = direction > 0.0 ? 1 : -1;
    if (std::abs(direction) < 1e-12) {
      next_m = std::numeric_limits<double>::infinity();
      width_m = next_m;
      return;
    }
    next_m = ((cell + (step > 0 ? 1 : 0)) * kCell_m - origin_m) / direction;
    width_m = kCell_m / std::abs(direction);
  }

  void advance() {
    cell += step;
    next_m += width_m;
  }

  int cell{0};
  int step{1};
  double next_m{0.0};  ///< range at which the ray leaves the cell on this axis
  double width_m{0.0};
};

}  // namespace

GroundGrid::GroundGrid(const Relief& relief,
                       const Eigen::Vector2d& lowest_m,
                       const Eigen::Vector2d& highest_m)
    : relief_(relief), lowest_m_(lowest_m.array().floor()) {
  columns_ = static_cast<int>(std::ceil(highest_m.x() - lowest_m_.x())) + 2;
  rows_ = static_cast<int>(std::ceil(highest_m.y() - lowest_m_.y())) + 2;
  heights_m_.reserve(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_));
  for (int row = 0; row < rows_; ++row) {
    for (int column = 0; column < columns_; ++column) {
      heights_m_.push_back(
          static_cast<float>(relief.height_m(lowest_m_.x() + column, lowest_m_.y() + row)));
    }
  }
}

double GroundGrid::height_m(double east_m, double north_m) const {
  const double x = std::clamp(east_m - lowest_m_.x(), 0.0, columns_ - 1.001);
  const double y = std::clamp(north_m - lowest_m_.y(), 0.0, rows_ - 1.001);
  const int column = static_cast<int>(x);
  const int row = static_cast<int>(y);
  const double u = x - column;
  const double w = y - row;
  const float* at = heights_m_.data() + static_cast<std::ptrdiff_t>(row) * columns_ + column;
  const double south = at[0] + u * (at[1] - at[0]);
  const double north = at[columns_] + u * (at[columns_ + 1] - at[columns_]);
  return south + w * (north - south);
}

void GroundGrid::intersect(const Ray& ray, double max_range_m, Hit& hit) const {
  const Eigen::Vector3d& d = ray.direction;
  const auto clearance = [&](double t) {
    return ray.origin_m.z() + t * d.z() -
           height_m(ray.origin_m.x() + t * d.x(), ray.origin_m.y() + t * d.y());
  };
  const double closing = relief_.steepest() * std::hypot(d.x(), d.y()) - d.z();
  if (closing <= 0.0) {
    return;
  }
  double above_m = 0.0;
  double above_f = clearance(0.0);
  // Never over a crest: a step is what the steepest ground cannot close, or shorter than any crest.
  double below_m = 0.0;
  double below_f = above_f;
  while (below_f > 0.0) {
    above_m = below_m;
    above_f = below_f;
    if (above_m >= std::min(max_range_m, hit.range_m)) {
      return;
    }
    below_m = above_m + std::max(above_f / closing, kFirstStep_m + kStepGrowth * above_m);
    below_f = clearance(below_m);
  }
  double t = below_m;
  for (int i = 0; i < kRefinements && above_f > below_f; ++i) {
    t = above_m + (below_m - above_m) * above_f / (above_f - below_f);
    const double f = clearance(t);
    (f > 0.0 ? above_m : below_m) = t;
    (f > 0.0 ? above_f : below_f) = f;
  }
  if (t < std::min(max_range_m, hit.range_m)) {
    const Eigen::Vector2d slope =
        relief_.slope(ray.origin_m.x() + t * d.x(), ray.origin_m.y() + t * d.y());
    const Eigen::Vector3d up = Eigen::Vector3d(-slope.x(), -slope.y(), 1.0).normalized();
    hit = {t, std::clamp(std::abs(d.dot(up)), 0.01, 1.0), kGroundReflectivity};
  }
}

World::World(const Relief& relief,
             std::vector<Shape> shapes,
             const std::vector<Eigen::Vector2d>& track_m,
             double margin_m,
             double grass_height_m)
    : ground_(relief,
              lowest_of(track_m) - Eigen::Vector2d::Constant(margin_m),
              highest_of(track_m) + Eigen::Vector2d::Constant(margin_m)),
      grass_height_m_(grass_height_m),
      shapes_(std::move(shapes)) {
  build_cells();
}

void World::build_cells() {
  if (shapes_.empty()) {
    return;
  }
  std::vector<Eigen::Vector2d> corners;
  for (const Shape& shape : shapes_) {
    const Eigen::Vector2d half = shape.half_extent_m().head<2>();
    corners.emplace_back(shape.centre_m.head<2>() - half);
    corners.emplace_back(shape.centre_m.head<2>() + half);
  }
  lowest_m_ = lowest_of(corners) - Eigen::Vector2d::Constant(0.5);
  const Eigen::Vector2d size = highest_of(corners) + Eigen::Vector2d::Constant(0.5) - lowest_m_;
  columns_ = static_cast<int>(std::ceil(size.x() / kCell_m));
  rows_ = static_cast<int>(std::ceil(size.y() / kCell_m));
  const std::size_t count = static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  std::vector<std::vector<std::uint32_t>> lists(count);
  cells_.assign(count, Cell{});
  for (std::size_t i = 0; i < shapes_.size(); ++i) {
    const Eigen::Vector2d from = corners[2 * i] - lowest_m_;
    const Eigen::Vector2d to = corners[2 * i + 1] - lowest_m_;
    const double top = shapes_[i].centre_m.z() + shapes_[i].half_m.z();
    for (int row = cell_of(from.y(), rows_); row <= cell_of(to.y(), rows_); ++row) {
      for (int column = cell_of(from.x(), columns_); column <= cell_of(to.x(), columns_);
           ++column) {
        const auto at = static_cast<std::size_t>(row * columns_ + column);
        cells_[at].top_m = lists[at].empty() ? top : std::max(cells_[at].top_m, top);
        lists[at].push_back(static_cast<std::uint32_t>(i));
      }
    }
  }
  for (std::size_t at = 0; at < count; ++at) {
    cells_[at].first = static_cast<std::uint32_t>(members_.size());
    cells_[at].count = static_cast<std::uint32_t>(lists[at].size());
    members_.insert(members_.end(), lists[at].begin(), lists[at].end());
  }
}

Hit World::cast(const Ray& ray, double max_range_m) const {
  Hit hit;
  hit.range_m = max_range_m;
  ground_.intersect(ray, max_range_m, hit);
  if (grass_height_m_ > 0.0 && hit.range_m < max_range_m) {
    stop_in_grass(ray, hit);
  }
  intersect_shapes(ray, max_range_m, hit);
  return hit.range_m < max_range_m ? hit : Hit{};
}

void World::stop_in_grass(const Ray& ray, Hit& hit) const {
  const double through_m = std::min(hit.range_m, grass_height_m_ / hit.cos_incidence);
  Random random(derive_seed(ray.key, kGrassKey));
  const double depth_m = -kGrassFreePath_m * std::log(1.0 - random.uniform());
  if (depth_m < through_m) {
    hit = {hit.range_m - through_m + depth_m, random.uniform(0.4, 1.0), kGrassReflectivity};
  }
}

void World::intersect_shapes(const Ray& ray, double max_range_m, Hit& hit) const {
  if (shapes_.empty()) {
    return;
  }
  const Span span = clip(ray,
                         lowest_m_,
                         kCell_m * Eigen::Vector2d(columns_, rows_),
                         std::min(max_range_m, hit.range_m));
  if (span.enter_m >= span.leave_m) {
    return;
  }
  Walk x(ray.origin_m.x() - lowest_m_.x(), ray.direction.x(), span.enter_m, columns_);
  Walk y(ray.origin_m.y() - lowest_m_.y(), ray.direction.y(), span.enter_m, rows_);
  double entered_m = span.enter_m;
  while (x.cell >= 0 && x.cell < columns_ && y.cell >= 0 && y.cell < rows_ &&
         entered_m < std::min(hit.range_m, span.leave_m)) {
    const double left_m = std::min(x.next_m, y.next_m);
    const double lowest_m =
        ray.origin_m.z() + ray.direction.z() * (ray.direction.z() > 0.0 ? entered_m : left_m);
    intersect_cell(
        cells_[static_cast<std::size_t>(y.cell * columns_ + x.cell)], ray, lowest_m, hit);
    (x.next_m < y.next_m ? x : y).advance();
    entered_m = left_m;
  }
}

void World::intersect_cell(const Cell& cell, const Ray& ray, double lowest_m, Hit& hit) const {
  if (cell.count == 0 || lowest_m > cell.top_m) {
    return;
  }
  for (std::uint32_t i = cell.first; i < cell.first + cell.count; ++i) {
    intersect(shapes_[members_[i]], members_[i], ray, hit);
  }
}

}  // namespace trigpoint::simulator
