// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/reproduction.hpp"

#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "made_session.hpp"
#include "run_command.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <array>
#include <cmath>
#include <filesystem>
#include <map>
#include <sstream>

namespace trigpoint::evaluation {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigpoint::test::ScratchFolder;

constexpr double kSame_m = 1e-6;  // the files hold 1e-6 m and 1e-9 of a quaternion

/// RMSE of fused.tum at the fixes' own stamps, by the plainest of ways: poses looked up by their
/// stamp (the made session has one at every fix), the ellipsoid's equations for the fixes, no
/// alignment. Independent of association, interpolation, statistics and geodesy of the component.
class ByHand {
 public:
  explicit ByHand(const std::string& folder) {
    std::istringstream lines(tests::read_file(folder + "/fused.tum"));
    for (std::string line; std::getline(lines, line);) {
      std::istringstream cells(line);
      std::string stamp;
      std::array<double, 7> v{};
      if (line.front() != '#' &&
          cells >> stamp >> v[0] >> v[1] >> v[2] >> v[3] >> v[4] >> v[5] >> v[6]) {
        poses_[stamp] = v;
      }
    }
    for (const auto& logged : exporter::read_fixes(folder + "/fixes.csv")) {
      add(logged);
    }
  }

  double rmse_m(bool withheld_only, bool horizontal) const {
    double sum = 0.0;
    std::size_t n = 0;
    for (const auto& [withheld, e] : errors_m_) {
      if (withheld || !withheld_only) {
        sum += e.x() * e.x() + e.y() * e.y() + (horizontal ? 0.0 : e.z() * e.z());
        ++n;
      }
    }
    return std::sqrt(sum / static_cast<double>(n));
  }

  std::size_t samples(bool withheld_only) const {
    std::size_t n = 0;
    for (const auto& [withheld, e] : errors_m_) {
      n += withheld || !withheld_only ? 1 : 0;
    }
    return n;
  }

 private:
  static Eigen::Vector3d ecef(double latitude_deg, double longitude_deg, double height_m) {
    constexpr double kA = 6378137.0;
    constexpr double kE2 = 6.69437999014131e-3;
    const double phi = latitude_deg * M_PI / 180.0;
    const double lambda = longitude_deg * M_PI / 180.0;
    const double n = kA / std::sqrt(1.0 - kE2 * std::sin(phi) * std::sin(phi));
    return {(n + height_m) * std::cos(phi) * std::cos(lambda),
            (n + height_m) * std::cos(phi) * std::sin(lambda),
            (n * (1.0 - kE2) + height_m) * std::sin(phi)};
  }

  void add(const exporter::LoggedFix& logged) {
    const auto pose = poses_.find(exporter::stamp_text(logged.fix.stamp_ns));
    if (pose == poses_.end()) {
      return;  // before the first alignment
    }
    const double phi = 48.98 * M_PI / 180.0;
    const double lambda = 8.39 * M_PI / 180.0;
    const Eigen::Vector3d d =
        ecef(logged.fix.latitude_deg, logged.fix.longitude_deg, logged.fix.altitude_m) -
        ecef(48.98, 8.39, 116.0);
    Eigen::Matrix3d enu;
    enu << -std::sin(lambda), std::cos(lambda), 0.0,                                          //
        -std::sin(phi) * std::cos(lambda), -std::sin(phi) * std::sin(lambda), std::cos(phi),  //
        std::cos(phi) * std::cos(lambda), std::cos(phi) * std::sin(lambda), std::sin(phi);
    const auto& v = pose->second;
    const Eigen::Quaterniond q(v[6], v[3], v[4], v[5]);
    const Eigen::Vector3d antenna =
        Eigen::Vector3d(v[0], v[1], v[2]) + q * Eigen::Vector3d(-0.5, 0.2, 1.5);
    errors_m_.emplace_back(logged.withheld, antenna - enu * d);
  }

  std::map<std::string, std::array<double, 7>> poses_;
  std::vector<std::pair<bool, Eigen::Vector3d>> errors_m_;
};

/// The made session in two modes: as it is, and moved by 0.2 m to the north.
struct MadeDrive {
  ScratchFolder folder;
  ReproducedDrive drive;

