// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/rejections.hpp"

#include <gtest/gtest.h>

namespace trigpoint {
namespace {

// The report holds refused fixes against received ones: nothing else may be counted among them.
TEST(Rejections, of_other_inputs_are_not_refused_fixes) {
  EXPECT_EQ(kind_of_rejection("far_from_datum"), RejectionKind::kFixRefused);
  EXPECT_EQ(kind_of_rejection("clock_jump"), RejectionKind::kFixRefused);
  EXPECT_EQ(kind_of_rejection("imu_unknown_frame"), RejectionKind::kImu);
  EXPECT_EQ(kind_of_rejection("twist_gate"), RejectionKind::kTwist);
  EXPECT_EQ(kind_of_rejection("yaw_not_unit"), RejectionKind::kYaw);
  EXPECT_EQ(kind_of_rejection("covariance_restored"), RejectionKind::kNote);
  EXPECT_EQ(kind_of_rejection("used_without_height"), RejectionKind::kNote);
}

}  // namespace
}  // namespace trigpoint
