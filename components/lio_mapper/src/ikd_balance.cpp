// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How the tree keeps its balance: rebuilds in place and aside.
#include "ikd_node.hpp"
#include "ikd_tree.hpp"

#include <algorithm>
#include <chrono>
#include <utility>

namespace trigpoint::lio_mapper {

// ---- Balance ---------------------------------------------------------------------------------

/// [1], the two criteria of its section on re-balancing. Where a bucket or two hold everything
/// there is nothing to balance.
bool IkdTree::out_of_balance(const Node& node) const {
  if (node.is_leaf() || node.held <= 2 * kBucketSize) {
    return false;
  }
  const std::uint32_t larger = std::max(node.left->size, node.right->size);
  return static_cast<double>(larger) > limits_.unbalanced_share * node.size ||
         static_cast<double>(node.held - node.size) > limits_.deleted_share * node.held;
}

void IkdTree::restore_balance(NodePtr& node, std::vector<bool>& way) {
  if (!node->touched || node.get() == rebuild_.target) {
    return;  // what is rebuilt aside will be balanced
  }
  if (out_of_balance(*node)) {
    if (node->size > limits_.rebuilt_aside) {
      if (rebuild_.target == nullptr) {
        start_rebuild(node, way);
        return;
      }
      // Stays touched, so that it is looked at again when the other rebuild is done.
    } else {
      scratch_.clear();
      collect(*node, scratch_);
      node = build_subtree(scratch_);
      return;
    }
  } else {
    node->touched = false;
  }
  if (node->is_leaf()) {
    return;
  }
  for (const bool right : {false, true}) {
    NodePtr& child = right ? node->right : node->left;
    way.push_back(right);
    restore_balance(child, way);
    way.pop_back();
    node->touched = node->touched || child->touched;
  }
}

void IkdTree::finish_change() {
  std::vector<bool> way;
  restore_balance(root_, way);
}

void IkdTree::start_rebuild(const NodePtr& node, const std::vector<bool>& way) {
  auto points = std::make_shared<PointCloud>();
  points->reserve(node->size);
  collect(*node, *points);
  auto garbage = std::make_shared<std::vector<NodePtr>>(std::move(garbage_));
  garbage_.clear();
  rebuild_.target = node.get();
  rebuild_.way = way;
  rebuild_.changes.clear();
  ++rebuilds_aside_;
  rebuild_.result = std::async(std::launch::async, [points, garbage]() mutable {
    garbage->clear();
    return build_subtree(*points);
  });
}

void IkdTree::take_rebuild_if_done() {
  if (rebuild_.result.valid() &&
      rebuild_.result.wait_for(std::chrono::seconds(0)) == std::future_status::ready) {
    put_in_place(rebuild_.result.get());
  }
}

void IkdTree::finish_rebuilds() {
  while (rebuild_.result.valid()) {
    put_in_place(rebuild_.result.get());
    finish_change();
  }
}

void IkdTree::apply(Node& node, const Change& change) {
  switch (change.kind) {
    case Change::Kind::kInsert:
      add(node, change.point);
      break;
    case Change::Kind::kErase:
      take_out(node, change.point);
      break;
    case Change::Kind::kEraseInside:
    case Change::Kind::kEraseOutside:
      erase_box(node, change.box, change.kind == Change::Kind::kEraseInside);
      break;
  }
}

/// Dropped when a box deletion has unlinked the subtree meanwhile: then the way no longer leads
/// there. Addresses are not given to new nodes before `garbage_` is freed.
void IkdTree::put_in_place(NodePtr subtree) {
  const Rebuild done = std::exchange(rebuild_, {});
  NodePtr* place = &root_;
  for (const bool right : done.way) {
    if ((*place)->is_leaf()) {
      return;
    }
    place = right ? &(*place)->right : &(*place)->left;
  }
  if (place->get() != done.target) {
    return;
  }
  for (const Change& change : done.changes) {
    apply(*subtree, change);
  }
  garbage_.push_back(std::exchange(*place, std::move(subtree)));
  (*place)->touched = true;
  root_->touched = true;
  NodePtr* above = &root_;
  for (const bool right : done.way) {
    (*above)->touched = true;
    above = right ? &(*above)->right : &(*above)->left;
  }
}

// ---- Shape -----------------------------------------------------------------------------------

std::size_t IkdTree::depth_of(const Node& node) {
  return node.is_leaf() ? 1 : 1 + std::max(depth_of(*node.left), depth_of(*node.right));
}

std::size_t IkdTree::depth() const {
  return depth_of(*root_);
}

std::size_t IkdTree::memory_of(const Node& node) {
  return sizeof(Node) +
         (node.is_leaf() ? sizeof(IkdBucket) : memory_of(*node.left) + memory_of(*node.right));
}

std::size_t IkdTree::memory_bytes() const {
  std::size_t bytes = memory_of(*root_);
  for (const NodePtr& node : garbage_) {
    bytes += memory_of(*node);
  }
  return bytes;
}

}  // namespace trigpoint::lio_mapper
