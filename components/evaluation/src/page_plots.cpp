// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "page_plots.hpp"

#include "fix_reference.hpp"
#include "gate_series.hpp"
#include "pictures.hpp"
#include "svg_plot.hpp"
#include "table.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace trigpoint::evaluation {

namespace {

using PlotPoints = std::vector<Eigen::Vector2d>;

constexpr std::size_t kMostKinds = 8;  ///< rows of verdicts; the rarest share the last
constexpr double kNameInRow = 0.3;     ///< parts of a row from its upper edge
constexpr double kDotsInRow = 0.75;

class TimePlots {
 public:
  explicit TimePlots(const SessionData& data)
      : data_(data), span_(data.span()), outages_(data.outages()) {}

  double time_s(Nanoseconds stamp_ns) const { return seconds_since(span_.begin_ns, stamp_ns); }

  Axis time_axis() const { return {0.0, std::max(1.0, time_s(span_.end_ns)), false, "time [s]"}; }

  std::vector<Band> dropouts() const {
    std::vector<Band> bands;
    for (const auto& window : outages_) {
      bands.push_back({"dropout",
                       "GPS dropout " + std::to_string(bands.size() + 1),
                       time_s(window.begin_ns),
                       time_s(window.end_ns)});
    }
    return bands;
  }

  /// Of `rows`, what `value` says of each.
  template <typename Rows, typename Value>
  PlotPoints over_time(const Rows& rows, const Value& value) const {
    PlotPoints points;
    for (const auto& row : rows) {
      points.emplace_back(time_s(row.stamp_ns), value(row));
    }
    return thinned_by_extremes(points);
  }

  PlotPoints heights(const Trajectory& trajectory, const Pose& T = Pose{}) const {
    return over_time(trajectory, [&](const auto& row) { return (T * row.pose.p).z(); });
  }

  PlotPoints errors(const Trajectory& trajectory, const Pose& T = Pose{}) const {
    return over_time(associate(trajectory, data_.truth).pairs, [&](const auto& pair) {
      return std::max((T * pair.estimate.p - pair.reference.p).norm(), kLowestError_m);
    });
  }

  /// Stretches in which the gate took the axis from one source.
  std::vector<Band> choices(std::size_t axis) const {
    std::vector<Band> bands;
    for (const auto& run : source_runs(data_.gate, axis)) {
      const std::string name = kSourceNames.at(static_cast<std::size_t>(run.source));
      bands.push_back(
          {"choice-" + name, "gate: " + name, time_s(run.begin_ns), time_s(run.end_ns)});
    }
    return bands;
  }

