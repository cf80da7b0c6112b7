// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "buffer_pool.hpp"

#include <algorithm>
#include <utility>

namespace trigpoint::bus::cyclonedds {

namespace {

constexpr std::size_t kLarge_bytes = 65'536;  // smaller ones the allocator recycles itself
constexpr std::size_t kMostKept_bytes = 64'000'000;
constexpr std::size_t kMostWasted = 4;  // a kept buffer may be so many times too large

}  // namespace

Buffer BufferPool::take(std::size_t size) {
  const bool is_large = size >= kLarge_bytes;
  if (Buffer kept = is_large ? take_kept(size) : Buffer{}; kept.bytes) {
    return kept;
  }
  const std::size_t capacity =
      is_large ? size + size / 4 : size;  // the next cloud differs a little
  return {std::make_unique_for_overwrite<std::uint8_t[]>(capacity), capacity};
}

Buffer BufferPool::take_kept(std::size_t size) {
  const std::lock_guard lock(mutex_);
  const auto fits = [size](const Buffer& kept) {
    return kept.capacity >= size && kept.capacity / kMostWasted <= size;
  };
  const auto found = std::find_if(kept_.begin(), kept_.end(), fits);
  if (found == kept_.end()) {
    return {};
  }
  Buffer buffer = std::move(*found);
  kept_.erase(found);
  kept_bytes_ -= buffer.capacity;
  return buffer;
}

std::size_t BufferPool::kept_bytes() {
  const std::lock_guard lock(mutex_);
  return kept_bytes_;
}

void BufferPool::give_back(Buffer buffer) {
  if (buffer.capacity < kLarge_bytes || buffer.capacity > kMostKept_bytes) {
    return;
  }
  std::deque<Buffer> freed;  // outside the lock
  const std::lock_guard lock(mutex_);
  kept_bytes_ += buffer.capacity;
  kept_.push_back(std::move(buffer));
  while (kept_bytes_ > kMostKept_bytes) {
    kept_bytes_ -= kept_.front().capacity;
    freed.push_back(std::move(kept_.front()));
    kept_.pop_front();
  }
}

}  // namespace trigpoint::bus::cyclonedds
