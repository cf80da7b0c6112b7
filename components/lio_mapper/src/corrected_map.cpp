// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/past.hpp"

#include "local_map.hpp"

#include <utility>

namespace trigpoint::lio_mapper {

CorrectedMap::CorrectedMap(std::unique_ptr<LocalMap> map,
                           PastSnapshot snapshot,
                           CorrectedPast past,
                           const Pose& T_odom_frame)
    : map_(std::move(map)),
      snapshot_(std::move(snapshot)),
      past_(std::move(past)),
      T_odom_frame_(T_odom_frame) {}

CorrectedMap::~CorrectedMap() = default;
CorrectedMap::CorrectedMap(CorrectedMap&&) noexcept = default;
CorrectedMap& CorrectedMap::operator=(CorrectedMap&&) noexcept = default;

void CorrectedMap::insert(const std::vector<PointCloud>& clouds_odom) {
  for (const PointCloud& cloud : clouds_odom) {
    map_->insert(cloud);
  }
  if (!clouds_odom.empty()) {
    PlaneMatch plane;
    for (const PointXyzi& point : clouds_odom.back()) {
      map_->match_surface(point.position().cast<double>(), plane);
    }
  }
}

}  // namespace trigpoint::lio_mapper
