// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "wish_list.hpp"

#include <gtest/gtest.h>

#include <map>

namespace trigpoint::live {
namespace {

TEST(WishList, asks_once_however_often_a_client_changes_its_mind) {
  WishList list;
  int asked = 0;
  for (int i = 0; i < 10'000; ++i) {
    asked += list.add(7, i % 2 == 0) ? 1 : 0;
  }
  asked += list.add(3, true) ? 1 : 0;
  EXPECT_EQ(asked, 1);
  EXPECT_EQ(list.take(), (std::map<std::size_t, bool>{{3, true}, {7, false}}));
  EXPECT_TRUE(list.take().empty());
  EXPECT_TRUE(list.add(7, true)) << "what was taken is done, the next one is new";
}

}  // namespace
}  // namespace trigpoint::live
