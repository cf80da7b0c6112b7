// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "process_note.hpp"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string_view>

namespace trigpoint::bus {
namespace {

std::optional<unsigned> noted(std::string_view text) {
  return noted_process({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

TEST(ProcessNote, says_our_own_number) {
  EXPECT_EQ(noted(process_note()), static_cast<unsigned>(getpid()));
}

TEST(ProcessNote, does_not_take_the_number_of_another_container_for_one_of_ours) {
  EXPECT_EQ(noted("enclave=/;process=12;in=1;"), kNumberedElsewhere);
  EXPECT_EQ(number_that_counts_here(kNumberedElsewhere), std::nullopt);
  EXPECT_EQ(number_that_counts_here(12), 12U);
}

TEST(ProcessNote, of_a_ros_2_node_says_nothing) {
  EXPECT_EQ(noted("enclave=/;"), std::nullopt);
  EXPECT_EQ(noted(""), std::nullopt);
  EXPECT_EQ(noted("process=x;"), std::nullopt);
}

TEST(ProcessInGuid, is_read_from_fast_dds_alone) {
  EXPECT_EQ(process_in_fastdds_guid("010f1234"
                                    "c60e"
                                    "0000000000000000000103"),
            0x0ec6U);
  EXPECT_EQ(process_in_fastdds_guid("01101234"
                                    "c60e"
                                    "0000000000000000000103"),
            std::nullopt);
  EXPECT_EQ(process_in_fastdds_guid("010f"), std::nullopt);
}

}  // namespace
}  // namespace trigpoint::bus
