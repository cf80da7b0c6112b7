// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "credentials.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace trigpoint::bus {
namespace {

TEST(Credentials, are_none_without_a_folder) {
  EXPECT_FALSE(credentials_of(Config{}, "fastdds").has_value());
}

TEST(Credentials, that_cannot_be_read_are_named_with_who_makes_them) {
  Config config;
  config.security_folder = "/nowhere/at/all";
  try {
    credentials_of(config, "fastdds");
    FAIL() << "accepted";
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("/nowhere/at/all/identity_ca.cert.pem"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("make-credentials"));
  }
}

}  // namespace
}  // namespace trigpoint::bus
