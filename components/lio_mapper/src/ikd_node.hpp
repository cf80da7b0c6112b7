// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The inside of IkdTree, for its own source files.
#pragma once

#include "ikd_tree.hpp"

#include <algorithm>
#include <array>
#include <limits>

namespace trigpoint::lio_mapper {

inline constexpr std::size_t kBucketSize = 16;
using BucketLanes = Eigen::Array<float, kBucketSize, 1>;

/// Some points of a leaf, coordinate by coordinate, so that distances to all come at once.
struct IkdBucket {
  BucketLanes x{BucketLanes::Zero()};
  BucketLanes y{BucketLanes::Zero()};
  BucketLanes z{BucketLanes::Zero()};
  std::array<float, kBucketSize> intensity{};
  std::uint32_t count{0};

  PointXyzi point(std::uint32_t i) const { return {x[i], y[i], z[i], intensity[i]}; }

  void push(const PointXyzi& p) {
    x[count] = p.x;
    y[count] = p.y;
    z[count] = p.z;
    intensity[count++] = p.intensity;
  }

  void remove(std::uint32_t i) {
    --count;
    x[i] = x[count];
    y[i] = y[count];
    z[i] = z[count];
    intensity[i] = intensity[count];
  }
};

/// Four lanes, of which three count, so that a distance to a box is a handful of instructions.
struct IkdTree::Bounds {
  Eigen::Array4f low{Eigen::Array4f::Constant(std::numeric_limits<float>::infinity())};
  Eigen::Array4f high{Eigen::Array4f::Constant(-std::numeric_limits<float>::infinity())};

  void add(const PointXyzi& p) {
    const Eigen::Array4f at{p.x, p.y, p.z, 0.0F};
    low = low.min(at);
    high = high.max(at);
  }

  void add(const Bounds& other) {
    low = low.min(other.low);
    high = high.max(other.high);
  }

  bool contains(const PointXyzi& p) const {
    const Eigen::Array4f at{p.x, p.y, p.z, 0.0F};
    return (at >= low).all() && (at <= high).all();
  }

  bool meets(const Bounds& other) const {
    return (low <= other.high).all() && (other.low <= high).all();
  }

  /// Summed in the order of the distance to a point, so that rounding keeps it a lower bound.
  float distance2(const Eigen::Array4f& query) const {
    const Eigen::Array4f outside = (low - query).max(query - high).max(0.0F);
    const Eigen::Array4f squares = outside * outside;
    return squares[0] + squares[1] + squares[2];
  }
};

/// A leaf with a bucket, or two children.
struct IkdTree::Node {
  Bounds bounds;  ///< of the points; may be too large after deletions
  NodePtr left;   ///< below `split` along `axis` when it was made; a new point goes by that, too
  NodePtr right;
  std::unique_ptr<IkdBucket> bucket;
  float split{0.0F};
  int axis{0};
  std::uint32_t size{0};
  std::uint32_t held{0};  ///< points since the last rebuild, deleted ones included
  bool touched{false};    ///< changed since the balance was last looked at

  bool is_leaf() const { return bucket != nullptr; }

  Box box() const {
    return {Eigen::Vector3f(bounds.low.head<3>()), Eigen::Vector3f(bounds.high.head<3>())};
  }
};

}  // namespace trigpoint::lio_mapper
