// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "damaged_files.hpp"

namespace trigpoint::pipeline {

Event warning_of(const std::runtime_error& damaged, const std::string& consequence) {
  return {Severity::kWarning,
          0,
          "session_file_damaged",
          std::string(damaged.what()) + "; " + consequence};
}

exporter::CountsWriter open_counts(const std::string& session,
                                   const std::string& program,
                                   exporter::Opening opening,
                                   Events& events) {
  try {
    return {session, program, opening};
  } catch (const std::runtime_error& damaged) {
    events.push_back(warning_of(damaged, "the counts of " + program + " begin anew"));
    return {session, program, exporter::Opening::kFresh};
  }
}

}  // namespace trigpoint::pipeline