  MadeDrive() {
    drive = {"made", "A drive that was made up.", "Park", false, {}};
    for (const std::string mode : {"lio", "literal"}) {
      const std::string session = folder.file(mode);
      test::make_session(session);
      drive.modes.push_back({mode, session, session});
    }
    const std::string moved = folder.file("lio") + "/fused.tum";
    const auto poses = exporter::read_trajectory(moved);
    exporter::TrajectoryWriter writer(moved, "base_link in map");
    for (auto pose : poses) {
      pose.pose.p.y() += 0.2;
      writer.append(pose.stamp_ns, pose.pose);
    }
  }
};

TEST(Reproduction, holds_the_figures_of_an_independent_computation) {
  const MadeDrive made;
  const DriveFigures figures = score(made.drive);
  ASSERT_EQ(figures.modes.size(), 2U);
  EXPECT_THAT(figures.problems, IsEmpty());
  for (const ModeFigures& mode : figures.modes) {
    const ByHand by_hand(made.folder.file(mode.mode));
    ASSERT_TRUE(mode.fixes_fed && mode.fixes_withheld && mode.truth);
    const AbsoluteError& all = mode.fixes_fed->scores.at(0).error;
    const AbsoluteError& withheld = mode.fixes_withheld->scores.at(0).error;
    EXPECT_NEAR(all.position_m.rmse, by_hand.rmse_m(false, false), kSame_m) << mode.mode;
    EXPECT_NEAR(all.horizontal_m.rmse, by_hand.rmse_m(false, true), kSame_m) << mode.mode;
    EXPECT_NEAR(withheld.position_m.rmse, by_hand.rmse_m(true, false), kSame_m) << mode.mode;
    EXPECT_NEAR(withheld.horizontal_m.rmse, by_hand.rmse_m(true, true), kSame_m) << mode.mode;
    EXPECT_EQ(mode.fixes_fed->pairs, by_hand.samples(false));
    EXPECT_EQ(mode.fixes_withheld->pairs, by_hand.samples(true));
  }
}

TEST(Reproduction, prints_the_paper_s_figures_beside_its_own_and_what_holds) {
  const MadeDrive made;
  const std::string text = print({"how", {score(made.drive)}, {}});
  EXPECT_THAT(text, HasSubstr("paper, Park: GPS as fed"));
  std::istringstream lines(text);
  std::map<std::string, std::string> rows;
  for (std::string line; std::getline(lines, line);) {
    const auto end = line.find("  ");
    rows[line.substr(0, end)] = line;
  }
  const std::string paper = rows.at("| paper, Park: GPS as fed");
  EXPECT_THAT(paper, AllOf(HasSubstr("0.54 |"), HasSubstr("0.94 |"), HasSubstr("0.12 |")));
  EXPECT_THAT(text, HasSubstr("of which this drive is no copy"));
  EXPECT_THAT(text, HasSubstr("`lio` = FAST-LIO"));
  EXPECT_THAT(text, HasSubstr("`literal` = LIO-FUSION-UNCERTAINTY"));
  EXPECT_THAT(text, HasSubstr("holds ("));
  EXPECT_THAT(text, HasSubstr("GPS dropouts: 1, of 20.0 s"));
  EXPECT_THAT(text, Not(HasSubstr("INCOMPLETE")));
}

TEST(Reproduction, says_when_a_claim_does_not_hold) {
  MadeDrive made;
  std::swap(made.drive.modes[0].fed, made.drive.modes[1].fed);
  std::swap(made.drive.modes[0].withheld, made.drive.modes[1].withheld);
  EXPECT_THAT(print({"how", {score(made.drive)}, {}}), HasSubstr("does NOT hold ("));
  made.drive.modes[0] = made.drive.modes[1];
  made.drive.modes[0].mode = "lio";
  EXPECT_THAT(print({"how", {score(made.drive)}, {}}), HasSubstr("no difference ("));
}

TEST(Reproduction, writes_files_that_say_that_they_are_incomplete) {
  const MadeDrive made;
  const ScratchFolder out;
  const Reproduction partly{"how", {score(made.drive)}, {"park"}};
  write(partly, out.path());
  const auto json = nlohmann::json::parse(tests::read_file(out.file("reproduction.json")));
  EXPECT_FALSE(json["complete"].get<bool>());
  EXPECT_EQ(json["missing"], nlohmann::json({"park"}));
  EXPECT_THAT(tests::read_file(out.file("reproduction.md")), HasSubstr("INCOMPLETE"));
  EXPECT_THAT(tests::read_file(out.file("reproduction.html")), HasSubstr("INCOMPLETE"));
  EXPECT_THAT(failures_of(partly), ElementsAre("park: not done."));
  write({"how", {score(made.drive)}, {}}, out.path());
  EXPECT_TRUE(nlohmann::json::parse(tests::read_file(out.file("reproduction.json")))["complete"]);
}

TEST(Reproduction, has_a_page_that_loads_nothing_and_takes_names_for_text) {
  MadeDrive made;
  const ScratchFolder out;
  made.drive.name = "<img src=x onerror=alert(1)>";
  DriveFigures figures = score(made.drive);
  tests::write_file(out.file("a.png"), "picture");
  figures.pictures = {"a.png"};
  write({"<script>alert(2)</script>", {figures}, {}}, out.path());
  const std::string page = tests::read_file(out.file("reproduction.html"));
  EXPECT_THAT(page, HasSubstr("Content-Security-Policy\" content=\"default-src 'none'"));
  EXPECT_THAT(page, HasSubstr("src=\"data:image/png;base64,cGljdHVyZQ==\""));
  for (const char* loaded : {"http:", "https:", "<link", "<script", "<img src=x"}) {
    EXPECT_THAT(page, Not(HasSubstr(loaded)));
  }
}

TEST(Reproduction, has_the_same_figures_in_json_and_csv) {
  const MadeDrive made;
  const Reproduction result{"how", {score(made.drive)}, {}};
  const auto json = nlohmann::json::parse(to_json(result));
  std::istringstream lines(to_csv(result));
  std::string line;
  std::getline(lines, line);
  std::size_t found = 0;
  while (std::getline(lines, line)) {
    std::vector<std::string> cells;
    std::istringstream in(line);
    for (std::string cell; std::getline(in, cell, ',');) {
      cells.push_back(cell);
    }
    ASSERT_EQ(cells.size(), 9U) << line;
    const auto& modes = json["drives"][0]["modes"];
    const auto& mode = modes[cells[1] == "lio" ? 0 : 1];
    const auto& reference = mode[cells[3]];
    const std::string alignment = cells[4] == "none" ? "none" : "yaw_translation";
    EXPECT_EQ(std::stod(cells[8]), reference[alignment]["rmse_" + cells[5] + "_m"].get<double>());
    EXPECT_EQ(std::stoul(cells[6]), reference["samples"].get<std::size_t>());
    ++found;
  }
  EXPECT_EQ(found, 2U * 4U * 2U * 2U);  // modes, references, alignments, axes
}

TEST(Reproduction, tells_a_mode_that_published_nothing) {
  MadeDrive made;
  std::filesystem::remove(made.folder.file("lio") + "/fused.tum");
  const DriveFigures figures = score(made.drive);
  EXPECT_FALSE(figures.modes[0].truth);
  EXPECT_THAT(failures_of({"how", {figures}, {}}),
              ::testing::Contains(HasSubstr("made: Mode lio: nothing was published in map")));
  EXPECT_THAT(print({"how", {figures}, {}}), HasSubstr("**Problems**"));
}

TEST(Reproduction, draws_both_pictures_and_says_when_it_cannot) {
  const MadeDrive made;
  const ScratchFolder out;
  DriveFigures figures = score(made.drive);
  draw(figures, out.path());
  EXPECT_THAT(figures.problems, IsEmpty());
  ASSERT_EQ(figures.pictures.size(), 2U);
  for (const std::string& picture : figures.pictures) {
    EXPECT_GT(std::filesystem::file_size(out.file(picture)), 20'000U) << picture;
  }
  DriveFigures again = score(made.drive);
  draw(again, out.path(), "no_such_gnuplot");
  EXPECT_THAT(again.problems, ElementsAre(HasSubstr("gnuplot-nox")));
}

TEST(Reproduction, draws_a_drive_with_a_quote_in_its_name_and_without_a_word_of_the_gate) {
  MadeDrive made;
  const ScratchFolder out;
  made.drive.name = "bob's lane";
  for (const char* mode : {"lio", "literal"}) {
    std::filesystem::remove(made.folder.file(mode) + "/gate.csv");
  }
  DriveFigures figures = score(made.drive);
  draw(figures, out.path());
  EXPECT_THAT(figures.problems, IsEmpty());
  EXPECT_EQ(figures.pictures.size(), 2U);
}

}  // namespace
}  // namespace trigpoint::evaluation
