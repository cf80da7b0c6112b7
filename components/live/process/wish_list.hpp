// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstddef>
#include <map>
#include <mutex>
#include <utility>

namespace trigpoint::live {

/// Which channels browsers want, told on the server's thread and carried out on another one. A
/// client may change its mind as often as it likes: each channel is on the list once.
class WishList {
 public:
  /// True when the list was empty: somebody must be asked to take it.
  bool add(std::size_t channel, bool wanted) {
    const std::lock_guard<std::mutex> lock(mutex_);
    const bool was_empty = wishes_.empty();
    wishes_[channel] = wanted;
    return was_empty;
  }

  /// The newest wish about each channel since the last time.
  std::map<std::size_t, bool> take() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return std::exchange(wishes_, {});
  }

 private:
  std::mutex mutex_;
  std::map<std::size_t, bool> wishes_;
};

}  // namespace trigpoint::live
