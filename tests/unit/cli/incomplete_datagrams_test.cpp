// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "incomplete_datagrams.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <sstream>

namespace trigpoint::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

std::optional<std::int64_t> failed_in(const std::string& text) {
  std::istringstream snmp(text);
  return failed_reassemblies(snmp);
}

TEST(IncompleteDatagrams, are_read_below_their_name_whatever_else_the_kernel_counts) {
  EXPECT_EQ(failed_in("Icmp: ReasmFails\nIcmp: 9\nIp: Forwarding ReasmReqds ReasmFails FragOKs\n"
                      "Ip: 2 70 17 3\nUdp: InDatagrams\nUdp: 5\n"),
            17);
}

TEST(IncompleteDatagrams, are_unknown_where_the_kernel_does_not_tell) {
  EXPECT_EQ(failed_in(""), std::nullopt);
  EXPECT_EQ(failed_in("Ip: Forwarding ReasmFails\nIp: 2\n"), std::nullopt);
  EXPECT_EQ(failed_in("Ip: Forwarding ReasmFails\nIp: 2 many\n"), std::nullopt);
}

TEST(IncompleteDatagrams, are_told_with_the_remedy_when_there_are_more_than_before) {
  EXPECT_THAT(reassembly_advice(3, 20),
              AllOf(HasSubstr("17 datagrams"),
                    HasSubstr("3 before, 20 after"),
                    HasSubstr("bus.datagram_bytes: 1472"),
                    HasSubstr("net.ipv4.ipfrag_high_thresh")));
  EXPECT_EQ(reassembly_advice(20, 20), "");
  EXPECT_EQ(reassembly_advice(std::nullopt, 20), "");
  EXPECT_EQ(reassembly_advice(3, std::nullopt), "");
}

TEST(IncompleteDatagrams, of_the_past_are_told_and_no_finding) {
  EXPECT_EQ(reassembly_advice(20, 20), "");
  EXPECT_THAT(past_reassembly_note(20, 20), HasSubstr("20 before and after"));
  EXPECT_EQ(past_reassembly_note(3, 20), "");
  EXPECT_EQ(past_reassembly_note(0, 0), "");
  EXPECT_EQ(past_reassembly_note(std::nullopt, 20), "");
  EXPECT_EQ(past_reassembly_note(3, std::nullopt), "");
}

}  // namespace
}  // namespace trigpoint::cli
