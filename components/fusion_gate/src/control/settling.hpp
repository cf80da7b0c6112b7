// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/fusion_gate/config.hpp"

#include "checks/accepted_fix.hpp"
#include "checks/displacement.hpp"
#include "checks/sighting.hpp"

#include <functional>
#include <optional>
#include <vector>

namespace trigpoint::fusion_gate {

/// After a silence of GPS: does T_map_odom's own covariance know how far LIO slid meanwhile? A
/// mapper that holds itself for certain gives rows no weight, however well the fixes agree.
class Settling {
 public:
  /// A fix against the T_map_odom that is in force now, with the covariance that the mapper admits.
  using OffsetNow = std::function<Difference(const AcceptedFix&, const Sighting&)>;

  explicit Settling(const Config& config) : config_(config) {}

  /// Fixes came back.
  void begin();

  void end() { is_open_ = false; }

  bool is_open() const { return is_open_; }

  /// What was gathered does not count: a fix was doubted, or LIO slides on.
  void interrupt();

  /// A trusted fix. Once there are enough the question is answered: their mean, if it and the
  /// newest fix contradict that covariance. All are held against the T_map_odom of that moment,
  /// because it may have followed the rows of the same fixes meanwhile.
  std::optional<Eigen::Vector3d> add(const AcceptedFix& fix,
                                     const Sighting& sighting,
                                     const OffsetNow& offset_now);

 private:
  struct Seen {
    AcceptedFix fix;
    Sighting sighting;
  };

  Config config_;
  bool is_open_{false};
  std::vector<Seen> seen_;
};

}  // namespace trigpoint::fusion_gate
