// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/past_beside.hpp"

#include "trigpoint/base/serial_worker.hpp"
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/export/session.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"
#include "trigpoint/lio_mapper/past.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdio>
#include <filesystem>
#include <map>
#include <mutex>
#include <stdexcept>
#include <utility>

namespace trigpoint::pipeline {

namespace {

using Clock = std::chrono::steady_clock;
using lio_mapper::CorrectedMap;
using lio_mapper::GraphInput;
using lio_mapper::KeyframeReader;
using lio_mapper::PastSnapshot;

/// So few scans are inserted on the mapper's thread; more of them beside it.
constexpr std::size_t kFewScans = 2;
/// Then what is left is inserted at once: who gains so slowly on the mapper never gets there.
constexpr int kMostCatchingUp = 4;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

struct Cancelled {};

/// Clouds of a snapshot's keyframes, found in the store by epoch and stamp.
class Clouds {
 public:
  explicit Clouds(const std::string& store) : reader_(store) {
    std::size_t place = 0;
    reader_.visit_places([&](const lio_mapper::Keyframe& keyframe) {
      places_[{keyframe.odom_epoch, keyframe.stamp_ns}] = place++;
    });
  }

  PointCloud of(const lio_mapper::GraphKeyframe& wanted) {
    const auto place = places_.find({wanted.odom_epoch, wanted.stamp_ns});
    auto keyframe = place == places_.end() ? std::nullopt : reader_.at(place->second);
    if (!keyframe) {
      throw std::runtime_error("a keyframe is not in the store");
    }
    return std::move(keyframe->points_base);
  }

 private:
  KeyframeReader reader_;
  std::map<std::pair<std::uint32_t, Nanoseconds>, std::size_t> places_;
};

/// Tells when a job is destroyed without having been done.
class Undone {
 public:
  explicit Undone(std::function<void()> tell) : tell_(std::move(tell)) {}

  ~Undone() {
    if (tell_) {
      tell_();
    }
  }

  Undone(const Undone&) = delete;
  Undone& operator=(const Undone&) = delete;

  void is_done() { tell_ = nullptr; }

 private:
  std::function<void()> tell_;
};

/// What the thread hands over.
struct Outcome {
  std::optional<CorrectedMap> corrected;
  std::string trouble;  ///< why there is none
};

}  // namespace

GraphInput stored_past(const std::string& session) {
  const std::string store = exporter::path_in(session, exporter::session_file::kKeyframes);
  return std::filesystem::exists(store)
             ? exporter::graph_input_of(session, exporter::DamagedAlignment::kIsNone)
             : GraphInput{};
}

struct PastBeside::Impl {
  Impl(lio_mapper::LioMapper& mapper_to_correct,
       std::string keyframe_store,
       OnceWritten give,
       const PastBesideOptions& chosen)
      : mapper(mapper_to_correct),
        store(std::move(keyframe_store)),
        once_written(std::move(give)),
        options(chosen) {
    if (options.niceness != 0) {
      worker.give([this] {
        // Of this thread alone, on Linux. It may be refused; then it is merely less polite.
        static_cast<void>(setpriority(PRIO_PROCESS,
                                      static_cast<id_t>(gettid()),
                                      getpriority(PRIO_PROCESS, 0) + options.niceness));
      });
    }
  }

  // On the worker.

  void go_on_unless_cancelled() const {
    if (cancelled) {
      throw Cancelled{};
    }
  }

  void correct(PastSnapshot snapshot) {
    Outcome result;
    try {
      Clouds clouds(store);
      const std::vector<lio_mapper::GraphKeyframe> keyframes = snapshot.input.keyframes;
      result.corrected = lio_mapper::correct_local_map(
          std::move(snapshot),
          [&](std::size_t index) {
            go_on_unless_cancelled();
            return clouds.of(keyframes[index]);
          },
          [&](double) { go_on_unless_cancelled(); });
      if (!result.corrected) {
        result.trouble = "the newest stretch cannot be placed";
      }
    } catch (const Cancelled&) {
      result.trouble = "cancelled";
    } catch (const std::exception& error) {
      result.trouble = error.what();
    }
    hand_over(std::move(result));
  }

  void hand_over(Outcome result) {
    {
      const std::lock_guard lock(mutex);
      outcome = std::move(result);
    }
    handed_over.notify_all();
  }

  // On the mapper's thread.

  void begin() {
    auto snapshot = std::make_shared<PastSnapshot>(mapper.past_snapshot());
    busy = true;
    catching_up = 0;
    scans = 0;
    began = Clock::now();
    stamp_ns = snapshot->stamp_ns;
    reason = snapshot->reason;
    once_written(job_for(std::move(snapshot)));
  }

