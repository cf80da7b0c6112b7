// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/gps_sources.hpp"

#include "control/algorithm_one.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace trigpoint::fusion_gate {

namespace {

/// Two filters are not heard in step: the other one's stamp, or LIO's, may be ahead by so much.
constexpr double kLeastSilence_s = 0.25;
constexpr double kSilentGaps = 2.5;  ///< of the usual ones
constexpr double kGapMemory_s = 2.0;
constexpr double kForgotten_s = 60.0;
constexpr int kUsableRank = 2;

}  // namespace

GpsSources::GpsSources(const Config& config)
    : config_(config), threshold_m_(threshold_sigma_m(config)) {}

std::optional<std::string> GpsSources::on_odometry(const Odometry& odometry,
                                                   const std::string& writer) {
  if (!odometry.T_frame_child.is_finite()) {
    return "gps/odometry is not finite";
  }
  GpsSource& source = heard(writer, odometry.stamp_ns);
  if (source.odometry && odometry.stamp_ns < source.odometry->stamp_ns) {
    return "stamp of gps/odometry went back";
  }
  source.odometry = odometry;
  return std::nullopt;
}

void GpsSources::on_status(const GpsStatus& status, const std::string& writer) {
  heard(writer, status.stamp_ns).status = status;
}

GpsSource& GpsSources::heard(const std::string& writer, Nanoseconds stamp_ns) {
  const auto [entry, is_new] = sources_.try_emplace(writer);
  if (is_new) {
    entry->second.first_heard_ns = stamp_ns;
    entry->second.last_heard_ns = stamp_ns;
  }
  GpsSource& source = entry->second;
  const double gap_s = to_seconds(stamp_ns - source.last_heard_ns);
  if (gap_s > 0.0) {
    // The first stamp may be none (zero): a gap beyond the timeout says nothing of what is usual.
    source.usual_gap_s = std::max(std::min(gap_s, config_.source_timeout_s),
                                  source.usual_gap_s * std::exp(-gap_s / kGapMemory_s));
    source.last_heard_ns = stamp_ns;
  }
  return source;
}

bool GpsSources::select(Nanoseconds now_ns) {
  forget_dead(now_ns);
  const std::string before = followed_;
  const std::string best = best_alive(now_ns);
  const GpsSource* current = followed_source();
  if (best.empty()) {
    followed_.clear();
  } else if (current == nullptr || is_stale(*current, now_ns) ||
             (best != followed_ && may_stand_in(sources_.at(best), *current, now_ns))) {
    followed_ = best;
  } else if (best != followed_ && is_better(sources_.at(best), *current)) {
    if (challenger_ != best) {
      challenger_ = best;
      challenger_since_ns_ = now_ns;
    }
    if (to_seconds(now_ns - challenger_since_ns_) >= config_.source_hold_s) {
      followed_ = best;
    }
  } else {
    challenger_.clear();
  }
  if (followed_ != before) {
    challenger_.clear();
  }
  return followed_ != before;
}

const GpsSource* GpsSources::followed_source() const {
  return find(followed_);
}

const GpsSource* GpsSources::find(const std::string& writer) const {
  const auto entry = sources_.find(writer);
  return entry == sources_.end() ? nullptr : &entry->second;
}

bool GpsSources::is_foreign(const std::string& writer, Nanoseconds now_ns) const {
  const GpsSource* source = find(writer);
  return source != nullptr && !source->status &&
         to_seconds(now_ns - source->first_heard_ns) >= config_.foreign_after_s;
}

bool GpsSources::is_stale(const GpsSource& source, Nanoseconds now_ns) const {
  return to_seconds(now_ns - source.last_heard_ns) > config_.source_timeout_s;
}

/// Long before it counts as stale, which is for who has nobody to stand in for it.
bool GpsSources::is_silent(const GpsSource& source, Nanoseconds now_ns) const {
  const double limit_s = std::max(kLeastSilence_s, kSilentGaps * source.usual_gap_s);
  return to_seconds(now_ns - source.last_heard_ns) > std::min(limit_s, config_.source_timeout_s);
}

/// At once, without being healthier: the followed one says nothing any more.
bool GpsSources::may_stand_in(const GpsSource& candidate,
                              const GpsSource& current,
                              Nanoseconds now_ns) const {
  return is_silent(current, now_ns) && !is_silent(candidate, now_ns) &&
         rank_of(candidate) <= std::max(rank_of(current), kUsableRank);
}

/// Every restart of a filter is a new writer.
void GpsSources::forget_dead(Nanoseconds now_ns) {
  std::erase_if(sources_, [&](const auto& entry) {
    return entry.first != followed_ &&
           to_seconds(now_ns - entry.second.last_heard_ns) > kForgotten_s;
  });
}

int GpsSources::rank_of(const GpsSource& source) const {
  if (!source.status) {
    return 2;
  }
  switch (source.status->health) {
    case GpsHealth::kOk:
      return 0;
    case GpsHealth::kDegraded:
      return 1;
    case GpsHealth::kInit:
      return 3;
    case GpsHealth::kDeadReckoning:
      return 4;
    case GpsHealth::kStale:
      return 5;
    case GpsHealth::kFault:
      break;
  }
  return 6;
}

bool GpsSources::is_above_threshold(const GpsSource& source) const {
  return source.status && source.odometry &&
         !(source.odometry->pose_covariance.diagonal().head<3>().array() <=
           threshold_m_.array().square())
              .all();
}

bool GpsSources::is_better(const GpsSource& candidate, const GpsSource& current) const {
  if (rank_of(candidate) != rank_of(current)) {
    return rank_of(candidate) < rank_of(current);
  }
  if (is_above_threshold(candidate) != is_above_threshold(current)) {
    return is_above_threshold(current);
  }
  if (!candidate.status || !current.status) {
    return false;
  }
  return to_seconds(candidate.status->last_accepted_fix_ns - current.status->last_accepted_fix_ns) >
         config_.source_timeout_s;
}

std::string GpsSources::best_alive(Nanoseconds now_ns) const {
  const auto order = [&](const GpsSource& source) {
    const Nanoseconds newest_ns = source.status ? source.status->last_accepted_fix_ns : 0;
    return std::make_tuple(
        is_silent(source, now_ns), rank_of(source), is_above_threshold(source), -newest_ns);
  };
  std::string best;
  for (const auto& [writer, source] : sources_) {
    const GpsSource* leader = find(best);
    if (!is_stale(source, now_ns) && (leader == nullptr || order(source) < order(*leader))) {
      best = writer;
    }
  }
  return best;
}

}  // namespace trigpoint::fusion_gate
