// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion_rows.hpp"

#include "fusion_map.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace trigpoint::fusion_table {

namespace {

using evaluation::AlignmentKind;
using evaluation::Window;

constexpr Nanoseconds kStepInterval_ns = 100'000'000;
constexpr double kLargestStep_m = 0.05;
constexpr double kReturned_m = 0.1;
constexpr double kReturnTime_s = 5.0;
constexpr double kReturnableError_m = 1.0;
constexpr double kOutageShare = 0.005;
constexpr double kOutageError_m = 0.05;
constexpr double kWrongFixError_m = 0.3;
constexpr std::size_t kFixesUntilClosed = 2;
constexpr double kTimeUntilClosed_s = 1.0;
/// A row along an axis that the fault moves by less harms nobody.
constexpr double kWrong_m = 0.3;
/// From here on a wandering fix is at fault.
constexpr double kWandered_m = 0.05;
constexpr double kFaultError_m = 0.5;
constexpr double kSpike_m = 0.5;  // threshold of Algorithm I
constexpr double kAtStart_s = 10.0;
constexpr double kStartError_m = 0.3;
constexpr double kRealigned_m = 20.0;
constexpr double kOverGps_m = 0.2;
constexpr double kHeightFaultRms_m = 0.08;
constexpr double kHeightShare = 0.003;
constexpr double kHeightError_m = 0.1;
constexpr double kSortedDifference_m = 0.02;
constexpr Nanoseconds kSettled_ns = 2 * kNanosecondsPerSecond;

Bound at_most(double value) {
  return {std::nullopt, value};
}

Figure figure(std::string name, double value, Bound bound = {}) {
  Figure result;
  result.name = std::move(name);
  result.value = value;
  result.bound = bound;
  return result;
}

double rmse_m(const std::vector<evaluation::PosePair>& pairs, AlignmentKind alignment) {
  const auto T = evaluation::align(pairs, alignment);
  return T ? evaluation::absolute_error(evaluation::place_estimates(*T, pairs)).position_m.rmse
           : kNaN;
}

Figure largest_step(const Drive& drive, const Run& run, Bound bound = {}) {
  const auto step = evaluation::largest_step_over(run.fused, run.odom, kStepInterval_ns);
  Figure result =
      figure("largest step in 100 ms, m", step.intervals > 0 ? step.distance_m : kNaN, bound);
  result.detail =
      "after " + std::to_string(to_seconds(step.stamp_ns - drive.truth->first_ns())) + " s";
  return result;
}

/// An estimate that begins late has less to be scored.
Figure first_pose(const Drive& drive, const Run& run) {
  return figure(
      "first pose in map after, s",
      run.fused.empty() ? kNaN : to_seconds(run.fused.front().stamp_ns - drive.truth->first_ns()));
}

std::string numbered(const std::string& name, std::size_t i, std::size_t n) {
  return n == 1 ? name : name + " (" + std::to_string(i + 1) + ")";
}

/// The root mean square error without alignment and with yaw and translation.
Figures whole_drive(const Drive& drive, const Run& run, double bound_m) {
  return {
      figure(
          "RMSE without alignment, m", rmse_m(run.pairs, AlignmentKind::kNone), at_most(bound_m)),
      figure("RMSE aligned in yaw and translation, m",
             rmse_m(run.pairs, AlignmentKind::kYawTranslation)),
      first_pose(drive, run)};
}

Figures campus_twice(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  Figures figures = whole_drive(drive, run, 0.05);
  const Run* lio = drive.run_of("lio");
  const double lio_m = lio ? rmse_m(lio->pairs, AlignmentKind::kYawTranslation) : kNaN;
  Figure ratio = figure("RMSE / aligned RMSE of mode lio", figures[0].value / lio_m);
  if (lio && mode != "lio") {
    ratio.bound = at_most(0.3);
  }
  figures.push_back(ratio);
  figures.push_back(largest_step(drive, run));
  return figures;
}

Figures outage(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  Figures figures;
  const auto windows = outages(drive);
  const auto errors = evaluation::outage_errors(run.pairs, windows);
  for (std::size_t i = 0; i < windows.size(); ++i) {
    const auto name = [&](const std::string& text) { return numbered(text, i, windows.size()); };
    const auto& error = errors[i];
    figures.push_back(figure(name("error at the outage's end, m"),
                             error.end_m,
                             at_most(kOutageShare * error.distance_m + kOutageError_m)));
    figures.push_back(
        figure(name("% of the distance driven in it"), 100.0 * error.end_m / error.distance_m));
    const auto back_s = evaluation::time_to_return_s(run.pairs, windows[i].end_ns, kReturned_m);
    Figure back = figure(name("back within 0.1 m after, s"), back_s.value_or(kNaN));
    if (error.end_m < kReturnableError_m) {
      back.bound = at_most(kReturnTime_s);
    }
    figures.push_back(back);
  }
  figures.push_back(largest_step(drive, run, at_most(kLargestStep_m)));
  return figures;
}

/// Stretches in which the GPS filter says that it is worse than Algorithm I's threshold, since the
/// pose in map is known.
std::vector<Window> uncertainty_spikes(const Run& run) {
  std::vector<Window> spikes;
  for (const GpsSigma& sigma : run.gps_sigmas) {
    const bool counts = !run.fused.empty() && sigma.stamp_ns >= run.fused.front().stamp_ns;
    if (!counts || !(sigma.horizontal_m > kSpike_m)) {
      continue;
    }
    if (spikes.empty() || sigma.stamp_ns - spikes.back().end_ns > kSettled_ns) {
      spikes.push_back({sigma.stamp_ns, sigma.stamp_ns});
    }
    spikes.back().end_ns = sigma.stamp_ns;
  }
  return spikes;
}

/// As in the paper's Fig. 11: one spike an outage, and none elsewhere.
Figure spikes(const Drive& drive, const Run& run) {
  const auto found = uncertainty_spikes(run);
  const auto windows = outages(drive);
  const auto begins_in = [&](const Window& outage) {
    return std::count_if(found.begin(), found.end(), [&](const Window& spike) {
      return spike.begin_ns >= outage.begin_ns && spike.begin_ns < outage.end_ns;
    });
  };
  Figure figure_of = figure("spikes of the GPS filter's sigma above 0.5 m (outages: " +
                                std::to_string(windows.size()) + ")",
                            static_cast<double>(found.size()));
  figure_of.met = found.size() == windows.size() &&
                  std::all_of(windows.begin(), windows.end(), [&](const Window& outage) {
                    return begins_in(outage) == 1;
                  });
  return figure_of;
}

Figures long_drive(const Drive& drive, const std::string& mode) {
  Figures figures = whole_drive(drive, drive.runs.at(mode), 0.15);
  figures.push_back(spikes(drive, drive.runs.at(mode)));
  const Figures of_outages = outage(drive, mode);
  figures.insert(figures.end(), of_outages.begin(), of_outages.end());
  return figures;
}

bool is_wrong(const simulator::FixTruth& fix) {
  return fix.fault_error_enu_m.norm() > kWandered_m;
}

/// Whether a row of this fix went to the mapper along an axis on which it is wrong.
bool fooled(const Run& run, const simulator::FixTruth& fix) {
  const auto judged = run.judgements.find(fix.stamp_ns);
  if (judged == run.judgements.end()) {
    return false;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double error_m = fix.fault_error_enu_m[static_cast<Eigen::Index>(axis)];
    if (judged->second.moves[axis] && std::abs(error_m) > kWrong_m) {
      return true;
    }
  }
  return false;
}

/// What a fix that the GPS filter refused is told under has the filter's stamp, not the fix's.
std::string first_refusal(const Run& run, const Window& window) {
  for (auto judged = run.judgements.lower_bound(window.begin_ns);
       judged != run.judgements.end() && judged->first < window.end_ns;
       ++judged) {
    if (!judged->second.used && !judged->second.reason.empty()) {
      return judged->second.reason;
    }
  }
  return {};
}

Figure worst_in(const Run& run, const std::vector<Window>& windows, Bound bound) {
  return figure("worst error in the faults, m",
                evaluation::worst_error_m(run.pairs, windows).value_or(kNaN),
                bound);
}

evaluation::GateClosing closing_of(const Drive& drive, const Run& run, const Window& window) {
  std::vector<evaluation::WrongFix> stretch;
  for (const simulator::FixTruth& fix : drive.fixes) {
    if (!fix.lost && fix.stamp_ns >= window.begin_ns && fix.stamp_ns < window.end_ns) {
      stretch.emplace_back(fix.stamp_ns, fooled(run, fix));
    }
  }
  return evaluation::gate_closing(stretch);
}

/// Of the worst stretch: how many wrong fixes went through until the gate was closed for good, and
/// how long that took. The verdict must say why.
Figures closing(const Drive& drive, const Run& run, const std::vector<Window>& windows) {
  Figure fixes = figure("wrong fixes used until the gate is closed (at most 2, or 1 s)", kNaN);
  Figure time = figure("from the first wrong fix to the last one used, s", kNaN);
  bool in_time = true;
  for (const Window& window : windows) {
    const auto closed = closing_of(drive, run, window);
    fixes.words = fixes.words.empty() ? first_refusal(run, window) : fixes.words;
    fixes.value = std::fmax(fixes.value, static_cast<double>(closed.used));
    time.value = std::fmax(time.value, closed.last_used_s);
    in_time =
        in_time && (closed.used <= kFixesUntilClosed || closed.last_used_s <= kTimeUntilClosed_s);
  }
  fixes.met = in_time && !fixes.words.empty();
  return {fixes, time};
}

Figures wrong_fix(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  const auto windows = stretches(drive, is_wrong);
  Figures figures = closing(drive, run, windows);
  figures.insert(figures.begin(), worst_in(run, windows, at_most(kWrongFixError_m)));
  figures.push_back(largest_step(drive, run));
  return figures;
}

Figures frozen_covariance(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  return {worst_in(run, stretches(drive, is_wrong), at_most(kFaultError_m)),
          largest_step(drive, run)};
}

/// Ours over the lesser of what the modes hard and fusion reach on the same drive.
Figure against_plain_modes(const Drive& drive,
                           const std::string& mode,
                           const std::vector<Window>& windows) {
  double best_m = kNaN;
  for (const char* plain : {"hard", "fusion"}) {
    if (const Run* run = drive.run_of(plain)) {
      best_m = std::fmin(best_m, evaluation::worst_error_m(run->pairs, windows).value_or(kNaN));
    }
  }
  const double ours_m =
      evaluation::worst_error_m(drive.runs.at(mode).pairs, windows).value_or(kNaN);
  Figure ratio = figure("over that of the better of hard and fusion", ours_m / best_m);
  if (mode != "hard" && mode != "fusion" && std::isfinite(best_m)) {
    ratio.bound = at_most(1.0);
  }
  return ratio;
}

Figures urban(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  const auto windows = stretches(drive, is_wrong);
  return {worst_in(run, windows, at_most(kFaultError_m)),
          against_plain_modes(drive, mode, windows),
          largest_step(drive, run)};
}

/// Errors of the fixes themselves inside the windows.
evaluation::Statistics gps_errors_in(const Drive& drive, const std::vector<Window>& windows) {
  std::vector<double> errors_m;
  for (const ReceivedFix& fix : drive.received) {
    if (evaluation::is_inside(windows, fix.stamp_ns)) {
      errors_m.push_back(fix.error_map_m.norm());
    }
  }
  return evaluation::statistics_of(std::move(errors_m));
}

Figures degenerate(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  const auto windows =
      stretches(drive, [](const simulator::FixTruth& fix) { return fix.gnss_class == "float"; });
  const auto gps = gps_errors_in(drive, windows);
  return {figure("RMSE in it, m",
                 evaluation::rms_error_m(run.pairs, windows).value_or(kNaN),
                 at_most(gps.rmse + kOverGps_m)),
          figure("RMSE of the fixes in it, m", gps.rmse),
          figure("worst error in it, m",
                 evaluation::worst_error_m(run.pairs, windows).value_or(kNaN),
                 at_most(gps.max + kOverGps_m)),
          figure("worst error of the fixes in it, m", gps.max),
          largest_step(drive, run)};
}

Figures height(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  const auto windows = stretches(drive, is_wrong);
  if (windows.empty()) {
    return {};
  }
  constexpr Eigen::Index kUp = 2;
  const Nanoseconds from_ns = windows.front().begin_ns;
  const auto all = evaluation::absolute_error(run.pairs);
  return {
      figure("xy RMSE, m", all.horizontal_m.rmse, at_most(kHeightFaultRms_m)),
      figure(
          "z error less 0.3 % of the distance since the fault began, m",
          evaluation::excess_over_distance_m(run.pairs, from_ns, kUp, kHeightShare).value_or(kNaN),
          at_most(kHeightError_m)),
      figure("worst z error, m", all.axes_m[2].max),
      largest_step(drive, run)};
}

/// Moments at which a run whose fixes come late cannot yet know what the sorted one knows: until 2
/// s after the later of both speaks, and after the fixes come back.
std::vector<Window> unsettled(const Drive& drive, const Run& run, const Run& sorted) {
  std::vector<Window> windows;
  if (!run.fused.empty() && !sorted.fused.empty()) {
    const Nanoseconds both_ns = std::max(run.fused.front().stamp_ns, sorted.fused.front().stamp_ns);
    windows.push_back({0, both_ns + kSettled_ns});
  }
  for (const Window& outage : outages(drive)) {
    windows.push_back({outage.end_ns, outage.end_ns + kSettled_ns});
  }
  return windows;
}

std::string text_of(const std::vector<NamedCount>& counts) {
  std::string text;
  for (const NamedCount& count : counts) {
    text += (text.empty() ? "" : ", ") + count.name + " " + std::to_string(count.count);
  }
  return text;
}

Figures against_sorted(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  const Run& sorted = drive.sorted_runs.at(mode);
  std::size_t differing = 0;
  std::string words;
  for (const ReceivedFix& fix : drive.received) {
    const auto of = [&](const Run& one) {
      const auto found = one.judgements.find(fix.stamp_ns);
      return found == one.judgements.end() ? Judgement{} : found->second;
    };
    const Judgement ours = of(run);
    const Judgement theirs = of(sorted);
    if (ours.is_used() != theirs.is_used() || ours.moves != theirs.moves) {
      ++differing;
      words =
          words.empty()
              ? "'" + ours.reason + "' where sorted says '" + theirs.reason + "', of the fix at " +
                    std::to_string(to_seconds(fix.stamp_ns - drive.truth->first_ns())) + " s of " +
                    std::to_string(to_seconds(drive.truth->last_ns() - drive.truth->first_ns()))
              : words;
    }
  }
  Figure verdicts = figure("fixes judged otherwise than in the sorted run",
                           static_cast<double>(differing),
                           at_most(0.0));
  verdicts.words = words;
  if (differing > 0) {
    verdicts.words += "; all: " + text_of(run.verdicts) + "; sorted: " + text_of(sorted.verdicts);
  }
  return {verdicts,
          figure("largest distance from the sorted run after 2 s, m",
                 evaluation::largest_difference_m(
                     run.fused, sorted.fused, unsettled(drive, run, sorted))
                     .value_or(kNaN),
                 at_most(kSortedDifference_m)),
          figure("RMSE without alignment, m", rmse_m(run.pairs, AlignmentKind::kNone)),
          largest_step(drive, run)};
}

/// Driven from a moment on until the estimate is right for good.
double way_until_right_m(const Drive& drive,
                         const std::vector<evaluation::PosePair>& pairs,
                         Nanoseconds from_ns) {
  const auto right_s = evaluation::time_to_return_s(pairs, from_ns, kStartError_m);
  if (!right_s) {
    return kNaN;
  }
  const auto at_m = [&](Nanoseconds ns) { return drive.truth->at(ns).T_map_base.p; };
  const Nanoseconds end_ns = from_ns + from_seconds(*right_s);
  double way_m = 0.0;
  for (Nanoseconds ns = from_ns; ns + kStepInterval_ns < end_ns; ns += kStepInterval_ns) {
    way_m += (at_m(ns + kStepInterval_ns) - at_m(ns)).norm();
  }
  return way_m;
}

/// How a start with something wrong ends: aligned, and right from then on. The alignment is in
/// fusion/odometry_raw; fusion/odometry follows at the rate of the hand-over, which is told only.
Figures start(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  if (run.pairs.empty()) {
    return {figure("error at the end, m", kNaN, at_most(kStartError_m))};
  }
  const auto wrong = stretches(drive, is_wrong);
  const Nanoseconds begin_ns = drive.truth->first_ns();
  const bool wrong_first =
      !wrong.empty() && to_seconds(wrong.front().begin_ns - begin_ns) < kAtStart_s;
  const Nanoseconds right_ns = wrong_first ? wrong.front().end_ns : begin_ns;
  const std::string since =
      wrong_first ? "m driven after the wrong fix's end until " : "m driven until ";
  return {first_pose(drive, run),
          figure(since + "aligned within 0.3 m",
                 way_until_right_m(drive, run.raw_pairs, right_ns),
                 wrong_first ? at_most(kRealigned_m) : Bound{}),
          figure(since + "fusion/odometry is within 0.3 m",
                 way_until_right_m(drive, run.pairs, right_ns)),
          figure("error at the end, m",
                 (run.pairs.back().estimate.p - run.pairs.back().reference.p).norm(),
                 at_most(kStartError_m)),
          largest_step(drive, run)};
}

Figures consistency(const Drive& drive, const std::string& mode) {
  const Run& run = drive.runs.at(mode);
  Figures figures{figure("ANEES of the pose (1 = honest)", run.nees_pose, {0.3, 2.0}),
                  figure("ANEES of the position", run.nees_position, {0.3, 2.0})};
  for (Figure& each : figures) {
    each.judged_by_mean = true;
  }
  // Which part of the covariance is not honest.
  const char* const parts[]{"x", "y", "z", "roll", "pitch", "yaw"};
  for (Eigen::Index i = 0; i < 6; ++i) {
    const double scale = i < 3 ? 1.0 : 180.0 / std::numbers::pi;
    const std::string name = std::string(parts[i]) + (i < 3 ? ", m" : ", degrees");
    figures.push_back(figure("rms error of " + name, scale * run.rms_error[i]));
    figures.push_back(figure("rms sigma of " + name, scale * run.rms_sigma[i]));
  }
  return figures;
}

using MapScore = std::function<Figures(const MapTask&)>;

MapScore across(const std::string& scenario) {
  return [scenario](const MapTask& task) { return map_across_outages(task, scenario); };
}

/// A row that makes its own drives.
Row map_row(const std::string& name, const std::string& what, MapScore score) {
  Row row;
  row.scenario = name;
  row.what = what;
  row.score_map = std::move(score);
  return row;
}

}  // namespace

