// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gps_filter_contract.hpp"

#include "gps_filter_judges.hpp"

#include <array>
#include <cstdarg>
#include <cstdio>

namespace trigpoint::cli {

std::string text(const char* format, ...) {
  std::array<char, 400> buffer{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(buffer.data(), buffer.size(), format, arguments);
  va_end(arguments);
  return buffer.data();
}

std::vector<ContractCheck> judge_filter(const recording::FilterRecord& record,
                                        const FilterScript& script,
                                        const simulator::Truth& truth) {
  ContractChecks checks;
  const FilterDrive drive{record, script, truth};
  judge_form(drive, checks);
  judge_honesty(drive, checks);
  judge_outage(drive, checks);
  return checks;
}

}  // namespace trigpoint::cli
