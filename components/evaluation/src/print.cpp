// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/evaluate.hpp"

#include "table.hpp"

#include <cmath>

namespace trigpoint::evaluation {

namespace {

void add_row(Table& table, const std::string& name, const Statistics& s, int decimals) {
  table.add({name,
             fixed(s.rmse, decimals),
             fixed(s.mean, decimals),
             fixed(s.median, decimals),
             fixed(s.max, decimals),
             fixed(s.min, decimals),
             fixed(s.standard_deviation, decimals)});
}

std::string print(const Score& score, ReferenceKind kind) {
  std::string text = "\nAlignment: " + name_of(score.alignment);
  if (!score.T_reference_estimate) {
    return text + ": not determined by these positions (too few, or in one place or on one line)\n";
  }
  text += "\n\n";
  Table table({"error", "rmse", "mean", "median", "max", "min", "std"});
  add_row(table, "position [m]", score.error.position_m, 3);
  add_row(table, "horizontal [m]", score.error.horizontal_m, 3);
  add_row(table, "x (east) [m]", score.error.axes_m[0], 3);
  add_row(table, "y (north) [m]", score.error.axes_m[1], 3);
  add_row(table, "z (up) [m]", score.error.axes_m[2], 3);
  if (kind == ReferenceKind::kPoses) {
    add_row(table, "rotation [deg]", score.error.rotation_deg, 3);
  }
  const auto& bias = score.error.bias_m;
  return text + table.str() + "\nBias (x, y, z): " + fixed(bias.x(), 3) + ", " +
         fixed(bias.y(), 3) + ", " + fixed(bias.z(), 3) + " m\n";
}

std::string print_relative(const Evaluation& evaluation) {
  Table table({"segments of", "number", "translation [%]", "rotation [deg/m]"});
  for (const auto& error : evaluation.relative) {
    table.add({fixed(error.length_m, 0) + " m",
               std::to_string(error.segments),
               fixed(error.translation_percent, 3),
               fixed(error.rotation_deg_per_m, 5)});
  }
  const std::string how = evaluation.reference_kind == ReferenceKind::kPoses
                              ? "needs no alignment"
                              : "positions only, aligned by yaw + translation";
  return "\nRelative error per distance (" + how + ")\n\n" + table.str();
}

std::string print_outages(const Evaluation& evaluation) {
  std::string text;
  if (evaluation.good) {
    text += "\nGPS good (outside outages): position rmse " +
            fixed(evaluation.good->position_m.rmse, 3) + " m, max " +
            fixed(evaluation.good->position_m.max, 3) + " m, no alignment\n";
  }
  for (const auto& outage : evaluation.outages) {
    text += "Outage of " + fixed(to_seconds(outage.window.end_ns - outage.window.begin_ns), 1) +
            " s from " + exporter::stamp_text(outage.window.begin_ns) + ": ";
    text += outage.pairs == 0 ? "nothing of the reference lies inside\n"
                              : "error at begin " + fixed(outage.begin_m, 3) + " m, max " +
                                    fixed(outage.max_m, 3) + " m, at end " +
                                    fixed(outage.end_m, 3) + " m, no alignment\n";
  }
  return text;
}

}  // namespace

std::string print(const Evaluation& evaluation) {
  std::string text =
      "Estimate:  " + evaluation.estimate_name + "\nReference: " + evaluation.reference_name +
      "\nPairs: " + std::to_string(evaluation.pairs) +
      "; coverage of the reference: " + share(evaluation.coverage.from_first) +
      " from the estimate's first pose, " + share(evaluation.coverage.whole) + " of the whole\n";
  for (const auto& score : evaluation.scores) {
    text += print(score, evaluation.reference_kind);
  }
  text += print_relative(evaluation);
  if (std::isfinite(evaluation.end_to_end.error_m)) {
    const auto& e = evaluation.end_to_end;
    text += "\nEnd to end: " + fixed(e.error_m, 3) + " m and " + fixed(e.error_deg, 3) +
            " deg after " + fixed(e.distance_m, 1) + " m (" + fixed(e.percent, 3) + " %)\n";
  }
  if (evaluation.step) {
    text += "Largest step" +
            std::string(evaluation.step->relative_to_lio ? " against the LIO"
                                                         : " between consecutive poses") +
            ": " + fixed(evaluation.step->distance_m, 3) + " m at " +
            exporter::stamp_text(evaluation.step->stamp_ns) + "\n";
  }
  return text + print_outages(evaluation);
}

}  // namespace trigpoint::evaluation
