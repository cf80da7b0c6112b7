// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "outbox.hpp"

#include <gtest/gtest.h>

namespace trigpoint::live {
namespace {

Frame frame(std::uint64_t stream, std::uint8_t mark, std::size_t bytes = 10) {
  Frame made;
  made.stream = stream;
  made.payload = std::make_shared<const Bytes>(bytes, mark);
  return made;
}

std::vector<int> marks_of(Outbox& outbox) {
  std::vector<int> marks;
  while (const auto next = outbox.pop()) {
    marks.push_back(next->payload->front());
  }
  return marks;
}

TEST(Outbox, gives_what_it_got_in_order) {
  Outbox outbox(1000);
  EXPECT_EQ(outbox.push(frame(1, 1), 5), 0U);
  EXPECT_EQ(outbox.push(frame(2, 2), 5), 0U);
  EXPECT_EQ(outbox.push(frame(1, 3), 5), 0U);
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{1, 2, 3}));
  EXPECT_EQ(outbox.waiting_bytes(), 0U);
}

TEST(Outbox, keeps_the_newest_of_a_stream_that_is_too_fast) {
  Outbox outbox(1000);
  EXPECT_EQ(outbox.push(frame(7, 1), 2), 0U);
  EXPECT_EQ(outbox.push(frame(8, 100), 2), 0U);
  EXPECT_EQ(outbox.push(frame(7, 2), 2), 0U);
  EXPECT_EQ(outbox.push(frame(7, 3), 2), 1U);
  EXPECT_EQ(outbox.push(frame(7, 4), 2), 1U);
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{100, 3, 4}));
}

TEST(Outbox, takes_room_for_new_data_from_the_heaviest_stream) {
  Outbox outbox(1000);
  outbox.push(frame(1, 1, 20), 100);
  outbox.push(frame(2, 2, 400), 100);
  outbox.push(frame(2, 3, 400), 100);
  EXPECT_EQ(outbox.push(frame(1, 4, 300), 100), 1U);
  EXPECT_LE(outbox.waiting_bytes(), 1000U);
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{1, 3, 4}));
}

TEST(Outbox, refuses_what_is_larger_than_everything_that_may_wait) {
  Outbox outbox(1000);
  outbox.push(frame(1, 1, 500), 100);
  EXPECT_EQ(outbox.push(frame(1, 2, 1001), 100), 1U);
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{1}));
}

TEST(Outbox, sends_answers_before_data) {
  Outbox outbox(1000);
  outbox.push(frame(1, 1), 5);
  outbox.push_control(frame(0, 9));
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{9, 1}));
}

TEST(Outbox, forgets_a_stream_that_ended) {
  Outbox outbox(1000);
  outbox.push(frame(1, 1), 5);
  outbox.push(frame(2, 2), 5);
  outbox.push(frame(1, 3), 5);
  outbox.forget(1);
  outbox.forget(5);
  EXPECT_EQ(outbox.waiting_bytes(), 10U);
  EXPECT_EQ(marks_of(outbox), (std::vector<int>{2}));
}

}  // namespace
}  // namespace trigpoint::live
