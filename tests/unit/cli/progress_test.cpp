// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "progress.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <pty.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <string>
#include <thread>

namespace trigpoint::cli {
namespace {

using testing::HasSubstr;
using testing::Not;

std::string written_by(const std::function<void()>& work) {
  testing::internal::CaptureStderr();
  work();
  return testing::internal::GetCapturedStderr();
}

/// The same with standard error on a terminal.
std::string shown_by(const std::function<void()>& work) {
  int ours = -1;
  int theirs = -1;
  if (openpty(&ours, &theirs, nullptr, nullptr, nullptr) != 0) {
    return "no terminal to be had";
  }
  // Read all the while: a terminal that nobody reads stops its writer. It ends with its last
  // writer.
  std::string text;
  std::thread reader([&text, ours] {
    std::array<char, 4096> part{};
    for (ssize_t n = 0; (n = read(ours, part.data(), part.size())) > 0;) {
      text.append(part.data(), static_cast<std::size_t>(n));
    }
  });
  const int before = dup(STDERR_FILENO);
  dup2(theirs, STDERR_FILENO);
  close(theirs);
  work();
  dup2(before, STDERR_FILENO);
  close(before);
  reader.join();
  close(ours);
  return text;
}

void run_to(Progress& progress, double share) {
  for (int i = 0; i <= 1000; ++i) {
    progress(share * i / 1000.0);
  }
}

TEST(Progress, writes_a_line_every_tenth_where_there_is_no_terminal) {
  const std::string text = written_by([] {
    Progress progress("mapping");
    run_to(progress, 1.0);
  });
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 11) << text;
  EXPECT_THAT(text, Not(HasSubstr("\r")));
  EXPECT_THAT(text, HasSubstr("mapping [" + std::string(40, '.') + "]   0 %"));
  EXPECT_THAT(text, HasSubstr("mapping [" + std::string(40, '#') + "] 100 %"));
}

TEST(Progress, fills_the_bar_by_the_share) {
  EXPECT_THAT(written_by([] { Progress("mapping")(0.5); }),
              HasSubstr("[" + std::string(20, '#') + std::string(20, '.') + "]  50 %"));
}

TEST(Progress, gives_no_estimate_before_it_can_know) {
  EXPECT_THAT(written_by([] { Progress("mapping")(0.001); }), Not(HasSubstr("to go")));
}

TEST(Progress, tells_the_end_once_and_only_when_it_is_reached) {
  const std::string whole = written_by([] {
    Progress progress("mapping");
    run_to(progress, 1.0);
    progress(1.0);
    progress(1.0);
  });
  EXPECT_EQ(whole.find("100 %"), whole.rfind("100 %"));
  const std::string part = written_by([] {
    Progress progress("mapping");
    run_to(progress, 0.95);
  });
  EXPECT_THAT(part, Not(HasSubstr("100 %")));
}

TEST(Progress, keeps_a_share_out_of_range_within_the_bar) {
  EXPECT_THAT(written_by([] { Progress("mapping")(7.0); }), HasSubstr("] 100 %"));
  EXPECT_THAT(written_by([] { Progress("mapping")(-7.0); }), HasSubstr("]   0 %"));
}

TEST(Progress, redraws_one_line_on_a_terminal_and_leaves_it) {
  const std::string text = shown_by([] {
    Progress progress("mapping");
    run_to(progress, 1.0);
  });
  // Every half percent; a terminal turns "\n" into "\r\n".
  EXPECT_GT(std::count(text.begin(), text.end(), '\r'), 100) << text;
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 1) << "only when it is done";
  EXPECT_EQ(text.back(), '\n');
}

TEST(Progress, of_work_that_never_began_says_nothing) {
  EXPECT_EQ(written_by([] { const Progress progress("mapping"); }), "");
  EXPECT_EQ(shown_by([] { const Progress progress("mapping"); }), "");
}

}  // namespace
}  // namespace trigpoint::cli