bool Bound::holds(double value) const {
  return !std::isnan(value) && (!lowest || value >= *lowest) && (!highest || value <= *highest);
}

const std::vector<Row>& rows() {
  static const std::vector<Row> all{
      {"campus_twice", "campus loop 650 m twice, RTK", campus_twice},
      {"indoor_60", "indoor outage 60 s, return of GPS", outage},
      {"indoor_120", "indoor outage 120 s, return of GPS", outage},
      {"campus+wrong_fix", "wrong fix 2-8 m at sigma 1 cm, 10-40 s", wrong_fix},
      {"campus+frozen_covariance", "wanders 5 m in 20-60 s at sigma 1 cm", frozen_covariance},
      {"campus+urban_multipath", "urban multipath, partly inflated covariance", urban},
      {"tunnel_gps", "cutting 380 m, GPS fair", degenerate},
      {"corridor_gps", "corridor 380 m, GPS fair", degenerate},
      {"campus+height_step", "GPS height steps by 30 m after 60 s", height},
      {"campus+height_drift", "GPS height wanders at 10 cm/s after 60 s", height},
      {"long_drive", "2.5 km with three outages", long_drive},
      {"campus+late_fixes", "fixes 500 ms late", against_sorted, true},
      {"campus+shuffled_fixes", "late, shuffled and duplicated", against_sorted, true},
      {"campus+duplicated_fixes", "duplicated", against_sorted, true},
      {"campus_late_gps", "start: GPS first after 300 m", start},
      {"indoor_start", "start inside a building", start},
      {"campus+wrong_start", "start: a wrong fix", start},
      {"short", "consistency over short runs", consistency, false, true},
      map_row("map indoor_60", "the same street before and after an outage", across("indoor_60")),
      map_row("map campus_twice", "streets driven twice", across("campus_twice")),
      map_row("map long_drive", "three outages, streets driven twice", across("long_drive")),
      map_row("map second_run", "second run from a stored session", map_of_second_run),
      map_row("map merged", "two sessions merged", map_of_merged_sessions),
      map_row("map street_traffic", "walkers and cars", map_without_traffic),
  };
  return all;
}

}  // namespace trigpoint::fusion_table
