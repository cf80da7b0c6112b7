// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/time.hpp"

#include "fault.hpp"

#include <cstdint>
#include <memory>
#include <vector>

namespace trigpoint::simulator {

/// Lets the faults that are active at a moment act on what the sensors made then, in their order in
/// the list. Depends on the seed and the stamp only, so that asking twice gives the same.
class FaultSchedule {
 public:
  FaultSchedule(std::vector<std::shared_ptr<Fault>> faults,
                Nanoseconds start_ns,
                std::uint64_t seed)
      : faults_(std::move(faults)), start_ns_(start_ns), seed_(derive_seed(seed, kFaultSeed)) {}

  void apply(GnssEpoch& epoch) const { run(epoch, epoch.stamp_ns, &Fault::on_gnss); }

  void apply(ImuEpoch& epoch) const { run(epoch, epoch.sample.stamp_ns, &Fault::on_imu); }

  void apply(SweepEpoch& epoch) const { run(epoch, epoch.stamp_ns, &Fault::on_sweep); }

  double brings_forward_s() const {
    double sum_s = 0.0;
    for (const std::shared_ptr<Fault>& fault : faults_) {
      sum_s += fault->brings_forward_s();
    }
    return sum_s;
  }

 private:
  template <typename Epoch>
  void run(Epoch& epoch,
           Nanoseconds stamp_ns,
           void (Fault::*hook)(Epoch&, const FaultMoment&) const) const {
    const double t_s = to_seconds(stamp_ns - start_ns_);
    for (std::size_t i = 0; i < faults_.size(); ++i) {
      const double since_s = t_s - faults_[i]->start_s;
      if (since_s < 0.0 || since_s >= faults_[i]->duration_s) {
        continue;
      }
      const std::uint64_t key = derive_seed(seed_, i);
      Random each(derive_seed(key, static_cast<std::uint64_t>(stamp_ns)));
      Random whole(key);
      (*faults_[i].*hook)(epoch, {since_s, each, whole, key});
    }
  }

  std::vector<std::shared_ptr<Fault>> faults_;
  Nanoseconds start_ns_;
  std::uint64_t seed_;
};

}  // namespace trigpoint::simulator
