// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ikd_tree.hpp"

#include "ikd_node.hpp"

#include <algorithm>
#include <tuple>

namespace trigpoint::lio_mapper {

namespace {

bool at_same_place(const PointXyzi& a, const PointXyzi& b) {
  return a.x == b.x && a.y == b.y && a.z == b.z;
}

bool is_finite(const PointXyzi& p) {
  return std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
}

float coordinate(const PointXyzi& p, int axis) {
  return axis == 0 ? p.x : axis == 1 ? p.y : p.z;
}

float distance2_to_centre(const PointXyzi& p, const VoxelIndex& voxel, float voxel_m) {
  const Eigen::Vector3f centre = voxel_m * Eigen::Vector3f(static_cast<float>(voxel.x) + 0.5F,
                                                           static_cast<float>(voxel.y) + 0.5F,
                                                           static_cast<float>(voxel.z) + 0.5F);
  return (p.position() - centre).squaredNorm();
}

VoxelIndex voxel_of(const PointXyzi& p, float inverse_voxel_per_m) {
  return voxel_index(p.x, p.y, p.z, inverse_voxel_per_m);
}

}  // namespace

IkdTree::IkdTree(const IkdTreeLimits& limits) : limits_(limits), root_(build_subtree({})) {}

IkdTree::~IkdTree() {
  if (rebuild_.result.valid()) {
    rebuild_.result.wait();
  }
}

std::size_t IkdTree::size() const {
  return root_->size;
}

// ---- Building --------------------------------------------------------------------------------

IkdTree::NodePtr IkdTree::build_subtree(std::span<PointXyzi> points) {
  auto node = std::make_unique<Node>();
  for (const PointXyzi& point : points) {
    node->bounds.add(point);
  }
  node->size = static_cast<std::uint32_t>(points.size());
  node->held = node->size;
  // Half full, so that the next points find room.
  if (points.size() <= kBucketSize / 2) {
    node->bucket = std::make_unique<IkdBucket>();
    for (const PointXyzi& point : points) {
      node->bucket->push(point);
    }
    return node;
  }
  (node->bounds.high - node->bounds.low).head<3>().maxCoeff(&node->axis);
  const auto middle = points.begin() + static_cast<std::ptrdiff_t>(points.size() / 2);
  std::nth_element(
      points.begin(), middle, points.end(), [axis = node->axis](const auto& a, const auto& b) {
        return coordinate(a, axis) < coordinate(b, axis);
      });
  node->split = coordinate(*middle, node->axis);
  node->left = build_subtree({points.begin(), middle});
  node->right = build_subtree({middle, points.end()});
  return node;
}

void IkdTree::build(const PointCloud& points) {
  if (rebuild_.result.valid()) {
    rebuild_.result.wait();
  }
  rebuild_ = {};
  garbage_.clear();
  scratch_.clear();
  std::copy_if(points.begin(), points.end(), std::back_inserter(scratch_), is_finite);
  root_ = build_subtree(scratch_);
}

void IkdTree::collect(const Node& node, PointCloud& points) {
  if (!node.is_leaf()) {
    collect(*node.left, points);
    collect(*node.right, points);
    return;
  }
  for (std::uint32_t i = 0; i < node.bucket->count; ++i) {
    points.push_back(node.bucket->point(i));
  }
}

PointCloud IkdTree::points() const {
  PointCloud all;
  all.reserve(size());
  collect(*root_, all);
  std::sort(all.begin(), all.end(), [](const PointXyzi& a, const PointXyzi& b) {
    return std::tie(a.x, a.y, a.z, a.intensity) < std::tie(b.x, b.y, b.z, b.intensity);
  });
  return all;
}

// ---- Insertion -------------------------------------------------------------------------------

void IkdTree::add(Node& node, const PointXyzi& point) {
  if (&node == rebuild_.target) {
    rebuild_.changes.push_back({Change::Kind::kInsert, point, {}});
  }
  if (node.is_leaf() && node.bucket->count == kBucketSize) {
    split_leaf(node);
  }
  node.bounds.add(point);
  ++node.size;
  ++node.held;
  node.touched = true;
  if (node.is_leaf()) {
    node.bucket->push(point);
  } else {
    add(coordinate(point, node.axis) < node.split ? *node.left : *node.right, point);
  }
}

void IkdTree::split_leaf(Node& leaf) {
  std::array<PointXyzi, kBucketSize> points;
  for (std::uint32_t i = 0; i < leaf.bucket->count; ++i) {
    points[i] = leaf.bucket->point(i);
  }
  NodePtr halves = build_subtree({points.data(), leaf.bucket->count});
  leaf.bucket.reset();
  leaf.left = std::move(halves->left);
  leaf.right = std::move(halves->right);
  leaf.split = halves->split;
  leaf.axis = halves->axis;
}

void IkdTree::insert(std::span<const PointXyzi> points) {
  take_rebuild_if_done();
  for (const PointXyzi& point : points) {
    if (is_finite(point)) {
      add(*root_, point);
    }
  }
  finish_change();
}

void IkdTree::find_in_voxel(const Node& node,
                            const Bounds& around,
                            const VoxelIndex& voxel,
                            float inverse_voxel_per_m,
                            PointCloud& found) {
  if (node.size == 0 || !node.bounds.meets(around)) {
    return;
  }
  if (!node.is_leaf()) {
    find_in_voxel(*node.left, around, voxel, inverse_voxel_per_m, found);
    find_in_voxel(*node.right, around, voxel, inverse_voxel_per_m, found);
    return;
  }
  for (std::uint32_t i = 0; i < node.bucket->count; ++i) {
    const PointXyzi point = node.bucket->point(i);
    if (voxel_key(voxel_of(point, inverse_voxel_per_m)) == voxel_key(voxel)) {
      found.push_back(point);
    }
  }
}

/// Takes the voxel's other points out when it is.
bool IkdTree::is_better_than_its_voxel(const PointXyzi& point, float voxel_m) {
  const float inverse = 1.0F / voxel_m;
  const VoxelIndex voxel = voxel_of(point, inverse);
  Bounds around;
  const Eigen::Array4f corner{
      static_cast<float>(voxel.x), static_cast<float>(voxel.y), static_cast<float>(voxel.z), 0.0F};
  // A little wider: which voxel a point belongs to is decided by voxel_of, with its own rounding.
  around.low = (corner - 0.01F) * voxel_m;
  around.high = (corner + 1.01F) * voxel_m;
  scratch_.clear();
  find_in_voxel(*root_, around, voxel, inverse, scratch_);
  const float distance2 = distance2_to_centre(point, voxel, voxel_m);
  const bool better = std::all_of(scratch_.begin(), scratch_.end(), [&](const PointXyzi& held) {
    return distance2 < distance2_to_centre(held, voxel, voxel_m);
  });
  if (better) {
    for (const PointXyzi& held : scratch_) {
      take_out(*root_, held);
    }
  }
  return better;
}

void IkdTree::insert_thinned(std::span<const PointXyzi> points, float voxel_m) {
  take_rebuild_if_done();
  for (const PointXyzi& point : points) {
    if (voxel_index_fits(point.x, point.y, point.z, 1.0 / voxel_m) &&
        is_better_than_its_voxel(point, voxel_m)) {
      add(*root_, point);
    }
  }
  finish_change();
}

// ---- Deletion --------------------------------------------------------------------------------

bool IkdTree::take_out(Node& node, const PointXyzi& point) {
  if (node.size == 0 || !node.bounds.contains(point)) {
    return false;
  }
  bool found = false;
  if (node.is_leaf()) {
    for (std::uint32_t i = 0; i < node.bucket->count && !found; ++i) {
      if (at_same_place(node.bucket->point(i), point)) {
        node.bucket->remove(i);
        found = true;
      }
    }
  } else {
    found = take_out(*node.left, point) || take_out(*node.right, point);
  }
  if (found) {
    --node.size;
    node.touched = true;
    if (&node == rebuild_.target) {
      rebuild_.changes.push_back({Change::Kind::kErase, point, {}});
    }
  }
  return found;
}

/// The node becomes an empty leaf. What hung on it waits for the next rebuild aside: until then a
/// rebuild under way may still know one of its nodes by its address.
void IkdTree::unlink(Node& node) {
  if (node.is_leaf()) {
    node.bucket->count = 0;
  } else {
    garbage_.push_back(std::move(node.left));
    garbage_.push_back(std::move(node.right));
    node.bucket = std::make_unique<IkdBucket>();
  }
  node.bounds = {};
  node.size = 0;
  node.held = 0;
}

void IkdTree::erase_box(Node& node, const Box& box, bool inside) {
  const auto goes = [&](const PointXyzi& p) { return box.contains(p.position()) == inside; };
  if (node.size == 0) {
    return;
  }
  const Box own = node.box();
  const bool apart = box.intersection(own).isEmpty();
  const bool within = box.contains(own);
  if (inside ? apart : within) {
    return;
  }
  node.touched = true;
  if (inside ? within : apart) {
    unlink(node);
    return;
  }
  if (!node.is_leaf()) {
    erase_box(*node.left, box, inside);
    erase_box(*node.right, box, inside);
    node.size = node.left->size + node.right->size;
    return;
  }
  for (std::uint32_t i = node.bucket->count; i-- > 0;) {
    if (goes(node.bucket->point(i))) {
      node.bucket->remove(i);
    }
  }
  node.size = node.bucket->count;
}

void IkdTree::erase(const Box& box, bool inside) {
  take_rebuild_if_done();
  if (rebuild_.target != nullptr) {
    rebuild_.changes.push_back(
        {inside ? Change::Kind::kEraseInside : Change::Kind::kEraseOutside, {}, box});
  }
  erase_box(*root_, box, inside);
  finish_change();
}

void IkdTree::erase_inside(const Box& box) {
  erase(box, true);
}

void IkdTree::erase_outside(const Box& box) {
  erase(box, false);
}

// ---- Queries ---------------------------------------------------------------------------------

struct IkdTree::Search {
  Eigen::Array4f query;
  std::span<Neighbour> found;
  std::size_t count{0};
  float farthest2{0.0F};  ///< what is farther does not count

