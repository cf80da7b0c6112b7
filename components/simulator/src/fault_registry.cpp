// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fault.hpp"
#include "faults/gps_bias.hpp"
#include "faults/gps_class.hpp"
#include "faults/gps_noise_scale.hpp"
#include "faults/gps_outage.hpp"
#include "faults/imu_gap.hpp"
#include "faults/lidar_drop.hpp"

namespace trigpoint::simulator {

const Registry<Fault>& fault_registry() {
  static const Registry<Fault> registry{
      {"gps_bias", [] { return std::make_shared<GpsBias>(); }},
      {"gps_class", [] { return std::make_shared<GpsClass>(); }},
      {"gps_noise_scale", [] { return std::make_shared<GpsNoiseScale>(); }},
      {"gps_outage", [] { return std::make_shared<GpsOutage>(); }},
      {"imu_gap", [] { return std::make_shared<ImuGap>(); }},
      {"lidar_drop", [] { return std::make_shared<LidarDrop>(); }},
  };
  return registry;
}

}  // namespace trigpoint::simulator
