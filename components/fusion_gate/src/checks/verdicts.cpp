// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/verdicts.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

namespace {

constexpr std::size_t kRemembered = 256;  // 25 s at 10 Hz, far more than a filter rewinds

}  // namespace

bool Verdicts::is_new(Nanoseconds fix_stamp_ns) {
  if (is_judged(fix_stamp_ns)) {
    return false;
  }
  judged_ns_.push_back(fix_stamp_ns);
  if (judged_ns_.size() > kRemembered) {
    judged_ns_.pop_front();
  }
  return true;
}

void Verdicts::remember(Nanoseconds fix_stamp_ns) {
  is_new(fix_stamp_ns);
}

bool Verdicts::is_judged(Nanoseconds fix_stamp_ns) const {
  return std::find(judged_ns_.begin(), judged_ns_.end(), fix_stamp_ns) != judged_ns_.end();
}

void Verdicts::take_back(const std::string& code) {
  const auto found = counts_.find(code);
  if (found == counts_.end()) {
    return;
  }
  --total_;
  if (--found->second == 0) {
    counts_.erase(found);
  }
}

void Verdicts::record(Nanoseconds fix_stamp_ns,
                      bool used,
                      const std::string& code,
                      const std::string& reason) {
  newest_ = {fix_stamp_ns, used, reason};
  new_.push_back(newest_);
  used_ += used ? 1 : 0;
  ++total_;
  ++counts_[code];
}

std::vector<NamedCount> Verdicts::counts() const {
  std::vector<NamedCount> result;
  for (const auto& [name, count] : counts_) {
    result.push_back({name, count});
  }
  return result;
}

}  // namespace trigpoint::fusion_gate
