// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <chrono>
#include <string>

namespace trigpoint::cli {

/// A bar on standard error: redrawn in place on a terminal, one line every tenth elsewhere.
class Progress {
 public:
  explicit Progress(std::string what);
  ~Progress();
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// `share` done, 0 to 1.
  void operator()(double share);

 private:
  void draw(double share, double elapsed_s) const;

  std::string what_;
  bool terminal_;
  double shown_{-1.0};
  std::chrono::steady_clock::time_point start_;
};

}  // namespace trigpoint::cli
