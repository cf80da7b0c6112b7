// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/bounded_queue.hpp"
#include "trigpoint/lio_mapper/cloud_decoder.hpp"
#include "trigpoint/recording/log.hpp"

#include <exception>
#include <optional>
#include <string>
#include <thread>

namespace trigpoint::pipeline {

/// Reads a log and decodes its clouds on a thread of its own, a bounded way ahead of who works
/// through it. The log belongs to that thread until next() has said that there is no more, or
/// stop().
class ReadAhead {
 public:
  struct Item {
    recording::LogEntry entry;                        ///< a cloud that is decoded has lost its data
    std::optional<lio_mapper::DecodedCloud> decoded;  ///< of a cloud that is not withheld
    Events events;                                    ///< of the log, before this entry
    double progress{0.0};                             ///< of the log, 0 to 1
  };

  ReadAhead(recording::LogReader& log, const lio_mapper::Config& mapper);
  ~ReadAhead();
  ReadAhead(const ReadAhead&) = delete;
  ReadAhead& operator=(const ReadAhead&) = delete;

  /// Nothing at the end, or where the log breaks off (then `error()` says why). Throws what the log
  /// threw besides LogError.
  std::optional<Item> next();
  void stop();

  /// After the last entry.
  const std::string& error() const { return error_; }

 private:
  void read();
  Item prepared(recording::LogEntry&& entry);

  recording::LogReader& log_;
  lio_mapper::CloudDecoder decoder_;
  BoundedQueue<Item> items_;
  std::string error_;
  std::exception_ptr failure_;
  std::thread thread_;  ///< last: it uses the others
};

}  // namespace trigpoint::pipeline
