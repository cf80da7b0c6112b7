// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "workers.hpp"

#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace trigpoint::lio_mapper {

/// Everything under one mutex: blocks are coarse, so that taking one is rare.
struct Workers::Pool {
  explicit Pool(std::size_t helpers) {
    for (std::size_t i = 0; i < helpers; ++i) {
      threads.emplace_back([this] { help(); });
    }
  }

  ~Pool() {
    {
      const std::lock_guard lock(mutex);
      stopping = true;
    }
    begun.notify_all();
    for (std::thread& thread : threads) {
      thread.join();
    }
  }

  void help() {
    std::unique_lock lock(mutex);
    std::uint64_t seen = 0;
    while (true) {
      begun.wait(lock, [&] { return stopping || round != seen; });
      if (stopping) {
        return;
      }
      seen = round;
      take_blocks(lock);
    }
  }

  void take_blocks(std::unique_lock<std::mutex>& lock) {
    while (next < blocks) {
      const std::size_t block = next++;
      ++running;
      lock.unlock();
      (*work)(block);
      lock.lock();
      --running;
    }
    if (running == 0) {
      done.notify_all();
    }
  }

  void run(std::size_t count, const std::function<void(std::size_t)>& what) {
    std::unique_lock lock(mutex);
    work = &what;
    blocks = count;
    next = 0;
    ++round;
    begun.notify_all();
    take_blocks(lock);
    done.wait(lock, [&] { return running == 0; });
  }

  std::mutex mutex;
  std::condition_variable begun;
  std::condition_variable done;
  const std::function<void(std::size_t)>* work{nullptr};
  std::size_t blocks{0};
  std::size_t next{0};
  std::size_t running{0};
  std::uint64_t round{0};
  bool stopping{false};
  std::vector<std::thread> threads;
};

Workers::Workers(std::size_t threads) : threads_(threads) {}

Workers::~Workers() = default;

void Workers::run(std::size_t blocks, const std::function<void(std::size_t)>& work) {
  if (threads_ < 2 || blocks < 2) {
    for (std::size_t i = 0; i < blocks; ++i) {
      work(i);
    }
    return;
  }
  if (!pool_) {
    pool_ = std::make_unique<Pool>(threads_ - 1);
  }
  pool_->run(blocks, work);
}

}  // namespace trigpoint::lio_mapper
