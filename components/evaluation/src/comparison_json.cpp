// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/comparison.hpp"

#include "json.hpp"

namespace trigpoint::evaluation {

namespace {

using json::array;
using json::number;
using json::Object;
using json::text;

std::string json_of(const Statistics& s) {
  return Object()
      .add("rmse", number(s.rmse))
      .add("mean", number(s.mean))
      .add("median", number(s.median))
      .add("std", number(s.standard_deviation))
      .add("min", number(s.min))
      .add("max", number(s.max))
      .str();
}

std::string json_of(const Eigen::Vector3d& v) {
  return array({number(v.x()), number(v.y()), number(v.z())});
}

std::string json_of(const AbsoluteError& error) {
  return Object()
      .add("position_m", json_of(error.position_m))
      .add("horizontal_m", json_of(error.horizontal_m))
      .add("x_m", json_of(error.axes_m[0]))
      .add("y_m", json_of(error.axes_m[1]))
      .add("z_m", json_of(error.axes_m[2]))
      .add("bias_m", json_of(error.bias_m))
      .add("rotation_deg", json_of(error.rotation_deg))
      .str();
}

std::string json_of(const Score& score, ReferenceKind kind) {
  Object object;
  object.add("alignment", text(name_of(score.alignment)));
  if (!score.T_reference_estimate) {
    return object.add("error", "null").str();
  }
  const Pose& T = *score.T_reference_estimate;
  object.add("translation_m", json_of(T.p))
      .add("quaternion_xyzw",
           array({number(T.q.x()), number(T.q.y()), number(T.q.z()), number(T.q.w())}));
  AbsoluteError error = score.error;
  if (kind == ReferenceKind::kPositions) {
    error.rotation_deg = statistics_of({});  // a fix has no attitude
  }
  return object.add("error", json_of(error)).str();
}

std::string json_of(const RelativeError& error) {
  return Object()
      .add("length_m", number(error.length_m))
      .add("segments", number(static_cast<std::uint64_t>(error.segments)))
      .add("translation_percent", number(error.translation_percent))
      .add("rotation_deg_per_m", number(error.rotation_deg_per_m))
      .str();
}

std::string json_of(const EndToEnd& end) {
  return Object()
      .add("error_m", number(end.error_m))
      .add("error_deg", number(end.error_deg))
      .add("distance_m", number(end.distance_m))
      .add("percent", number(end.percent))
      .str();
}

std::string json_of(const Step& step) {
  return Object()
      .add("distance_m", number(step.distance_m))
      .add("rotation_deg", number(step.rotation_deg))
      .add("stamp_ns", number(step.stamp_ns))
      .add("intervals", number(static_cast<std::uint64_t>(step.intervals)))
      .add("relative_to_lio", step.relative_to_lio ? "true" : "false")
      .str();
}

std::string json_of(const OutageError& outage) {
  return Object()
      .add("begin_ns", number(outage.window.begin_ns))
      .add("end_ns", number(outage.window.end_ns))
      .add("pairs", number(static_cast<std::uint64_t>(outage.pairs)))
      .add("begin_m", number(outage.begin_m))
      .add("max_m", number(outage.max_m))
      .add("end_m", number(outage.end_m))
      .add("distance_m", number(outage.distance_m))
      .str();
}

std::string json_of(const Compared& compared) {
  const Evaluation& e = compared.evaluation;
  std::vector<std::string> scores;
  for (const Score& score : e.scores) {
    scores.push_back(json_of(score, e.reference_kind));
  }
  std::vector<std::string> relative;
  for (const RelativeError& error : e.relative) {
    relative.push_back(json_of(error));
  }
  std::vector<std::string> outages;
  for (const OutageError& outage : e.outages) {
    outages.push_back(json_of(outage));
  }
  Object object;
  object.add("estimate", text(e.estimate_name))
      .add("in_reference_frame", compared.is_in_reference_frame ? "true" : "false")
      .add("pairs", number(static_cast<std::uint64_t>(e.pairs)))
      .add("coverage_from_first", number(e.coverage.from_first))
      .add("coverage_whole", number(e.coverage.whole))
      .add("scores", array(scores))
      .add("relative", array(relative))
      .add("end_to_end", json_of(e.end_to_end))
      .add("step", e.step ? json_of(*e.step) : "null")
      .add("gps_good", e.good ? json_of(e.good->position_m) : "null")
      .add("outages", array(outages));
  return object.str();
}

}  // namespace

std::string to_json(const Comparison& comparison) {
  std::vector<std::string> blocks;
  for (const ComparisonBlock& block : comparison.blocks) {
    std::vector<std::string> compared;
    for (const Compared& each : block.compared) {
      compared.push_back("\n  " + json_of(each));
    }
    blocks.push_back("\n " + Object()
                                 .add("reference", text(block.reference_name))
                                 .add("remark", text(block.remark))
                                 .add("compared", array(compared))
                                 .str());
  }
  std::vector<std::string> remarks;
  for (const std::string& remark : comparison.remarks) {
    remarks.push_back(text(remark));
  }
  Object object;
  object.add("blocks", array(blocks)).add("remarks", array(remarks));
  if (comparison.map) {
    object.add("map", to_json(*comparison.map));
  }
  return object.str() + "\n";
}

}  // namespace trigpoint::evaluation