  /// Whoever throws it away undone says so by that.
  std::function<void()> job_for(std::shared_ptr<PastSnapshot> snapshot) {
    auto undone = std::make_shared<Undone>([this] {
      hand_over({{}, "the store was not written"});
    });
    return [this, snapshot = std::move(snapshot), undone = std::move(undone)] {
      undone->is_done();
      worker.give([this, snapshot] { correct(std::move(*snapshot)); });
    };
  }

  std::optional<Outcome> take_outcome() {
    std::unique_lock lock(mutex);
    if (options.adopt_after_scans) {
      if (scans < *options.adopt_after_scans) {
        return std::nullopt;
      }
      handed_over.wait(lock, [this] { return outcome.has_value(); });
    }
    return std::exchange(outcome, std::nullopt);
  }

  /// True when the map is inserting beside the mapper what that has inserted meanwhile.
  bool catch_up(Outcome& result) {
    if (options.adopt_after_scans || catching_up >= kMostCatchingUp) {
      return false;
    }
    auto inserted = std::make_shared<std::vector<PointCloud>>(mapper.take_inserted());
    if (inserted->size() <= kFewScans) {
      result.corrected->insert(*inserted);
      return false;
    }
    ++catching_up;
    auto map = std::make_shared<Outcome>(std::move(result));
    worker.give([this, map, inserted] {
      map->corrected->insert(*inserted);
      hand_over(std::move(*map));
    });
    return true;
  }

  Events conclude(Outcome result, Clock::time_point before) {
    if (!result.corrected || !mapper.adopt(*result.corrected)) {
      mapper.forget_snapshot();
      busy = false;
      const std::string why =
          result.corrected ? "odom has begun anew since, or it took too long" : result.trouble;
      return {{Severity::kWarning, stamp_ns, "past_not_corrected", why + "; the local map stays"}};
    }
    const double hold_s = seconds_since(before);
    longest_hold_s = std::max(longest_hold_s, hold_s);
    ++corrections;
    busy = false;
    const Events events{
        {Severity::kInfo, stamp_ns, "past_corrected", text_of(*result.corrected, hold_s)}};
    // The old map is many megabytes: freeing it would hold up the next scan.
    auto old = std::make_shared<CorrectedMap>(std::move(*result.corrected));
    worker.give([old]() mutable { old.reset(); });
    return events;
  }

  std::string text_of(const CorrectedMap& corrected, double hold_s) const {
    const lio_mapper::PastReport& r = corrected.report;
    char text[320];
    std::snprintf(
        text,
        sizeof text,
        "%s: %zu keyframes, %zu rows, %zu loops; the local map %s %zu keyframes "
        "(%zu left out), moved by at most %.3f m; took %.1f s and %zu scans, held up one by "
        "%.1f ms",
        reason.c_str(),
        r.keyframes,
        r.rows,
        r.loops,
        r.changed ? "is made anew of" : "stays, it holds",
        r.placed,
        r.left_out,
        r.largest_move_m,
        seconds_since(began),
        static_cast<std::size_t>(scans),
        1e3 * hold_s);
    return text;
  }

  lio_mapper::LioMapper& mapper;
  const std::string store;
  OnceWritten once_written;
  const PastBesideOptions options;

  bool busy{false};
  std::uint64_t scans{0};  ///< since the snapshot
  int catching_up{0};      ///< how often
  Clock::time_point began;
  Nanoseconds stamp_ns{0};
  std::string reason;
  std::uint64_t corrections{0};
  double longest_hold_s{0.0};

  std::atomic<bool> cancelled{false};
  std::mutex mutex;  ///< of the outcome
  std::condition_variable handed_over;
  std::optional<Outcome> outcome;
  SerialWorker worker{4};  ///< last: its jobs use the others
};

PastBeside::PastBeside(lio_mapper::LioMapper& mapper,
                       std::string store,
                       const GraphInput& earlier,
                       OnceWritten once_written,
                       const PastBesideOptions& options)
    : impl_(std::make_unique<Impl>(mapper, std::move(store), std::move(once_written), options)) {
  mapper.keep_past(earlier);
}

PastBeside::~PastBeside() {
  cancel();
}

void PastBeside::cancel() {
  impl_->cancelled = true;
}

Events PastBeside::after_scans(std::size_t scans) {
  Impl& impl = *impl_;
  impl.scans += scans;
  if (impl.cancelled || scans == 0) {
    return {};
  }
  if (!impl.busy) {
    if (impl.mapper.past_is_due()) {
      impl.begin();
    }
    return {};
  }
  auto outcome = impl.take_outcome();
  const Clock::time_point before = Clock::now();
  if (!outcome ||
      (outcome->corrected && outcome->corrected->report.changed && impl.catch_up(*outcome))) {
    return {};
  }
  return impl.conclude(std::move(*outcome), before);
}

std::uint64_t PastBeside::corrections() const {
  return impl_->corrections;
}

double PastBeside::longest_hold_s() const {
  return impl_->longest_hold_s;
}

}  // namespace trigpoint::pipeline
