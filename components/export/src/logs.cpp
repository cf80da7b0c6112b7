// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The tables of a session. The order of the columns stands once in each header, and the writer and
// the reader below it follow it.
#include "csv.hpp"
#include "line_file.hpp"

#include <cmath>

namespace trigpoint::exporter {

namespace {

const std::string kFixHeader =
    "stamp_ns,receive_ns,latitude_deg,longitude_deg,altitude_m,sigma_e_m,sigma_n_m,sigma_u_m,"
    "status,withheld";
const std::string kSweepHeader = "stamp_ns,receive_ns,arrival_ns";
const std::string kGateHeader =
    "stamp_ns,mode,verdict_fix_stamp_ns,verdict_used,verdict_reason,"
    "e_source,e_sigma_m,e_threshold_m,e_reason,"
    "n_source,n_sigma_m,n_threshold_m,n_reason,"
    "u_source,u_sigma_m,u_threshold_m,u_reason,"
    "aligned,yaw_rad,x_m,y_m,z_m,tilt_x_rad,tilt_y_rad,yaw_sigma_rad,x_sigma_m,y_sigma_m,z_sigma_m,"
    "fixes_seen,fixes_used,verdicts,gps_source";
const std::string kGpsHeader =
    "stamp_ns,source,health,datum_id,gnss_class,last_accepted_fix_ns,accepted_x_m,accepted_y_m,"
    "accepted_z_m,accepted_sigma_x_m,accepted_sigma_y_m,accepted_sigma_z_m,test_ratio_x,"
    "test_ratio_y,test_ratio_z,fixes_received,fixes_accepted,rejections,imu_received,resets";
const std::string kScanHeader =
    "stamp_ns,odom_epoch,scan_ms,points,health,observability_x,observability_y,observability_z,"
    "observability_roll,observability_pitch,observability_yaw,sigma_x_m,sigma_y_m,sigma_z_m,"
    "sigma_roll_rad,sigma_pitch_rad,sigma_yaw_rad,rows_applied,rows_refused,last_refusal,aligned,"
    "scans_received,scans_used,imu_received,distance_m";

const std::vector<std::string> kFixStatusNames{"unknown", "no_fix", "fix", "sbas", "gbas"};
const std::vector<std::string> kAxisSourceNames{"none", "lio", "fused", "gps"};
const std::vector<std::string> kGpsHealthNames{"init",
                                               "ok",
                                               "degraded",
                                               "dead_reckoning",
                                               "stale",
                                               "fault"};
const std::vector<std::string> kGnssClassNames{"none", "unknown", "code", "sbas", "float", "fixed"};
const std::vector<std::string> kLioHealthNames{"init", "ok", "degraded", "lost", "stale"};

template <typename Enum>
std::string name_of(Enum value, const std::vector<std::string>& names) {
  const auto index = static_cast<std::size_t>(value);
  return index < names.size() ? names[index] : "unknown";
}

double variance_of(double sigma) {
  return sigma * sigma;
}

/// The placeholder of what nobody knows is no figure.
double known_or_nan(double sigma) {
  return variance_of(sigma) < kUnknownVariance ? sigma : kNaN;
}

std::string gate_line(const FusionStatus& status, const FixVerdict& verdict) {
  CsvLine line;
  line.add(status.stamp_ns).add(status.mode);
  line.add(verdict.fix_stamp_ns).add(verdict.used).add(verdict.reason);
  for (const auto& axis : status.axes) {
    line.add(name_of(axis.source, kAxisSourceNames)).add(axis.sigma_m);
    line.add(axis.threshold_m).add(axis.reason);
  }
  line.add(status.aligned).add(status.T_map_odom.yaw_rad);
  line.add(status.T_map_odom.p.x()).add(status.T_map_odom.p.y()).add(status.T_map_odom.p.z());
  line.add(status.T_map_odom.tilt_rad.x()).add(status.T_map_odom.tilt_rad.y());
  line.add(known_or_nan(status.yaw_sigma_rad));
  for (const double sigma_m : status.position_sigma_m) {
    line.add(known_or_nan(sigma_m));
  }
  line.add(status.fixes_seen).add(status.fixes_used);
  line.add(join_counts(status.verdicts)).add(status.gps_source);
  return line.str();
}

}  // namespace

FixLog::FixLog(const std::string& file, Opening opening)
    : lines_(std::make_unique<LineFile>(file, kFixHeader + "\n", opening)) {}

FixLog::~FixLog() = default;

void FixLog::append(const GnssFix& fix, Nanoseconds receive_ns, bool withheld) {
  const auto status = static_cast<std::size_t>(static_cast<int>(fix.status) + 2);
  CsvLine line;
  line.add(fix.stamp_ns).add(receive_ns);
  line.add(fix.latitude_deg).add(fix.longitude_deg).add(fix.altitude_m);
  for (int axis = 0; axis < 3; ++axis) {
    const bool known = fix.covariance_type != CovarianceType::kUnknown;
    line.add(known ? std::sqrt(fix.covariance_enu_m2(axis, axis)) : kNaN);
  }
  line.add(status < kFixStatusNames.size() ? kFixStatusNames[status] : "unknown").add(withheld);
  lines_->append(line.str());
}

std::vector<LoggedFix> read_fixes(const std::string& file) {
  std::vector<LoggedFix> fixes;
  read_csv(file, kFixHeader, [&](CsvCells& cells) {
    auto& [fix, receive_ns, withheld] = fixes.emplace_back();
    fix.stamp_ns = cells.integer();
    receive_ns = cells.integer();
    fix.latitude_deg = cells.number();
    fix.longitude_deg = cells.number();
    fix.altitude_m = cells.number();
    for (int axis = 0; axis < 3; ++axis) {
      fix.covariance_enu_m2(axis, axis) = variance_of(cells.number());
    }
    fix.covariance_type = std::isnan(fix.covariance_enu_m2.trace())
                              ? CovarianceType::kUnknown
                              : CovarianceType::kDiagonalKnown;
    fix.status = static_cast<FixStatus>(static_cast<int>(cells.one_of(kFixStatusNames)) - 2);
    withheld = cells.flag();
  });
  return fixes;
}

SweepLog::SweepLog(const std::string& file, Opening opening)
    : lines_(std::make_unique<LineFile>(file, kSweepHeader + "\n", opening)) {}

SweepLog::~SweepLog() = default;

void SweepLog::append(const LoggedSweep& sweep) {
  CsvLine line;
  line.add(sweep.stamp_ns).add(sweep.receive_ns).add(sweep.arrival_ns);
  lines_->append(line.str());
}

std::vector<LoggedSweep> read_sweeps(const std::string& file) {
  std::vector<LoggedSweep> sweeps;
  read_csv(file, kSweepHeader, [&](CsvCells& cells) {
    auto& sweep = sweeps.emplace_back();
    sweep.stamp_ns = cells.integer();
    sweep.receive_ns = cells.integer();
    sweep.arrival_ns = cells.integer();
  });
  return sweeps;
}

GateLog::GateLog(const std::string& file, Opening opening)
    : lines_(std::make_unique<LineFile>(file, kGateHeader + "\n", opening)) {}

GateLog::~GateLog() = default;

void GateLog::append(const FusionStatus& status) {
  // The last one judged is the newest one, whose row comes last.
  for (std::size_t i = 0; i + 1 < status.judged.size(); ++i) {
    lines_->append(gate_line(status, status.judged[i]));
  }
  lines_->append(gate_line(status, status.verdict));
}

std::vector<FusionStatus> read_gate_log(const std::string& file) {
  std::vector<FusionStatus> rows;
  read_csv(file, kGateHeader, [&](CsvCells& cells) {
    auto& row = rows.emplace_back();
    row.stamp_ns = cells.integer();
    row.mode = cells.text();
    row.verdict.fix_stamp_ns = cells.integer();
    row.verdict.used = cells.flag();
    row.verdict.reason = cells.text();
    for (auto& axis : row.axes) {
      axis.source = static_cast<AxisSource>(cells.one_of(kAxisSourceNames));
      axis.sigma_m = cells.number();
      axis.threshold_m = cells.number();
      axis.reason = cells.text();
    }
    row.aligned = cells.flag();
    row.T_map_odom.yaw_rad = cells.number();
    for (int axis = 0; axis < 3; ++axis) {
      row.T_map_odom.p[axis] = cells.number();
    }
    row.T_map_odom.tilt_rad.x() = cells.number();
    row.T_map_odom.tilt_rad.y() = cells.number();
    row.yaw_sigma_rad = cells.number();
    for (double& sigma_m : row.position_sigma_m) {
      sigma_m = cells.number();
    }
    row.fixes_seen = cells.count();
    row.fixes_used = cells.count();
    row.verdicts = cells.counts();
    row.gps_source = cells.text();
  });
  return rows;
}

GpsStatusLog::GpsStatusLog(const std::string& file, Opening opening)
    : lines_(std::make_unique<LineFile>(file, kGpsHeader + "\n", opening)) {}

GpsStatusLog::~GpsStatusLog() = default;

void GpsStatusLog::append(const GpsStatus& status) {
  CsvLine line;
  line.add(status.stamp_ns).add(status.source).add(name_of(status.health, kGpsHealthNames));
  line.add(status.datum_id).add(name_of(status.gnss_class, kGnssClassNames));
  line.add(status.last_accepted_fix_ns);
  for (int axis = 0; axis < 3; ++axis) {
    line.add(status.accepted_antenna_map_m[axis]);
  }
  for (int axis = 0; axis < 3; ++axis) {
    line.add(std::sqrt(status.accepted_covariance_map_m2(axis, axis)));
  }
  for (const double ratio : status.test_ratio) {
    line.add(ratio);
  }
  line.add(status.fixes_received).add(status.fixes_accepted);
  line.add(join_counts(status.rejections)).add(status.imu_received);
  line.add(std::uint64_t{status.reset.counter});
  lines_->append(line.str());
}

std::vector<GpsStatus> read_gps_status(const std::string& file) {
  std::vector<GpsStatus> rows;
  read_csv(file, kGpsHeader, [&](CsvCells& cells) {
    auto& row = rows.emplace_back();
    row.stamp_ns = cells.integer();
    row.source = cells.text();
    row.health = static_cast<GpsHealth>(cells.one_of(kGpsHealthNames));
    row.datum_id = cells.text();
    row.gnss_class = static_cast<GnssClass>(cells.one_of(kGnssClassNames));
    row.last_accepted_fix_ns = cells.integer();
    for (int axis = 0; axis < 3; ++axis) {
      row.accepted_antenna_map_m[axis] = cells.number();
    }
    for (int axis = 0; axis < 3; ++axis) {
      row.accepted_covariance_map_m2(axis, axis) = variance_of(cells.number());
    }
    for (double& ratio : row.test_ratio) {
      ratio = cells.number();
    }
    row.fixes_received = cells.count();
    row.fixes_accepted = cells.count();
    row.rejections = cells.counts();
    row.imu_received = cells.count();
    row.reset.counter = static_cast<std::uint32_t>(cells.count());
  });
  return rows;
}

ScanLog::ScanLog(const std::string& file, Opening opening)
    : lines_(std::make_unique<LineFile>(file, kScanHeader + "\n", opening)) {}

ScanLog::~ScanLog() = default;

void ScanLog::append(const LioStatus& status, std::uint64_t points) {
  CsvLine line;
  line.add(status.stamp_ns).add(std::uint64_t{status.odom_epoch}).add(status.scan_ms).add(points);
  line.add(name_of(status.health, kLioHealthNames));
  for (const double share : status.observability) {
    line.add(share);
  }
  for (const double sigma : status.sigma) {
    line.add(sigma);
  }
  line.add(status.rows_applied).add(status.rows_refused).add(status.last_refusal);
  line.add(status.aligned).add(status.scans_received).add(status.scans_used);
  line.add(status.imu_received).add(status.distance_m);
  lines_->append(line.str());
}

std::vector<LoggedScan> read_scans(const std::string& file) {
  std::vector<LoggedScan> rows;
  read_csv(file, kScanHeader, [&](CsvCells& cells) {
    auto& [status, points] = rows.emplace_back();
    status.stamp_ns = cells.integer();
    status.odom_epoch = static_cast<std::uint32_t>(cells.count());
    status.scan_ms = cells.number();
    points = cells.count();
    status.health = static_cast<LioHealth>(cells.one_of(kLioHealthNames));
    for (double& share : status.observability) {
      share = cells.number();
    }
    for (double& sigma : status.sigma) {
      sigma = cells.number();
    }
    status.rows_applied = cells.count();
    status.rows_refused = cells.count();
    status.last_refusal = cells.text();
    status.aligned = cells.flag();
    status.scans_received = cells.count();
    status.scans_used = cells.count();
    status.imu_received = cells.count();
    status.distance_m = cells.number();
  });
  return rows;
}

}  // namespace trigpoint::exporter
