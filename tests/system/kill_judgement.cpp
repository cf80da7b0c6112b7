// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "kill_judgement.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::tests {

namespace {

double in_seconds(Clock::duration duration) {
  return std::chrono::duration<double>(duration).count();
}

Clock::duration as_duration(double duration_s) {
  return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(duration_s));
}

/// The first one of who works now: what its predecessor still had under way is none.
const Word* first_word(const std::vector<Word>& words, const Struck& struck) {
  std::string before;
  for (const Word& word : words) {
    if (word.at < struck.at) {
      before = word.writer;
    } else if (word.at >= struck.returned && (!struck.restarted || word.writer != before)) {
      return &word;
    }
  }
  return nullptr;
}

double worst_between_m(const std::vector<evaluation::PosePair>& pairs,
                       Nanoseconds from_ns,
                       Nanoseconds to_ns) {
  double worst_m = std::numeric_limits<double>::quiet_NaN();
  for (const evaluation::PosePair& pair : pairs) {
    if (pair.stamp_ns >= from_ns && pair.stamp_ns <= to_ns) {
      worst_m = std::fmax(worst_m, (pair.estimate.p - pair.reference.p).norm());
    }
  }
  return worst_m;
}

}  // namespace

double longest_gap_s(const std::vector<Word>& words,
                     Clock::time_point from,
                     Clock::time_point end) {
  Clock::time_point last = from;
  double longest_s = 0.0;
  for (const Word& word : words) {
    if (word.at > from && word.at <= end) {
      longest_s = std::max(longest_s, in_seconds(word.at - last));
      last = word.at;
    }
  }
  return std::max(longest_s, in_seconds(end - last));
}

Nanoseconds drive_time_ns(const Words& words, Clock::time_point at) {
  Nanoseconds newest_ns = 0;
  for (const auto& [process, spoken] : words) {
    for (const Word& word : spoken) {
      newest_ns = word.at <= at ? std::max(newest_ns, word.stamp_ns) : newest_ns;
    }
  }
  return newest_ns;
}

BlowResult judge_blow(const Struck& struck,
                      const Words& words,
                      Nanoseconds drive_end_ns,
                      const std::vector<evaluation::PosePair>& fused_and_truth) {
  const Nanoseconds blow_ns = drive_time_ns(words, struck.at);
  const auto until_end = std::chrono::nanoseconds(drive_end_ns - blow_ns);
  const Clock::time_point end =
      struck.at + std::min<Clock::duration>(as_duration(kWatched_s), until_end);
  BlowResult result;
  result.blow = struck.blow;
  result.restarted = struck.restarted;
  for (const std::string& process : {kMapper, kGate, kFilter}) {
    const auto found = words.find(process);
    const std::vector<Word> spoken = found == words.end() ? std::vector<Word>{} : found->second;
    if (process != struck.blow.process) {
      result.others_gap_s = std::max(result.others_gap_s, longest_gap_s(spoken, struck.at, end));
    } else if (const Word* first = first_word(spoken, struck); first != nullptr) {
      result.pick_up_s = in_seconds(first->at - struck.returned);
      result.down_s = in_seconds(first->at - struck.at);
    }
  }
  result.worst_after_m =
      worst_between_m(fused_and_truth, blow_ns, blow_ns + from_seconds(kWorstWithin_s));
  return result;
}

double down_limit_s(Kind kind) {
  return kind == Kind::kKill    ? kDownAfterKill_s
         : kind == Kind::kPause ? kDownAfterPause_s
                                : kDownAfterHang_s;
}

bool held(const BlowResult& blow) {
  return blow.restarted == (blow.blow.kind != Kind::kPause) && blow.pick_up_s <= kPickUp_s &&
         blow.down_s <= down_limit_s(blow.blow.kind) && blow.others_gap_s <= kOthersGap_s;
}

std::uint64_t missed_scans(const DriveResult& drive) {
  return drive.scans_played - std::min(drive.scans_played, drive.scans_done);
}

bool missed_scans_are_listed(const DriveResult& drive) {
  const std::uint64_t missed = missed_scans(drive);
  return drive.scans_played > 0 && drive.scans_listed + kUncounted >= missed &&
         drive.scans_listed <= missed + kUncounted;
}

double least_covered_s(double possible_s, const std::vector<BlowResult>& blows) {
  double down_s = 0.0;
  for (const BlowResult& blow : blows) {
    if (blow.blow.process == kGate) {
      down_s += std::min(blow.down_s, down_limit_s(blow.blow.kind));
    } else if (blow.blow.process == kMapper) {
      down_s += std::min(blow.others_gap_s, kOthersGap_s);
    }
  }
  return kCovered * possible_s - down_s;
}

}  // namespace trigpoint::tests
