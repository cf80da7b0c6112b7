// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/lio_mapper/relative_covariance.hpp"

#include "trigpoint/base/so3.hpp"

namespace trigpoint::lio_mapper {

Matrix6d relative_pose_covariance(const StatedPose& from, const StatedPose& to) {
  Matrix6d transport = Matrix6d::Identity();
  transport.topRightCorner<3, 3>() = -hat(to.T_odom_base.p - from.T_odom_base.p);
  Matrix6d change = -from.covariance;
  for (int i = 0; i < 6; ++i) {
    const double sigma = from.sigma[static_cast<std::size_t>(i)];
    change(i, i) += 2.0 * sigma * sigma;
  }
  return to.covariance + transport * change * transport.transpose();
}

}  // namespace trigpoint::lio_mapper