  static bool comes_before(const Neighbour& a, const Neighbour& b) {
    if (a.distance2_m2 != b.distance2_m2) {
      return a.distance2_m2 < b.distance2_m2;
    }
    return std::lexicographical_compare(
        a.position_m.data(), a.position_m.data() + 3, b.position_m.data(), b.position_m.data() + 3);
  }

  void offer(const Neighbour& candidate) {
    if (count == found.size()) {
      if (!comes_before(candidate, found[count - 1])) {
        return;
      }
    } else {
      ++count;
    }
    std::size_t i = count - 1;
    for (; i > 0 && comes_before(candidate, found[i - 1]); --i) {
      found[i] = found[i - 1];
    }
    found[i] = candidate;
    if (count == found.size()) {
      farthest2 = found[count - 1].distance2_m2;
    }
  }

  void look_into(const IkdBucket& bucket) {
    const BucketLanes dx = bucket.x - query[0];
    const BucketLanes dy = bucket.y - query[1];
    const BucketLanes dz = bucket.z - query[2];
    const BucketLanes distance2 = dx * dx + dy * dy + dz * dz;
    for (std::uint32_t i = 0; i < bucket.count; ++i) {
      if (distance2[i] <= farthest2) {
        offer({distance2[i], {bucket.x[i], bucket.y[i], bucket.z[i]}});
      }
    }
  }
};

void IkdTree::search(const Node& node, Search& search_for) {
  const Node* at = &node;
  while (!at->is_leaf()) {
    const Node* near = at->left.get();
    const Node* far = at->right.get();
    float near2 = near->bounds.distance2(search_for.query);
    float far2 = far->bounds.distance2(search_for.query);
    if (far2 < near2) {
      std::swap(near, far);
      std::swap(near2, far2);
    }
    if (near2 > search_for.farthest2) {
      return;
    }
    search(*near, search_for);
    if (far2 > search_for.farthest2) {
      return;
    }
    at = far;
  }
  search_for.look_into(*at->bucket);
}

std::size_t IkdTree::nearest(const Eigen::Vector3f& query_m,
                             float max_distance_m,
                             std::span<Neighbour> found) const {
  if (found.empty() || !query_m.allFinite()) {
    return 0;
  }
  Search search_for{
      {query_m.x(), query_m.y(), query_m.z(), 0.0F}, found, 0, max_distance_m * max_distance_m};
  search(*root_, search_for);
  return search_for.count;
}

}  // namespace trigpoint::lio_mapper
