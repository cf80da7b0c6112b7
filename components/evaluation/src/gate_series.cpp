// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gate_series.hpp"

#include <algorithm>
#include <cmath>

namespace trigpoint::evaluation {

namespace {

constexpr double kUnknownSigma_m = 500.0;  ///< sqrt(kUnknownVariance) is 1000

}  // namespace

bool is_known_sigma(double sigma_m) {
  return std::isfinite(sigma_m) && sigma_m > 0.0 && sigma_m < kUnknownSigma_m;
}

GateTotals totals_of(const std::vector<FusionStatus>& rows) {
  GateTotals totals;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool is_last = i + 1 == rows.size() || rows[i + 1].fixes_seen < rows[i].fixes_seen;
    if (!is_last) {
      continue;
    }
    totals.fixes_seen += rows[i].fixes_seen;
    totals.fixes_used += rows[i].fixes_used;
    for (const NamedCount& verdict : rows[i].verdicts) {
      const auto same = std::find_if(totals.verdicts.begin(),
                                     totals.verdicts.end(),
                                     [&](const auto& sum) { return sum.name == verdict.name; });
      if (same == totals.verdicts.end()) {
        totals.verdicts.push_back(verdict);
      } else {
        same->count += verdict.count;
      }
    }
  }
  return totals;
}

std::vector<SourceRun> source_runs(const std::vector<FusionStatus>& rows, std::size_t axis) {
  std::vector<SourceRun> runs;
  for (std::size_t i = 0; i < rows.size();) {
    const auto source = rows[i].axes.at(axis).source;
    std::size_t end = i + 1;
    while (end < rows.size() && rows[end].axes.at(axis).source == source) {
      ++end;
    }
    runs.push_back({source, rows[i].stamp_ns, rows[std::min(end, rows.size() - 1)].stamp_ns});
    i = end;
  }
  return runs;
}

}  // namespace trigpoint::evaluation
