// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "outbox.hpp"

#include <algorithm>
#include <utility>

namespace trigpoint::live {

void Outbox::push_control(Frame frame) {
  controls_.push_back(std::move(frame));
}

std::size_t Outbox::push(Frame frame, std::size_t depth) {
  const std::size_t size = frame.bytes();
  if (size > max_bytes_ || depth == 0) {
    return 1;
  }
  std::size_t dropped = 0;
  if (loads_[frame.stream].messages >= depth) {
    erase(oldest_of(frame.stream));
    ++dropped;
  }
  // The small streams of a client that cannot follow its clouds stay whole.
  while (bytes_ + size > max_bytes_) {
    erase(oldest_of(heaviest()));
    ++dropped;
  }
  Load& load = loads_[frame.stream];
  ++load.messages;
  load.bytes += size;
  bytes_ += size;
  data_.push_back(std::move(frame));
  return dropped;
}

std::optional<Frame> Outbox::pop() {
  std::optional<Frame> next;
  if (!controls_.empty()) {
    next = std::move(controls_.front());
    controls_.pop_front();
  } else if (!data_.empty()) {
    next = data_.front();
    erase(data_.begin());
  }
  return next;
}

void Outbox::forget(std::uint64_t stream) {
  std::erase_if(data_, [stream](const Frame& f) { return f.stream == stream; });
  const auto load = loads_.find(stream);
  if (load != loads_.end()) {
    bytes_ -= load->second.bytes;
    loads_.erase(load);
  }
}

std::deque<Frame>::iterator Outbox::oldest_of(std::uint64_t stream) {
  return std::find_if(
      data_.begin(), data_.end(), [stream](const Frame& frame) { return frame.stream == stream; });
}

std::uint64_t Outbox::heaviest() const {
  return std::max_element(
             loads_.begin(),
             loads_.end(),
             [](const auto& a, const auto& b) { return a.second.bytes < b.second.bytes; })
      ->first;
}

void Outbox::erase(std::deque<Frame>::iterator frame) {
  Load& load = loads_[frame->stream];
  --load.messages;
  load.bytes -= frame->bytes();
  bytes_ -= frame->bytes();
  data_.erase(frame);
}

}  // namespace trigpoint::live
