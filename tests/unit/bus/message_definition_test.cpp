// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/message_definition.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace trigpoint::bus {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const std::string kRule(80, '=');

TEST(MessageDefinition, names_fields_then_each_type_that_they_are_made_of_once) {
  EXPECT_EQ(message_definition("sensor_msgs/msg/NavSatFix"),
            "std_msgs/Header header\n"
            "sensor_msgs/NavSatStatus status\n"
            "float64 latitude\nfloat64 longitude\nfloat64 altitude\n"
            "float64[9] position_covariance\n"
            "uint8 position_covariance_type\n" +
                kRule +
                "\nMSG: std_msgs/Header\n"
                "builtin_interfaces/Time stamp\nstring frame_id\n" +
                kRule + "\nMSG: builtin_interfaces/Time\nint32 sec\nuint32 nanosec\n" + kRule +
                "\nMSG: sensor_msgs/NavSatStatus\nint8 status\nuint16 service\n");
}

TEST(MessageDefinition, writes_capitals_small_as_ros_2_demands) {
  EXPECT_THAT(message_definition("trigpoint_msgs/msg/FusionStatus"),
              HasSubstr("trigpoint_msgs/YawPose t_map_odom\n"));
}

TEST(MessageDefinition, reads_sequences_arrays_comments_and_annotations) {
  const Structs structs = parse_idl(
      "// a comment with struct { in it\n#include \"x.idl\"\n"
      "module p { module msg {\n"
      "  @final struct Inner { octet byte; };\n"
      "  @final struct Outer { sequence<p::msg::Inner> many; boolean yes[3]; };  // end\n"
      "}; };\n");
  EXPECT_THAT(message_definition(structs, "p/msg/Outer"),
              StartsWith("p/Inner[] many\nbool[3] yes\n" + kRule + "\nMSG: p/Inner\nuint8 byte\n"));
}

TEST(MessageDefinition, refuses_a_type_that_is_not_in_idl) {
  EXPECT_THROW(message_definition("sensor_msgs/msg/Image"), std::runtime_error);
  EXPECT_THROW(message_definition("sensor_msgs.Imu"), std::runtime_error);
}

TEST(MessageDefinition, refuses_idl_that_it_does_not_understand) {
  EXPECT_THROW(parse_idl("module p { module msg { union U { }; }; };"), std::runtime_error);
  EXPECT_THROW(parse_idl("module p { module msg { struct S { double x;"), std::runtime_error);
}

}  // namespace
}  // namespace trigpoint::bus
