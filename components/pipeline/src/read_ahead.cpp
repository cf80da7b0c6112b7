// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "read_ahead.hpp"

#include <chrono>
#include <utility>
#include <variant>

namespace trigpoint::pipeline {

namespace {

using Clock = std::chrono::steady_clock;

/// Entries: two to six sweeps with the IMU samples between them.
constexpr std::size_t kAhead = 64;

}  // namespace

ReadAhead::ReadAhead(recording::LogReader& log, const lio_mapper::Config& mapper)
    : log_(log), decoder_(mapper), items_(kAhead), thread_([this] { read(); }) {}

ReadAhead::~ReadAhead() {
  stop();
}

void ReadAhead::stop() {
  items_.close();
  if (thread_.joinable()) {
    thread_.join();
  }
}

std::optional<ReadAhead::Item> ReadAhead::next() {
  auto item = items_.pop();
  if (!item) {
    stop();
    if (failure_) {
      std::rethrow_exception(failure_);
    }
  }
  return item;
}

void ReadAhead::read() {
  try {
    while (auto entry = log_.next()) {
      if (!items_.push(prepared(std::move(*entry)))) {
        return;
      }
    }
  } catch (const recording::LogError& broken) {
    error_ = broken.what();
  } catch (...) {
    failure_ = std::current_exception();
  }
  items_.close();
}

ReadAhead::Item ReadAhead::prepared(recording::LogEntry&& entry) {
  Item item;
  item.entry = std::move(entry);
  item.events = log_.take_events();
  item.progress = log_.progress();
  auto* cloud = std::get_if<PointCloudMessage>(&item.entry.measurement);
  if (cloud != nullptr && !item.entry.withheld) {
    const Clock::time_point before = Clock::now();
    item.decoded = decoder_.decode(*cloud);
    item.decoded->set_decoding_ms(
        std::chrono::duration<double, std::milli>(Clock::now() - before).count());
    cloud->data = {};
  }
  return item;
}

}  // namespace trigpoint::pipeline
