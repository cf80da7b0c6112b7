// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "pacer.hpp"

namespace trigpoint::bus::cyclonedds {

Pacer::Pacer(std::int64_t portion_bytes, std::chrono::milliseconds period)
    : portion_bytes_(portion_bytes), period_(period), paced_thread_(std::this_thread::get_id()) {}

void Pacer::before_sending(std::size_t bytes) {
  if (std::this_thread::get_id() != paced_thread_) {
    return;
  }
  const auto size = static_cast<std::int64_t>(bytes);
  auto now = std::chrono::steady_clock::now();
  if (now < period_end_ && sent_bytes_ > 0 && sent_bytes_ + size > portion_bytes_) {
    std::this_thread::sleep_until(period_end_);
    now = std::chrono::steady_clock::now();
  }
  if (now >= period_end_) {
    period_end_ = now + period_;
    sent_bytes_ = 0;
  }
  sent_bytes_ += size;
}

}  // namespace trigpoint::bus::cyclonedds
