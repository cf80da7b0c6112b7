// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::supervisor {

/// How a program ended.
struct Ending {
  int code{0};    ///< exit code; not meaningful after a signal
  int signal{0};  ///< the signal that ended it, or 0
  double lived_s{0.0};
  bool hung{false};  ///< it was killed because it no longer answered
};

struct RestartLimits {
  double first_delay_s{0.1};
  double longest_delay_s{5.0};
  double soon_s{10.0};  ///< who lived shorter failed in quick succession
  int most_in_succession{5};
};

struct Decision {
  enum class What { kEnd, kRestart, kGiveUp };
  What what{What::kEnd};
  double after_s{0.0};  ///< of kRestart
  std::string why;      ///< "was killed by signal 9 (Killed)" and the like
};

/// Restart on failure with a delay that doubles while failures follow each other quickly. A program
/// that ends with 0 did so because it was told to, and one that ends with 2 would do so again:
/// wrong options or configuration.
class RestartPolicy {
 public:
  explicit RestartPolicy(const RestartLimits& limits = {}) : limits_(limits) {}

  Decision on_end(const Ending& ending);

 private:
  RestartLimits limits_;
  int in_succession_{0};
};

}  // namespace trigpoint::supervisor
