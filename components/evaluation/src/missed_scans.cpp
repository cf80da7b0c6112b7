// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "missed_scans.hpp"

#include "session_data.hpp"
#include "table.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

namespace trigpoint::evaluation {

namespace {

namespace file = exporter::session_file;

constexpr double kGapIntervals = 1.5;
/// A sweep may seem to arrive this much before its last point: the IMU's newest sample is older.
constexpr double kEarlyIntervals = 0.25;
/// Of the LiDAR's own time between two sweeps: two clocks do not differ by more.
constexpr double kLeastShare = 0.99;
/// From the first to the last arrival of sweeps that waited for each other.
constexpr double kLongestBurst_s = 10.0;
/// Sweeps this near to one that two scans fall on may be what one of them belongs to: arrivals
/// jitter.
constexpr std::ptrdiff_t kJitterSweeps = 2;
/// A successor speaks within 3 s of the death of a mapper (docs/restart_and_replace.md).
constexpr double kRestart_s = 3.0;
/// Of a short drive less is considerable; but not what is always on its way at an end.
constexpr double kConsiderableShare = 0.1;
constexpr double kOnItsWay_s = 1.0;
constexpr std::size_t kListed = 20;

template <typename Value>
Value median_of(std::vector<Value> values) {
  if (values.empty()) {
    return {};
  }
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// By the LiDAR's own clock, since arrivals may come in bursts; by those where it does not go on.
Nanoseconds usual_interval_ns(std::span<const exporter::LoggedSweep> sweeps) {
  std::vector<Nanoseconds> by_stamps;
  std::vector<Nanoseconds> by_arrivals;
  for (std::size_t i = 1; i < sweeps.size(); ++i) {
    by_stamps.push_back(sweeps[i].stamp_ns - sweeps[i - 1].stamp_ns);
    by_arrivals.push_back(sweeps[i].arrival_ns - sweeps[i - 1].arrival_ns);
  }
  const Nanoseconds stamps_ns = median_of(by_stamps);
  return stamps_ns > 0 ? stamps_ns : std::max<Nanoseconds>(0, median_of(by_arrivals));
}

/// By how much a sweep at least arrives before its successor when neither waits: by the LiDAR's
/// own clock. Nullopt where the one says nothing about the other: a drive or a long gap lies
/// between them.
std::optional<Nanoseconds> least_between(const exporter::LoggedSweep& sweep,
                                         const exporter::LoggedSweep& next,
                                         const Breaks& run_begins) {
  const Nanoseconds own_ns = next.stamp_ns - sweep.stamp_ns;
  if (to_seconds(own_ns) > kLongestBurst_s ||
      is_between(run_begins, sweep.arrival_ns, next.arrival_ns)) {
    return std::nullopt;
  }
  return static_cast<Nanoseconds>(kLeastShare *
                                  static_cast<double>(std::max<Nanoseconds>(0, own_ns)));
}

/// When the sweeps would have arrived if none had waited for another. Sweeps that seem to have
/// waited for longer than any burst lasts did not: the LiDAR's clock was set.
std::vector<Nanoseconds> due_of(const SweepsAndScans& there) {
  const auto& sweeps = there.sweeps;
  std::vector<Nanoseconds> due_ns;
  for (const exporter::LoggedSweep& sweep : sweeps) {
    due_ns.push_back(sweep.arrival_ns);
  }
  std::size_t end = sweeps.empty() ? 0 : sweeps.size() - 1;  ///< the newest one of a burst
  for (std::size_t i = end; i-- > 0;) {
    const auto least_ns = least_between(sweeps[i], sweeps[i + 1], there.run_begins);
    if (!least_ns || due_ns[i] <= due_ns[i + 1] - *least_ns) {
      end = i;
    } else if (to_seconds(sweeps[end].arrival_ns - sweeps[i].arrival_ns) <= kLongestBurst_s) {
      due_ns[i] = due_ns[i + 1] - *least_ns;
    } else {
      for (; end > i; --end) {
        due_ns[end] = sweeps[end].arrival_ns;
      }
    }
  }
  return due_ns;
}

/// Finds for every sweep the scan that came of it.
class Answers {
 public:
  explicit Answers(const SweepsAndScans& there)
      : there_(there), due_ns_(due_of(there)), interval_ns_(usual_interval_ns(there.sweeps)) {
    std::vector<std::vector<std::size_t>> scans_of(there.sweeps.size());
    const Nanoseconds delay_ns = usual_delay_ns();
    for (std::size_t i = first_scan(); i < there.scans.size(); ++i) {
      scans_of[nearest(stamp_ns(i) + delay_ns)].push_back(i);
    }
    share_out(scans_of);
    for (const auto& scans : scans_of) {
      scan_of_.push_back(scans.empty() ? std::nullopt : std::optional(scans.front()));
    }
  }

  std::optional<std::size_t> scan_of(std::size_t sweep) const { return scan_of_[sweep]; }

  Nanoseconds stamp_ns(std::size_t scan) const { return there_.scans[scan].status.stamp_ns; }

  /// Scans before it are of drives whose sweeps nobody wrote down.
  std::size_t first_scan() const {
    const Nanoseconds begin_ns = there_.sweeps.front().arrival_ns - kNanosecondsPerSecond;
    const auto first = std::lower_bound(
        there_.scans.begin(),
        there_.scans.end(),
        begin_ns,
        [](const auto& scan, Nanoseconds stamp_ns) { return scan.status.stamp_ns < stamp_ns; });
    return static_cast<std::size_t>(first - there_.scans.begin());
  }

 private:
  std::vector<Nanoseconds>::const_iterator not_before(Nanoseconds due_ns) const {
    return std::lower_bound(due_ns_.begin(), due_ns_.end(), due_ns);
  }

  /// From a sweep's last point to its arrival: at most an interval, or as many more as leave fewer
  /// scans without a sweep.
  Nanoseconds usual_delay_ns() const {
    const auto early_ns =
        static_cast<Nanoseconds>(kEarlyIntervals * static_cast<double>(interval_ns_));
    std::vector<Nanoseconds> delays;
    for (std::size_t i = first_scan(); i < there_.scans.size(); ++i) {
      const auto due_ns = not_before(stamp_ns(i) - early_ns);
      if (due_ns != due_ns_.end()) {
        delays.push_back(*due_ns - stamp_ns(i));
      }
    }
    Nanoseconds delay_ns = median_of(delays);
    std::size_t least = astray(delay_ns);
    for (std::size_t next = astray(delay_ns + interval_ns_); next < least;
         next = astray(delay_ns + interval_ns_)) {
      delay_ns += interval_ns_;
      least = next;
    }
    return delay_ns;
  }

  /// Scans that no sweep is near.
  std::size_t astray(Nanoseconds delay_ns) const {
    std::size_t count = 0;
    for (std::size_t i = first_scan(); i < there_.scans.size(); ++i) {
      const Nanoseconds expected_ns = stamp_ns(i) + delay_ns;
      const Nanoseconds off_ns = due_ns_[nearest(expected_ns)] - expected_ns;
      count += 2 * std::abs(off_ns) > interval_ns_ ? 1 : 0;
    }
    return count;
  }

  std::size_t nearest(Nanoseconds expected_ns) const {
    const auto after = not_before(expected_ns);
    if (after == due_ns_.begin()) {
      return 0;
    }
    const auto before = std::prev(after);
    const bool earlier = after == due_ns_.end() || expected_ns - *before <= *after - expected_ns;
    return static_cast<std::size_t>((earlier ? before : after) - due_ns_.begin());
  }

  /// One scan for each sweep, where two are on neighbours.
  static void share_out(std::vector<std::vector<std::size_t>>& scans_of) {
    const auto count = static_cast<std::ptrdiff_t>(scans_of.size());
    const auto at = [&](std::ptrdiff_t i) -> auto& {
      return scans_of[static_cast<std::size_t>(i)];
    };
    for (std::ptrdiff_t i = 0; i < count; ++i) {
      for (std::ptrdiff_t j = std::max<std::ptrdiff_t>(0, i - kJitterSweeps);
           at(i).empty() && j <= std::min(count - 1, i + kJitterSweeps);
           ++j) {
        if (at(j).size() > 1) {
          const auto moved = j < i ? std::prev(at(j).end()) : at(j).begin();
          at(i).push_back(*moved);
          at(j).erase(moved);
        }
      }
    }
  }

  const SweepsAndScans& there_;
  std::vector<Nanoseconds> due_ns_;
  Nanoseconds interval_ns_;
  std::vector<std::optional<std::size_t>> scan_of_;
};

std::uint64_t less(std::uint64_t from, std::uint64_t what) {
  return from - std::min(from, what);
}

/// Scans up to each one that were refused although they have a row: with too few matches. A mapper
/// that counts from zero again begins with those of its own.
std::vector<std::uint64_t> refused_with_row(const std::vector<exporter::LoggedScan>& scans) {
  std::vector<std::uint64_t> refused;
  std::uint64_t used = 0;
  for (const exporter::LoggedScan& scan : scans) {
    const bool anew = scan.status.scans_used < used;
    const bool unused = scan.status.scans_used == (anew ? 0 : used);
    refused.push_back((anew || refused.empty() ? 0 : refused.back()) + (unused ? 1 : 0));
    used = scan.status.scans_used;
  }
  return refused;
}

/// How many sweeps without a row had been refused, at each scan and (last) at the end. What was
/// received and not used was refused, or still waited; so the least of this from a scan on is an
/// upper bound, met when nothing waits.
std::vector<std::uint64_t> refused_until(const SweepsAndScans& there) {
  const std::vector<std::uint64_t> with_row = refused_with_row(there.scans);
  std::vector<std::uint64_t> refused(there.scans.size() + 1);
  std::uint64_t least = there.refused ? less(*there.refused, with_row.empty() ? 0 : with_row.back())
                                      : std::numeric_limits<std::uint64_t>::max();
  refused.back() = least;
  for (std::size_t i = there.scans.size(); i-- > 0;) {
    const LioStatus& status = there.scans[i].status;
    least = std::min(least, less(less(status.scans_received, status.scans_used), with_row[i]));
    refused[i] = least;
  }
  return refused;
}

/// Goes through the sweeps in order.
class GapFinder {
 public:
  explicit GapFinder(const SweepsAndScans& there)
      : there_(there), answers_(there), refused_(refused_until(there)) {
    if (answers_.first_scan() > 0) {
      refused_before_ = refused_[answers_.first_scan() - 1];
    }
  }

  std::vector<MissedScans> find() {
    for (std::size_t i = 0; i < there_.sweeps.size(); ++i) {
      if (i > 0 && is_between(there_.run_begins, arrival_ns(i - 1), arrival_ns(i))) {
        close(refused_at_next(i));
      }
      const auto scan = answers_.scan_of(i);
      if (!scan) {
        add(i);
        continue;
      }
      gap_.before_ns = answers_.stamp_ns(*scan);
      close(refused_[*scan]);
      refused_before_ = std::max(refused_before_, refused_[*scan]);
      gap_.after_ns = answers_.stamp_ns(*scan);
    }
    close(refused_at_next(there_.sweeps.size()));
    return missed_;
  }

 private:
  Nanoseconds arrival_ns(std::size_t sweep) const { return there_.sweeps[sweep].arrival_ns; }

  std::uint64_t refused_at_next(std::size_t sweep) const {
    for (; sweep < there_.sweeps.size(); ++sweep) {
      if (const auto scan = answers_.scan_of(sweep)) {
        return refused_[*scan];
      }
    }
    return there_.refused ? refused_.back() : refused_before_;
  }

  void add(std::size_t sweep) {
    gap_.first_ns = gap_.first_ns.value_or(arrival_ns(sweep));
    gap_.newest_ns = arrival_ns(sweep);
    ++gap_.scans;
  }

  /// `refused_now`: from the beginning to the end of the gap.
  void close(std::uint64_t refused_now) {
    gap_.refused = std::min(gap_.scans, less(refused_now, refused_before_));
    refused_before_ += gap_.refused;
    gap_.scans -= gap_.refused;
    if (gap_.scans > 0) {
      gap_.silence_s = to_seconds(gap_.before_ns.value_or(*gap_.newest_ns) -
                                  gap_.after_ns.value_or(*gap_.first_ns));
      missed_.push_back(gap_);
    }
    gap_ = {};
  }

  const SweepsAndScans& there_;
  Answers answers_;
  std::vector<std::uint64_t> refused_;
  std::uint64_t refused_before_{0};
  MissedScans gap_;  ///< since the newest scan
  std::vector<MissedScans> missed_;
};

/// Where the beginning or the end is missing the arrivals are known.
std::string where(const MissedScans& gap) {
  const std::string from = gap.after_ns ? exporter::stamp_text(*gap.after_ns)
                           : gap.before_ns
                               ? "the first one at " + exporter::stamp_text(*gap.first_ns)
                               : exporter::stamp_text(*gap.first_ns);
  const std::string to = gap.before_ns ? exporter::stamp_text(*gap.before_ns)
                                       : "the last one at " + exporter::stamp_text(*gap.newest_ns);
  return "between " + from + " and " + to + " (" + fixed(gap.silence_s, 2) + " s)";
}

std::optional<std::uint64_t> refused_by_mapper(const SessionData& data) {
  const std::string prefix = "points.refused.";
  for (const ProgramCounts& program : data.counts) {
    if (program.program != "lio_mapper") {
      continue;
    }
    std::uint64_t refused = 0;
    for (const NamedCount& count : program.counts) {
      refused += count.name.starts_with(prefix) ? count.count : 0;
    }
    return refused;
  }
  return std::nullopt;
}

/// What the mapper counted at its end goes beyond what may have been refused at the newest scan.
bool refused_after_newest_scan(const SessionData& data) {
  const auto refused = refused_by_mapper(data);
  if (!refused || data.scans.empty()) {
    return false;
  }
  const LioStatus& newest = data.scans.back().status;
  return *refused > less(newest.scans_received, newest.scans_used);
}

bool is_of_mapper(const Restart& restart) {
  return restart.restarted && restart.program.find("lio_mapper") != std::string::npos;
}

/// Restarts are told by the computer's clock, which is that of the estimates when a robot drives,
/// and another one when a log is played: so only those within the silence at the end are known.
Nanoseconds newest_begin_ns(const SessionData& data, const MissedScans& end) {
  Nanoseconds begin_ns = end.after_ns.value_or(*end.first_ns);
  for (const Restart& restart : data.restarts) {
    const Nanoseconds restart_ns = restart.unix_s * kNanosecondsPerSecond;
    if (is_of_mapper(restart) && restart_ns <= *end.newest_ns) {
      begin_ns = std::max(begin_ns, restart_ns);
    }
  }
  return begin_ns;
}

/// Since the newest scan, or since the mapper was started again after it, most sweeps were refused:
/// then a mapper did come back, and refusals of its predecessor may be what is missing.
bool came_back_to_refuse(const SessionData& data, const MissedScans& end) {
  if (!std::any_of(data.restarts.begin(), data.restarts.end(), is_of_mapper)) {
    return false;
  }
  const Nanoseconds begin_ns = newest_begin_ns(data, end);
  const auto sweeps = std::count_if(data.sweeps.begin(), data.sweeps.end(), [&](const auto& sweep) {
    return sweep.arrival_ns > begin_ns;
  });
  return 2 * end.refused >= static_cast<std::uint64_t>(sweeps);
}

/// Not empty when there are sweeps.
std::span<const exporter::LoggedSweep> sweeps_of_last_drive(const SessionData& data) {
  const Breaks begins = data.run_begins();
  std::size_t first = data.sweeps.size();
  while (first > 0 && (first == data.sweeps.size() || begins.empty() ||
                       data.sweeps[first - 1].arrival_ns >= begins.back())) {
    --first;
  }
  return std::span(data.sweeps).subspan(first);
}

/// The longest ones, in order of time.
std::string list_of(const std::vector<MissedScans>& missed) {
  std::vector<std::size_t> shown(missed.size());
  std::iota(shown.begin(), shown.end(), std::size_t{0});
  std::stable_sort(shown.begin(), shown.end(), [&](std::size_t a, std::size_t b) {
    return missed[a].scans > missed[b].scans;
  });
  std::uint64_t scans_of_more = 0;
  for (std::size_t i = kListed; i < shown.size(); ++i) {
    scans_of_more += missed[shown[i]].scans;
  }
  shown.resize(std::min(shown.size(), kListed));
  std::sort(shown.begin(), shown.end());
  std::string list;
  for (const std::size_t i : shown) {
    list += "- " + std::to_string(missed[i].scans) + " " + where(missed[i]) + "\n";
  }
  return missed.size() <= kListed ? list
                                  : list + "- and " + std::to_string(missed.size() - kListed) +
                                        " more stretches, none longer, with " +
                                        std::to_string(scans_of_more) + " together\n";
}

}  // namespace

std::vector<MissedScans> find_unanswered_sweeps(const SweepsAndScans& there) {
  return there.sweeps.empty() ? std::vector<MissedScans>{} : GapFinder(there).find();
}

std::vector<MissedScans> find_missed_scans(const std::vector<exporter::LoggedScan>& scans,
                                           const Breaks& run_begins) {
  std::vector<double> intervals_s;
  for (std::size_t i = 1; i < scans.size(); ++i) {
    const Nanoseconds before_ns = scans[i - 1].status.stamp_ns;
    const Nanoseconds stamp_ns = scans[i].status.stamp_ns;
    intervals_s.push_back(
        is_between(run_begins, before_ns, stamp_ns) ? 0.0 : to_seconds(stamp_ns - before_ns));
  }
  const double usual_s = median_of(intervals_s);
  std::vector<MissedScans> missed;
  for (std::size_t i = 0; i < intervals_s.size(); ++i) {
    if (usual_s > 0.0 && intervals_s[i] > kGapIntervals * usual_s) {
      missed.push_back({scans[i].status.stamp_ns,
                        scans[i + 1].status.stamp_ns,
                        static_cast<std::uint64_t>(std::llround(intervals_s[i] / usual_s)) - 1,
                        0,
                        intervals_s[i],
                        std::nullopt,
                        std::nullopt});
    }
  }
  return missed;
}

std::vector<MissedScans> missed_scans_of(const SessionData& data) {
  if (!data.has_scan_log) {
    return {};  // no mapper had a part in it
  }
  if (!data.sweeps.empty()) {
    return find_unanswered_sweeps(
        {data.sweeps, data.scans, refused_by_mapper(data), data.run_begins()});
  }
  return data.restarts.empty() ? std::vector<MissedScans>{}
                               : find_missed_scans(data.scans, data.run_begins());
}

std::string print_missed(const SessionData& data, const std::vector<MissedScans>& missed) {
  std::uint64_t sum = 0;
  for (const MissedScans& gap : missed) {
    sum += gap.scans;
  }
  const std::string list = list_of(missed);
  const std::string of = data.sweeps.empty()
                             ? ", by their usual interval: which sweeps there were nobody wrote "
                               "down, so what is missing at the beginning or the end does not show"
                             : " of the " + std::to_string(data.sweeps.size()) +
                                   " sweeps that there were (refused ones are under Messages)";
  return "Scans missed: " + std::to_string(sum) + of + (list.empty() ? ".\n" : ":\n\n" + list);
}

std::string lost_end(const SessionData& data, const std::vector<MissedScans>& missed) {
  if (data.sweeps.empty() || missed.empty() || missed.back().before_ns ||
      missed.back().newest_ns != data.sweeps.back().arrival_ns) {
    return "";
  }
  const bool was_there = refused_after_newest_scan(data);
  const MissedScans& end = missed.back();
  if (was_there && came_back_to_refuse(data, end)) {
    return "";
  }
  const auto last_drive = sweeps_of_last_drive(data);
  const double missing_s =
      static_cast<double>(end.scans) * to_seconds(usual_interval_ns(last_drive));
  const double share_of_drive =
      static_cast<double>(end.scans) / static_cast<double>(last_drive.size());
  const bool considerable =
      missing_s > kRestart_s || (missing_s > kOnItsWay_s && share_of_drive >= kConsiderableShare);
  if (!considerable) {
    return "";
  }
  const std::string when =
      (end.refused > 0 ? fixed(missing_s, 1) + " s of the last " : std::string("the last ")) +
      fixed(end.silence_s, 1) + " s: ";
  const std::string why = was_there
                              ? "it was there to the end, and did not receive them or was behind"
                              : "it did not come back before the end, or was that far behind";
  return std::to_string(end.scans) + " of " + std::to_string(last_drive.size()) +
         " sweeps were never answered by the mapper, " +
         (end.after_ns ? when + why : std::string("from the first to the last")) +
         ". What was driven then is not in the map.";
}

}  // namespace trigpoint::evaluation
