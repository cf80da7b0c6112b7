// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "checks/gps_sources.hpp"

#include <algorithm>

namespace trigpoint::fusion_gate {

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
  }
  entry->second.last_heard_ns = std::max(entry->second.last_heard_ns, stamp_ns);
  return entry->second;
}

bool GpsSources::select(Nanoseconds now_ns) {
  const std::string before = followed_;
  const std::string best = best_alive(now_ns);
  const GpsSource* current = followed_source();
  if (best.empty()) {
    followed_.clear();
  } else if (current == nullptr || is_stale(*current, now_ns)) {
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

bool GpsSources::is_better(const GpsSource& candidate, const GpsSource& current) const {
  if (rank_of(candidate) != rank_of(current)) {
    return rank_of(candidate) < rank_of(current);
  }
  if (!candidate.status || !current.status) {
    return false;
  }
  return to_seconds(candidate.status->last_accepted_fix_ns - current.status->last_accepted_fix_ns) >
         config_.source_timeout_s;
}

std::string GpsSources::best_alive(Nanoseconds now_ns) const {
  std::string best;
  for (const auto& [writer, source] : sources_) {
    if (is_stale(source, now_ns)) {
      continue;
    }
    const GpsSource* leader = find(best);
    const auto newest = [](const GpsSource& s) {
      return s.status ? s.status->last_accepted_fix_ns : 0;
    };
    if (leader == nullptr || rank_of(source) < rank_of(*leader) ||
        (rank_of(source) == rank_of(*leader) && newest(source) > newest(*leader))) {
      best = writer;
    }
  }
  return best;
}

}  // namespace trigpoint::fusion_gate
