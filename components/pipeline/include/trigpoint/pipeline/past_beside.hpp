// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/lio_mapper/pose_graph.hpp"

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace trigpoint::pipeline {

/// What a session folder that goes on holds of its past, as a mapper wants it. A damaged alignment
/// counts for none: the gate, whose file it is, warns of it.
lio_mapper::GraphInput stored_past(const std::string& session);

struct PastBesideOptions {
  /// So many scans after the snapshot the correction is adopted, and waited for if need be: same
  /// bits on every run. Nothing: as soon as it is ready, and nobody waits.
  std::optional<std::uint64_t> adopt_after_scans;
  /// Added to the thread's niceness.
  int niceness{0};
};

/// Corrects a mapper's past on a thread of its own, one correction at a time. The mapper is touched
/// in after_scans() only, on the caller's thread.
class PastBeside {
 public:
  /// Hands a job to whoever writes the store, to be done once all scans so far are in it. It may be
  /// thrown away undone, but neither be done nor thrown away after this object is gone.
  using OnceWritten = std::function<void(std::function<void()>)>;

  /// `store` is the session's keyframe store. Before the mapper's first input.
  PastBeside(lio_mapper::LioMapper& mapper,
             std::string store,
             const lio_mapper::GraphInput& earlier,
             OnceWritten once_written,
             const PastBesideOptions& options);
  /// As cancel(), and waits for the thread: for one cloud's reading, or a solution of the graph.
  ~PastBeside();
  PastBeside(const PastBeside&) = delete;
  PastBeside& operator=(const PastBeside&) = delete;

  /// After `scans` more have left the mapper: begins a correction when one is due, adopts one that
  /// is ready.
  Events after_scans(std::size_t scans);

  /// What is under way is given up, and nothing begins any more.
  void cancel();

  /// Corrections that were adopted.
  std::uint64_t corrections() const;

  /// The longest time that adopting one has held up the mapper.
  double longest_hold_s() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace trigpoint::pipeline
