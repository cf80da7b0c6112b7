// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "progress.hpp"

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace trigpoint::cli {

namespace {
constexpr int kWidth = 40;
constexpr double kFirstEstimate_s = 3.0;  // before, opening and starting up tell nothing
}  // namespace

Progress::Progress(std::string what)
    : what_(std::move(what)),
      terminal_(isatty(STDERR_FILENO) == 1),
      start_(std::chrono::steady_clock::now()) {}

Progress::~Progress() {
  if (terminal_ && shown_ >= 0.0) {
    std::fputc('\n', stderr);
  }
}

void Progress::operator()(double share) {
  share = std::clamp(share, 0.0, 1.0);
  const double step = terminal_ ? 0.005 : 0.1;
  if (share < shown_ + step && !(share >= 1.0 && shown_ < 1.0)) {
    return;
  }
  shown_ = share;
  draw(share, std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count());
}

void Progress::draw(double share, double elapsed_s) const {
  const auto filled = static_cast<std::size_t>(std::lround(share * kWidth));
  const std::string bar = std::string(filled, '#') + std::string(kWidth - filled, '.');
  std::string left;
  if (share > 0.0 && share < 1.0 && elapsed_s >= kFirstEstimate_s) {
    left = ", " + std::to_string(std::lround(elapsed_s * (1.0 - share) / share)) + " s to go";
  }
  std::fprintf(stderr,
               "%s%s [%s] %3.0f %%  %.0f s%s%s",
               terminal_ ? "\r" : "",
               what_.c_str(),
               bar.c_str(),
               100.0 * share,
               elapsed_s,
               left.c_str(),
               terminal_ ? "            " : "\n");
  std::fflush(stderr);
}

}  // namespace trigpoint::cli