 private:
  const SessionData& data_;
  Window span_;
  std::vector<Window> outages_;
};

/// From the smallest value to the largest of all curves, with room at both ends.
Axis axis_of(const std::vector<PlotCurve>& curves, bool logarithmic, const std::string& label) {
  double low = std::numeric_limits<double>::max();
  double high = std::numeric_limits<double>::lowest();
  for (const auto& curve : curves) {
    for (const auto& point : curve.points) {
      if (point.allFinite() && (!logarithmic || point.y() > 0.0)) {
        low = std::min(low, point.y());
        high = std::max(high, point.y());
      }
    }
  }
  if (low > high) {
    return {logarithmic ? 0.1 : 0.0, 1.0, logarithmic, label};
  }
  if (logarithmic) {
    return {low / 2.0, high * 2.0, true, label};
  }
  const double margin = std::max(0.06 * (high - low), 0.05);
  return {low - margin, high + margin, false, label};
}

std::string plot(const TimePlots& time,
                 const std::string& id,
                 const std::string& title,
                 const Axis& y,
                 const std::vector<PlotCurve>& curves,
                 const std::vector<Band>& strip = {}) {
  const bool is_empty =
      std::all_of(curves.begin(), curves.end(), [](auto& curve) { return curve.points.empty(); });
  if (is_empty) {
    return "";
  }
  SvgPlot drawing(id, title, time.time_axis(), y);
  drawing.add_bands(time.dropouts(), "GPS dropout");
  drawing.add_strip(strip);
  for (const auto& curve : curves) {
    drawing.add(curve);
  }
  return drawing.html("time");
}

std::string plot_sigma(const SessionData& data, const TimePlots& time, std::size_t axis) {
  const std::string name = kAxisNames.at(axis);
  const auto sigma = [&](const FusionStatus& row) {
    const double sigma_m = row.axes.at(axis).sigma_m;
    return is_known_sigma(sigma_m) ? std::max(sigma_m, kLowestSigma_m) : kNaN;
  };
  const auto of_alignment = [&](const FusionStatus& row) {
    const double sigma_m = row.position_sigma_m.at(axis);
    return is_known_sigma(sigma_m) ? std::max(sigma_m, kLowestSigma_m) : kNaN;
  };
  const auto threshold = [&](const FusionStatus& row) { return row.axes.at(axis).threshold_m; };
  const std::vector<PlotCurve> curves{
      {"alignment", "sigma of the alignment", time.over_time(data.gate, of_alignment)},
      {"threshold", "threshold", time.over_time(data.gate, threshold)},
      {"gps", "sigma of the GPS odometry", time.over_time(data.gate, sigma)}};
  Axis y = axis_of(curves, true, "sigma [m]");
  y.from /= 1.6;  // the strip of choices lies there
  return plot(time, "sigma-" + name, "Uncertainty " + name, y, curves, time.choices(axis));
}

std::vector<PlotCurve> estimates(const PlotPoints& gps,
                                 const PlotPoints& fused,
                                 const PlotPoints& lio,
                                 bool is_lio_in_map) {
  return {{"gps", "gps filter", gps},
          {"fused", "fused", fused},
          // Last and thinner: where the two agree both are seen.
          {"lio", lio_title(is_lio_in_map), lio}};
}

/// The most frequent kinds first.
std::vector<std::string> kinds_of(const std::vector<FixVerdict>& verdicts) {
  std::map<std::string, std::size_t> counts;
  for (const auto& verdict : verdicts) {
    ++counts[kind_of_verdict(verdict)];
  }
  std::vector<std::string> kinds;
  for (const auto& [kind, count] : counts) {
    kinds.push_back(kind);
  }
  std::stable_sort(kinds.begin(), kinds.end(), [&](const auto& a, const auto& b) {
    return counts.at(a) > counts.at(b);
  });
  if (kinds.size() > kMostKinds) {
    kinds.resize(kMostKinds);
    kinds.back() = "other";
  }
  return kinds;
}

}  // namespace

std::string plot_uncertainty(const SessionData& data) {
  if (data.gate.empty()) {
    return "";
  }
  const TimePlots time(data);
  return plot_sigma(data, time, 0) + plot_sigma(data, time, 1) + plot_sigma(data, time, 2);
}

std::string kind_of_verdict(const FixVerdict& verdict) {
  for (const auto& [begin, name] : {std::pair{"rows:", "used, rows for the mapper"},
                                    std::pair{"no row:", "no row on any axis"}}) {
    if (verdict.reason.rfind(begin, 0) == 0) {
      return name;
    }
  }
  std::string kind = verdict.reason.substr(0, verdict.reason.find_first_of(",;"));
  // Numbers make a kind of their own of every fix. Digits within words are names.
  for (std::size_t i = 0; i < kind.size(); ++i) {
    const bool begins = std::isdigit(static_cast<unsigned char>(kind[i])) != 0 &&
                        (i == 0 || std::isalnum(static_cast<unsigned char>(kind[i - 1])) == 0);
    if (begins) {
      const auto end = kind.find_first_not_of("0123456789.", i);
      kind.replace(i, std::min(end, kind.size()) - i, "n");
    }
  }
  return kind.empty() ? (verdict.used ? "used" : "no verdict") : kind;
}

std::vector<FixVerdict> last_verdicts(const SessionData& data) {
  std::map<Nanoseconds, FixVerdict> by_stamp;
  for (const auto& row : data.gate) {
    if (row.verdict.fix_stamp_ns == 0) {
      continue;
    }
    FixVerdict& kept = by_stamp[row.verdict.fix_stamp_ns];
    if (!kept.used || row.verdict.used) {
      kept = row.verdict;
    }
  }
  std::vector<FixVerdict> verdicts;
  for (const auto& [stamp_ns, verdict] : by_stamp) {
    verdicts.push_back(verdict);
  }
  return verdicts;
}

