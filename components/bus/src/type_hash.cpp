// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "type_hash.hpp"

#include <map>

namespace trigpoint::bus {

std::string type_hash_note(const std::string& dds_type) {
  // tests/bus/type_hash_test.py computes them from the IDL and says what is to stand here.
  static const std::map<std::string, std::string> kHashes{
      {"diagnostic_msgs::msg::dds_::DiagnosticArray_",
       "RIHS01_5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e"},
      {"geometry_msgs::msg::dds_::TwistWithCovarianceStamped_",
       "RIHS01_77b67434531e6529b7a0091357b186b6ebdb17fd9ffd3e0c7ce9d3fb11a44563"},
      {"nav_msgs::msg::dds_::Odometry_",
       "RIHS01_3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0"},
      {"rosgraph_msgs::msg::dds_::Clock_",
       "RIHS01_692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564"},
      {"sensor_msgs::msg::dds_::Imu_",
       "RIHS01_7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b"},
      {"sensor_msgs::msg::dds_::NavSatFix_",
       "RIHS01_62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404"},
      {"sensor_msgs::msg::dds_::PointCloud2_",
       "RIHS01_9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5"},
      {"tf2_msgs::msg::dds_::TFMessage_",
       "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"},
      {"trigpoint_msgs::msg::dds_::FusionStatus_",
       "RIHS01_a6d0ff67446b2e78f67fb06185ac71cf6ecfd60f2f8d57381bb975c8478eca93"},
      {"trigpoint_msgs::msg::dds_::GpsStatus_",
       "RIHS01_132e680bc0363a8a0b59ad4e22c329645b7e72bb0bb8c914f37b80238b253359"},
      {"trigpoint_msgs::msg::dds_::LioStatus_",
       "RIHS01_d3df2feb077a0259784d4d336a708bf58b3467b10cc977d4fa2ae0f37610b0a6"},
      {"trigpoint_msgs::msg::dds_::StateUpdate_",
       "RIHS01_2813146b1be2e4f43af955ee89ca1ac677cce60f893c22299291c3b36fc0f6eb"},
  };
  const auto known = kHashes.find(dds_type);
  return known == kHashes.end() ? "" : "typehash=" + known->second + ";";
}

}  // namespace trigpoint::bus
