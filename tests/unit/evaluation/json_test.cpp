// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "json.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <string>

namespace trigpoint::evaluation::json {
namespace {

TEST(Json, numbers_have_all_their_digits_and_unknown_is_null) {
  EXPECT_EQ(number(0.1), "0.1");
  EXPECT_EQ(std::stod(number(1.0 / 3.0)), 1.0 / 3.0);
  EXPECT_EQ(number(std::nan("")), "null");
  EXPECT_EQ(number(std::int64_t{1'700'000'000'123'456'789}), "1700000000123456789");
}

TEST(Json, texts_are_escaped) {
  EXPECT_EQ(text("a \"b\" \\ \n"), R"("a \"b\" \\ \u000a")");
}

TEST(Json, objects_keep_their_order) {
  EXPECT_EQ(Object().add("b", "1").add("a", array({"2", "3"})).str(), R"({"b": 1, "a": [2, 3]})");
}

}  // namespace
}  // namespace trigpoint::evaluation::json
