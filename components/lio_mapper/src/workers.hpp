// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstddef>
#include <functional>
#include <memory>

namespace trigpoint::lio_mapper {

/// Threads that share the blocks of one piece of work with their caller.
class Workers {
 public:
  /// `threads` includes the caller: 1 does everything there. Threads start with the first work.
  explicit Workers(std::size_t threads);
  ~Workers();
  Workers(const Workers&) = delete;
  Workers& operator=(const Workers&) = delete;

  /// Calls work(i) once for each i in [0, blocks), in any order, and returns when all are done.
  /// `work` must not throw. Not to be called from two threads at once.
  void run(std::size_t blocks, const std::function<void(std::size_t)>& work);

 private:
  struct Pool;
  std::size_t threads_;
  std::unique_ptr<Pool> pool_;
};

}  // namespace trigpoint::lio_mapper
