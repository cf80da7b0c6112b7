// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What table, CSV, JSON and claims of a reproduction share.
#pragma once

#include "trigpoint/evaluation/reproduction.hpp"

#include <array>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Which of a mode's evaluations.
struct Against {
  const char* key;   ///< for CSV and JSON
  const char* name;  ///< for people
  std::optional<Evaluation> ModeFigures::*evaluation;
};

inline constexpr std::array<Against, 4> kAgainst{
    {{"fixes_fed", "GPS as fed (circular)", &ModeFigures::fixes_fed},
     {"fixes_withheld", "withheld GPS", &ModeFigures::fixes_withheld},
     {"truth", "truth", &ModeFigures::truth},
     {"truth_withheld", "truth, some GPS withheld", &ModeFigures::truth_withheld}}};

/// Alignments that the tables show. SE(3) would hide a map that leans.
inline constexpr std::array<AlignmentKind, 2> kShown{AlignmentKind::kNone,
                                                     AlignmentKind::kYawTranslation};

const Score& score_of(const Evaluation& evaluation, AlignmentKind kind);

/// NaN without an evaluation.
double rmse_of(const std::optional<Evaluation>& evaluation, AlignmentKind kind, bool horizontal);

}  // namespace trigpoint::evaluation
