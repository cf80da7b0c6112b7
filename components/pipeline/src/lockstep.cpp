// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/lockstep.hpp"

#include "trigpoint/fusion_gate/fusion_gate.hpp"
#include "trigpoint/gps_odometry/gps_odometry.hpp"

#include <utility>
#include <variant>

namespace trigpoint::pipeline {

namespace {

/// The name under which the gate hears our one GPS filter.
constexpr const char* kGpsWriter = "in-process";

template <typename T>
void append(std::vector<T>& all, std::vector<T>&& more) {
  all.insert(all.end(), std::make_move_iterator(more.begin()), std::make_move_iterator(more.end()));
}

template <typename T>
void append(std::vector<T>& all, std::optional<T>&& more) {
  if (more) {
    all.push_back(std::move(*more));
  }
}

}  // namespace

struct Lockstep::Impl {
  explicit Impl(const CoreConfigs& configs)
      : gps(configs.gps_odometry, configs.robot),
        mapper(configs.lio_mapper, configs.robot),
        gate(configs.fusion_gate, configs.robot) {}

  void feed(const ImuSample& sample, Step& step) {
    take(gps.on_imu(sample), step);
    take(mapper.on_imu(sample), step);
  }

  void feed(const GnssFix& fix, Step& step) {
    take(gate.on_fix(fix), step);
    take(gps.on_fix(fix), step);
  }

  void feed(const TwistMeasurement& twist, Step& step) { take(gps.on_twist(twist), step); }

  void feed(const YawMeasurement& yaw, Step& step) {
    take(gate.on_yaw(yaw), step);
    take(gps.on_yaw(yaw), step);
  }

  void feed(const PointCloudMessage& cloud, Step& step) { take(mapper.on_cloud(cloud), step); }

  void take(gps_odometry::Output&& output, Step& step) {
    append(step.events, std::move(output.events));
    if (output.elected) {
      step.datum = output.elected;
    }
    tell_datum(step);
    if (output.odometry) {
      take(gate.on_gps_odometry(*output.odometry, kGpsWriter), step);
      step.gps_odometry.push_back(std::move(*output.odometry));
    }
    if (output.status) {
      take(gate.on_gps_status(*output.status, kGpsWriter), step);
      step.gps_status.push_back(std::move(*output.status));
    }
  }

  /// The gate hears the datum as soon as the filter has one, however it came by it.
  void tell_datum(Step& step) {
    const std::optional<Datum> datum = gps.datum();
    if (datum && datum->id() != told_datum) {
      told_datum = datum->id();
      take(gate.on_datum(*datum), step);
    }
  }

  void take(lio_mapper::Output&& output, Step& step) {
    append(step.events, std::move(output.events));
    for (lio_mapper::ScanResult& scan : output.scans) {
      take(gate.on_lio_odometry(scan.odometry), step);
      take(gate.on_lio_status(scan.status), step);
      step.scans.push_back(std::move(scan));
    }
    if (output.odometry_imu_rate) {
      take(gate.on_lio_odometry_imu_rate(*output.odometry_imu_rate), step);
      step.lio_imu_rate.push_back(std::move(*output.odometry_imu_rate));
    }
  }

  void take(fusion_gate::Output&& output, Step& step) {
    append(step.events, std::move(output.events));
    append(step.fused, std::move(output.fused));
    append(step.fused_raw, std::move(output.fused_raw));
    append(step.fusion_status, std::move(output.status));
    for (const StateUpdate& update : output.state_updates) {
      take(mapper.on_state_update(update), step);
    }
    append(step.state_updates, std::move(output.state_updates));
  }

  gps_odometry::GpsOdometry gps;
  lio_mapper::LioMapper mapper;
  fusion_gate::FusionGate gate;
  std::string told_datum;
};

Lockstep::Lockstep(const CoreConfigs& configs) : impl_(std::make_unique<Impl>(configs)) {}

Lockstep::~Lockstep() = default;

void Lockstep::resume(const lio_mapper::Checkpoint& checkpoint,
                      lio_mapper::StoredPoints points,
                      const lio_mapper::ResumeOptions& options) {
  impl_->mapper.resume(checkpoint, std::move(points), options);
}

Step Lockstep::step(const recording::LogEntry& entry) {
  Step step;
  if (!entry.withheld) {
    std::visit([&](const auto& measurement) { impl_->feed(measurement, step); }, entry.measurement);
  }
  return step;
}

Step Lockstep::step(const recording::LogEntry& entry, lio_mapper::DecodedCloud cloud) {
  Step step;
  if (!entry.withheld) {
    impl_->take(impl_->mapper.on_decoded_cloud(std::move(cloud)), step);
  }
  return step;
}

Step Lockstep::finish() {
  Step step;
  impl_->take(impl_->mapper.finish(), step);
  return step;
}

lio_mapper::LioMapper& Lockstep::mapper() {
  return impl_->mapper;
}

std::optional<Datum> Lockstep::datum() const {
  return impl_->gps.datum();
}

std::optional<Alignment> Lockstep::best_alignment() const {
  return impl_->gate.best_alignment();
}

GpsStatus Lockstep::gps_status() const {
  return impl_->gps.status();
}

LioStatus Lockstep::lio_status() const {
  return impl_->mapper.status();
}

std::optional<lio_mapper::Checkpoint> Lockstep::checkpoint() const {
  return impl_->mapper.checkpoint();
}

std::vector<lio_mapper::StoredRow> Lockstep::take_rows() {
  return impl_->mapper.take_rows();
}

}  // namespace trigpoint::pipeline
