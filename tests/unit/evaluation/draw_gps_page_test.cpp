// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/gps_page.hpp"

#include "../export/scratch_folder.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <sstream>

namespace trigpoint::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using trigpoint::test::error_of;
using trigpoint::test::read_all;
using trigpoint::test::ScratchFolder;

constexpr double kPrinted = 1e-5;  // digits of the data files

/// Two filters from 10 to 20 s; the second one's name and the title would trouble gnuplot.
GpsPage made_page() {
  GpsPage page;
  page.title = "a driver's_page";
  page.outage_from_s = 12.0;
  page.outage_to_s = 17.0;
  for (const char* name : {"one", "two_b"}) {
    FilterErrors filter{name, {}};
    for (int i = 0; i <= 100; ++i) {
      filter.samples.push_back({10.0 + 0.1 * i, {3.0, -4.0, 12.0}, {1.0, 2.0, 2.0}});
    }
    page.filters.push_back(filter);
  }
  return page;
}

class GpsPagePictures : public testing::Test {
 protected:
  void SetUp() override {
    if (std::system("gnuplot --version > /dev/null 2>&1") != 0) {
      GTEST_SKIP() << "gnuplot is not installed: pictures are not tested";
    }
  }
};

TEST_F(GpsPagePictures, are_drawn_without_complaint_and_shown_by_the_page) {
  const ScratchFolder folder;
  const std::string page = draw_gps_page(made_page(), folder.path());
  EXPECT_EQ(std::filesystem::path(page), std::filesystem::path(folder.file("index.html")));
  EXPECT_THAT(read_all(page),
              AllOf(HasSubstr("bands.png"), HasSubstr("all.png"), HasSubstr("from 12 to 17 s")));
  for (const char* name : {"bands", "all"}) {
    EXPECT_GT(std::filesystem::file_size(folder.file(std::string(name) + ".png")), 10'000U) << name;
    EXPECT_FALSE(std::filesystem::exists(folder.file(std::string("plots/") + name + ".log")));
    EXPECT_THAT(read_all(folder.file(std::string("plots/") + name + ".gp")),
                AllOf(HasSubstr("rectangle from 12, graph 0 to 17, graph 1"), HasSubstr("[m]")));
  }
}

TEST_F(GpsPagePictures, are_of_errors_and_three_times_their_sigma) {
  const ScratchFolder folder;
  draw_gps_page(made_page(), folder.path());
  std::istringstream first(read_all(folder.file("plots/bands_two_b.dat")));
  const std::vector<double> expected{10.0, 3.0, -4.0, 12.0, 3.0, 6.0, 6.0, 13.0, 9.0};
  for (const double value : expected) {
    double read = 0.0;
    first >> read;
    EXPECT_NEAR(read, value, kPrinted);
  }
}

TEST(GpsPage, says_what_to_install_when_gnuplot_is_missing) {
  const ScratchFolder folder;
  EXPECT_THAT(
      error_of([&] { draw_gps_page(made_page(), folder.path(), "gnuplot-that-does-not-exist"); }),
      HasSubstr("gnuplot-nox"));
}

}  // namespace
}  // namespace trigpoint::evaluation