std::string plot_verdicts(const SessionData& data) {
  const auto verdicts = last_verdicts(data);
  if (verdicts.empty()) {
    return "";
  }
  const auto kinds = kinds_of(verdicts);
  const TimePlots time(data);
  const auto rows = static_cast<double>(kinds.size());
  SvgPlot drawing("verdicts",
                  "Verdicts of the gate on fixes",
                  time.time_axis(),
                  {0.0, rows, false, ""},
                  900.0 * rows);
  drawing.add_bands(time.dropouts(), "GPS dropout");
  PlotCurve used{"used", "used", {}, Drawn::kDots};
  PlotCurve refused{"refused", "not used", {}, Drawn::kDots};
  for (const auto& verdict : verdicts) {
    const auto at = std::find(kinds.begin(), kinds.end() - 1, kind_of_verdict(verdict));
    const double y = rows - kDotsInRow - static_cast<double>(at - kinds.begin());
    (verdict.used ? used : refused).points.emplace_back(time.time_s(verdict.fix_stamp_ns), y);
  }
  drawing.add(used);
  drawing.add(refused);
  std::vector<Mark> marks;
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    marks.push_back({rows - kNameInRow - static_cast<double>(i), kinds[i]});
  }
  drawing.set_y_marks(marks);
  return drawing.html("time rows");
}

std::string plot_height(const SessionData& data) {
  const TimePlots time(data);
  const auto T_map_odom = lio_placement(data);
  Trajectory fixes;
  if (data.datum) {
    fixes = fix_positions(data.fixes, *data.datum, FixChoice::kAll);
  }
  std::vector<PlotCurve> curves{
      {"fix", "fixes (antenna)", time.heights(thinned(fixes, 6000)), Drawn::kDots},
      {"truth", "truth", time.heights(data.truth)}};
  for (auto& curve : estimates(time.heights(data.gps),
                               time.heights(data.fused),
                               time.heights(data.lio, T_map_odom.value_or(Pose{})),
                               T_map_odom.has_value())) {
    curves.push_back(std::move(curve));
  }
  return plot(time, "height", "Height in map", axis_of(curves, false, "z [m]"), curves);
}

std::string plot_error(const SessionData& data) {
  if (data.truth.empty()) {
    return "";
  }
  const TimePlots time(data);
  const auto T_map_odom = lio_placement(data);
  const auto curves = estimates(time.errors(data.gps),
                                time.errors(data.fused),
                                T_map_odom ? time.errors(data.lio, *T_map_odom) : PlotPoints{},
                                T_map_odom.has_value());
  return plot(time, "error", "Distance from truth", axis_of(curves, true, "error [m]"), curves);
}

std::string plot_scan_times(const SessionData& data) {
  const TimePlots time(data);
  PlotPoints times_ms;
  std::vector<double> intervals_ms;
  for (std::size_t i = 0; i < data.scans.size(); ++i) {
    const auto& status = data.scans[i].status;
    times_ms.emplace_back(time.time_s(status.stamp_ns), status.scan_ms);
    if (i > 0) {
      intervals_ms.push_back(1e3 * to_seconds(status.stamp_ns - data.scans[i - 1].status.stamp_ns));
    }
  }
  if (times_ms.empty()) {
    return "";
  }
  std::vector<PlotCurve> curves{{"gps", "one scan", thinned_by_extremes(times_ms)}};
  if (!intervals_ms.empty()) {
    const auto middle = intervals_ms.begin() + static_cast<std::ptrdiff_t>(intervals_ms.size() / 2);
    std::nth_element(intervals_ms.begin(), middle, intervals_ms.end());
    const double end_s = time.time_axis().to;
    curves.push_back({"threshold",
                      "real time (" + fixed(*middle, 0) + " ms between scans)",
                      {{0.0, *middle}, {end_s, *middle}}});
  }
  return plot(
      time, "scan-times", "Processing time of each scan", axis_of(curves, true, "ms"), curves);
}

}  // namespace trigpoint::evaluation
