// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fault.hpp"
#include "faults/gps_bias.hpp"
#include "faults/gps_class.hpp"
#include "faults/gps_clock.hpp"
#include "faults/gps_cluster.hpp"
#include "faults/gps_duplicate.hpp"
#include "faults/gps_frozen_covariance.hpp"
#include "faults/gps_frozen_fix.hpp"
#include "faults/gps_garbage.hpp"
#include "faults/gps_height.hpp"
#include "faults/gps_inflate.hpp"
#include "faults/gps_jitter.hpp"
#include "faults/gps_late.hpp"
#include "faults/gps_multipath.hpp"
#include "faults/gps_nlos.hpp"
#include "faults/gps_no_covariance.hpp"
#include "faults/gps_noise_scale.hpp"
#include "faults/gps_outage.hpp"
#include "faults/gps_reorder.hpp"
#include "faults/gps_spike.hpp"
#include "faults/gps_urban.hpp"
#include "faults/gps_wander.hpp"
#include "faults/gps_wrong_fix.hpp"
#include "faults/imu_bias_step.hpp"
#include "faults/imu_clock.hpp"
#include "faults/imu_gap.hpp"
#include "faults/imu_saturation.hpp"
#include "faults/imu_stuck.hpp"
#include "faults/lidar_block.hpp"
#include "faults/lidar_clock.hpp"
#include "faults/lidar_drop.hpp"
#include "faults/lidar_nan.hpp"

namespace trigpoint::simulator {

const Registry<Fault>& fault_registry() {
  static const Registry<Fault> registry{
      {"gps_bias", [] { return std::make_shared<GpsBias>(); }},
      {"gps_class", [] { return std::make_shared<GpsClass>(); }},
      {"gps_clock", [] { return std::make_shared<GpsClock>(); }},
      {"gps_cluster", [] { return std::make_shared<GpsCluster>(); }},
      {"gps_duplicate", [] { return std::make_shared<GpsDuplicate>(); }},
      {"gps_frozen_covariance", [] { return std::make_shared<GpsFrozenCovariance>(); }},
      {"gps_frozen_fix", [] { return std::make_shared<GpsFrozenFix>(); }},
      {"gps_garbage", [] { return std::make_shared<GpsGarbage>(); }},
      {"gps_height", [] { return std::make_shared<GpsHeight>(); }},
      {"gps_inflate", [] { return std::make_shared<GpsInflate>(); }},
      {"gps_jitter", [] { return std::make_shared<GpsJitter>(); }},
      {"gps_late", [] { return std::make_shared<GpsLate>(); }},
      {"gps_multipath", [] { return std::make_shared<GpsMultipath>(); }},
      {"gps_nlos", [] { return std::make_shared<GpsNlos>(); }},
      {"gps_no_covariance", [] { return std::make_shared<GpsNoCovariance>(); }},
      {"gps_noise_scale", [] { return std::make_shared<GpsNoiseScale>(); }},
      {"gps_outage", [] { return std::make_shared<GpsOutage>(); }},
      {"gps_reorder", [] { return std::make_shared<GpsReorder>(); }},
      {"gps_spike", [] { return std::make_shared<GpsSpike>(); }},
      {"gps_urban", [] { return std::make_shared<GpsUrban>(); }},
      {"gps_wander", [] { return std::make_shared<GpsWander>(); }},
      {"gps_wrong_fix", [] { return std::make_shared<GpsWrongFix>(); }},
      {"imu_bias_step", [] { return std::make_shared<ImuBiasStep>(); }},
      {"imu_clock", [] { return std::make_shared<ImuClock>(); }},
      {"imu_gap", [] { return std::make_shared<ImuGap>(); }},
      {"imu_saturation", [] { return std::make_shared<ImuSaturation>(); }},
      {"imu_stuck", [] { return std::make_shared<ImuStuck>(); }},
      {"lidar_block", [] { return std::make_shared<LidarBlock>(); }},
      {"lidar_clock", [] { return std::make_shared<LidarClock>(); }},
      {"lidar_drop", [] { return std::make_shared<LidarDrop>(); }},
      {"lidar_nan", [] { return std::make_shared<LidarNan>(); }},
  };
  return registry;
}

}  // namespace trigpoint::simulator
