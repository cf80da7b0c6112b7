// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/supervisor/restart_policy.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace trigpoint::supervisor {

namespace {

constexpr int kWrongConfiguration = 2;
constexpr int kCannotBeStarted = 127;

std::string description(const Ending& ending) {
  if (ending.hung) {
    return "no longer answered and was killed";
  }
  if (ending.signal != 0) {
    return "was killed by signal " + std::to_string(ending.signal) + " (" +
           strsignal(ending.signal) + ")";
  }
  return "ended with code " + std::to_string(ending.code);
}

}  // namespace

Decision RestartPolicy::on_end(const Ending& ending) {
  const std::string why = description(ending);
  const bool by_itself = ending.signal == 0 && !ending.hung;
  if (by_itself && ending.code == 0) {
    return {Decision::What::kEnd, 0.0, why};
  }
  if (by_itself && ending.code == kWrongConfiguration) {
    return {Decision::What::kGiveUp, 0.0, why + " (options or configuration): not restarted"};
  }
  if (by_itself && ending.code == kCannotBeStarted) {
    return {Decision::What::kGiveUp, 0.0, "cannot be started"};
  }
  in_succession_ = ending.lived_s < limits_.soon_s ? in_succession_ + 1 : 1;
  if (in_succession_ > limits_.most_in_succession) {
    return {Decision::What::kGiveUp,
            0.0,
            why + ", for the " + std::to_string(in_succession_) + "th time in quick succession"};
  }
  const double delay_s = limits_.first_delay_s * std::exp2(in_succession_ - 1);
  return {Decision::What::kRestart, std::min(delay_s, limits_.longest_delay_s), why};
}

}  // namespace trigpoint::supervisor
