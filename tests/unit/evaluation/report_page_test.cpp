// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/report.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "html.hpp"
#include "made_session.hpp"
#include "page_plots.hpp"
#include "page_scene.hpp"
#include "png.hpp"
#include "svg_plot.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <map>
#include <regex>
#include <set>

namespace trigpoint::evaluation {
namespace {

using test::make_session;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using trigpoint::test::read_all;
using trigpoint::test::ScratchFolder;
using trigpoint::test::write_all;

constexpr double kMegabyte = 1e6;

ReportOptions only_page() {
  ReportOptions options;
  options.pictures = false;
  return options;
}

std::string page_of(const std::string& session) {
  return read_all(write_report(session, only_page()).page_file);
}

/// What is wrong with the nesting of tags and the quotes of attributes; empty when nothing is.
/// What stands in script and style is not looked at.
std::string malformed(const std::string& page) {
  static const std::regex kTag(
      R"(^<(/?)([a-zA-Z0-9]+)((?:\s+[-a-zA-Z0-9]+(?:="[^"<]*")?)*)\s*(/?)>)");
  std::vector<std::string> open;
  for (std::size_t at = page.find('>') + 1; at < page.size();) {
    at = page.find('<', at);
    if (at == std::string::npos) {
      break;
    }
    const std::string head =
        page.substr(at, std::min(page.find('>', at) + 1 - at, page.size() - at));
    // The expression's engine recurses for each character: data are too long for it.
    const std::string shortened =
        std::regex_replace(head.substr(0, 200), std::regex(" (d|href)=\"[^\"]*\"?"), "");
    const bool is_long = head.size() > 200;
    std::smatch found;
    const std::string looked_at =
        is_long ? shortened.substr(0, shortened.find_first_of(" />", 1)) + ">" : head;
    if (!std::regex_search(looked_at, found, kTag)) {
      return "not a tag: " + head.substr(0, 80);
    }
    const std::string name = found[2];
    const bool closes_itself = head[head.size() - 2] == '/';
    at += head.size();
    if (found[1] == "/") {
      if (open.empty() || open.back() != name) {
        return "</" + name + "> closes " + (open.empty() ? "nothing" : open.back());
      }
      open.pop_back();
    } else if (!closes_itself) {
      open.push_back(name);
      at = name == "script" || name == "style" ? page.find("</" + name, at) : at;
    }
  }
  return open.empty() ? "" : "<" + open.back() + "> is not closed";
}

TEST(MalformedPage, is_found_by_the_check_that_the_tests_rest_on) {
  EXPECT_EQ(malformed("<!DOCTYPE html><p>a <b>c</b><br/></p>"), "");
  EXPECT_NE(malformed("<!DOCTYPE html><p>a <b>c</p></b>"), "");
  EXPECT_NE(malformed("<!DOCTYPE html><p>1 < 2</p>"), "");
  EXPECT_NE(malformed("<!DOCTYPE html><p class=\"a\"b\">c</p>"), "");
  EXPECT_NE(malformed("<!DOCTYPE html><p>"), "");
}

TEST(ReportPage, is_well_formed_and_written_beside_the_report) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto result = write_report(folder.path(), only_page());
  EXPECT_THAT(result.problems, IsEmpty());
  EXPECT_EQ(result.page_file, folder.file("report.html"));
  EXPECT_EQ(malformed(read_all(result.page_file)), "");
  EXPECT_THAT(read_all(result.report_file), HasSubstr("[report.html](report.html)"));
}

TEST(ReportPage, loads_nothing_from_anywhere) {
  const ScratchFolder folder;
  make_session(folder.path());
  const std::string page = page_of(folder.path());
  EXPECT_THAT(page, Not(HasSubstr("http:")));
  EXPECT_THAT(page, Not(HasSubstr("https:")));
  EXPECT_THAT(page, Not(HasSubstr("url(")));
  EXPECT_THAT(page, Not(HasSubstr("@import")));
  EXPECT_THAT(page, Not(HasSubstr("<link")));
  EXPECT_THAT(page, Not(HasSubstr(" src=")));
  EXPECT_THAT(page, HasSubstr("default-src 'none'"));
}

/// Cells of every row of every table.
std::multiset<std::string> cells_of_page(const std::string& page) {
  std::multiset<std::string> cells;
  for (std::size_t at = page.find("<td>"); at != std::string::npos;
       at = page.find("<td>", at + 1)) {
    cells.insert(page.substr(at + 4, page.find("</td>", at) - at - 4));
  }
  return cells;
}

std::multiset<std::string> cells_of_markdown(const std::string& report) {
  std::multiset<std::string> cells;
  std::istringstream in(report);
  std::string before;
  for (std::string line; std::getline(in, line); before = line) {
    const bool is_head = before.empty() || before[0] != '|';
    if (line.empty() || line[0] != '|' || is_head || line.find("|:-") == 0) {
      continue;
    }
    std::istringstream parts(line.substr(1));
    for (std::string cell; std::getline(parts, cell, '|');) {
      const auto from = cell.find_first_not_of(' ');
      cells.insert(from == std::string::npos
                       ? ""
                       : cell.substr(from, cell.find_last_not_of(' ') + 1 - from));
    }
  }
  return cells;
}

TEST(ReportPage, has_the_same_tables_as_the_report) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto result = write_report(folder.path(), only_page());
  const auto wanted = cells_of_markdown(read_all(result.report_file));
  EXPECT_GT(wanted.size(), 100U);
  EXPECT_EQ(cells_of_page(read_all(result.page_file)), wanted);
}

TEST(ReportPage, has_every_part_of_a_whole_session) {
  const ScratchFolder folder;
  make_session(folder.path());
  const std::string page = page_of(folder.path());
  for (const std::string id : {"top-view",
                               "sigma-east",
                               "sigma-north",
                               "sigma-up",
                               "height",
                               "error",
                               "scan-times",
                               "scene",
                               "view",
                               "errors",
                               "messages",
                               "map"}) {
    EXPECT_THAT(page, HasSubstr("id=\"" + id + "\""));
  }
  EXPECT_THAT(page, HasSubstr("dropout 1: 20.0 s"));
}

TEST(ReportPage, lays_no_map_under_trajectories_of_another_frame) {
  const ScratchFolder folder;
  make_session(folder.path());
  const std::string pcd = read_all(folder.file("map.pcd"));
  const auto has_map = [&](const std::string& said) {
    write_all(folder.file("map.pcd"), said + pcd);
    const std::string page = page_of(folder.path());
    const bool is_under = page.find("<image") != std::string::npos;
    EXPECT_EQ(page.find("\"count\": 0,") == std::string::npos, is_under) << "in 3-D otherwise";
    return is_under;
  };
  EXPECT_FALSE(has_map("# frame odom\n"));
  EXPECT_TRUE(has_map("# frame map\n"));
  std::filesystem::remove(folder.file("alignment.yaml"));
  EXPECT_TRUE(has_map("# frame map\n")) << "the mapper has its own alignment";
  EXPECT_FALSE(has_map("")) << "nobody says that it is in map";
}

TEST(ReportPage, of_a_map_that_cannot_be_read_tells_so_once_and_shows_the_rest) {
  const ScratchFolder folder;
  make_session(folder.path());
  write_all(folder.file("map.pcd"), "nonsense");
  const auto result = write_report(folder.path(), only_page());
  EXPECT_THAT(result.problems, ElementsAre(HasSubstr("map.pcd: not a readable PCD file.")));
  EXPECT_THAT(read_all(result.page_file), HasSubstr("id=\"top-view\""));
}

TEST(ReportPage, has_restarts_as_a_part_of_their_own) {
  const ScratchFolder folder;
  make_session(folder.path());
  EXPECT_THAT(page_of(folder.path()), Not(HasSubstr("id=\"restarts\"")));
  write_all(folder.file("restarts.csv"),
            "unix_s,program,restarted,lived_s,what\n"
            "1700000000,trigpoint_lio_mapper,1,23.1,\"was killed by signal 9 (Killed)\"\n");
  const std::string page = page_of(folder.path());
  EXPECT_THAT(page, HasSubstr("<section id=\"restarts\">\n<h2>Restarts</h2>"));
  EXPECT_THAT(page, HasSubstr("<a href=\"#restarts\">Restarts</a>"));
  EXPECT_EQ(malformed(page), "");
}

TEST(ReportPage, of_a_session_with_little_in_it_is_whole_too) {
  const ScratchFolder folder;
  write_all(folder.file("run.yaml"), "log: a\n");
  const auto result = write_report(folder.path(), only_page());
  EXPECT_EQ(malformed(read_all(result.page_file)), "");
  EXPECT_THAT(read_all(result.page_file), HasSubstr("no fix was accepted"));
}

TEST(ReportPage, escapes_the_names_of_logs_and_sessions) {
  const ScratchFolder folder;
  const std::string session = folder.file("<b>&\"x'");
  make_session(session);
  exporter::write_run(session + "/run.yaml",
                      {"<script>alert(1)</script>", "offline", "hard", "ekf15", 120.0, 30.0});
  const std::string page = page_of(session);
  EXPECT_EQ(malformed(page), "");
  EXPECT_THAT(page, Not(HasSubstr("<script>alert")));
  EXPECT_THAT(page, HasSubstr("&lt;script&gt;alert(1)"));
  EXPECT_THAT(page, HasSubstr("<h1>&lt;b&gt;&amp;&quot;x&#39;</h1>"));
}

TEST(ReportPage, stays_below_twenty_megabytes_for_a_long_drive_with_a_large_map) {
  const ScratchFolder folder;
  make_session(folder.path());
  // 30 minutes of every log at the rates of a drive, as far apart as poses of a drive are.
  exporter::TrajectoryWriter fused(folder.file("fused.tum"), "base_link in map");
  exporter::GateLog gate(folder.file("gate.csv"));
  exporter::ScanLog scans(folder.file("scans.csv"));
  constexpr Nanoseconds kStart_ns = 1'700'000'000'000'000'000;
  for (int i = 0; i < 1800 * 20; ++i) {
    const double t_s = 0.05 * i;
    const Nanoseconds stamp_ns = kStart_ns + from_seconds(t_s);
    fused.append(stamp_ns,
                 {Eigen::Quaterniond::Identity(),
                  {400.0 * std::sin(0.01 * t_s), 300.0 * std::sin(0.013 * t_s), std::sin(t_s)}});
    if (i % 2 == 0) {
      FusionStatus status;
      status.stamp_ns = stamp_ns;
      for (auto& axis : status.axes) {
        axis = {AxisSource::kFused, 0.05 + 0.04 * std::sin(0.7 * i), 0.5, ""};
      }
      gate.append(status);
      LioStatus scan;
      scan.stamp_ns = stamp_ns;
      scan.scan_ms = 10.0 + std::fmod(0.37 * i, 7.0);
      scans.append(scan, 4000);
    }
  }
  PointCloud cloud;
  for (int i = 0; i < 1'500'000; ++i) {
    const auto at = static_cast<float>(i % 1730);
    cloud.push_back({0.5F * at, 0.5F * static_cast<float>(i / 1730), std::sin(at), at});
  }
  exporter::write_pcd(folder.file("map.pcd"), cloud);
  const std::string page = page_of(folder.path());
  EXPECT_LT(static_cast<double>(page.size()), 20.0 * kMegabyte);
  const std::string name = "{\"count\": ";
  const auto points = std::stoul(page.substr(page.find(name) + name.size(), 10));
  EXPECT_LE(points, kMostScenePoints);
  EXPECT_GT(points, kMostScenePoints / 4);
}

TEST(HtmlOfMarkdown, knows_what_the_report_is_made_of) {
  EXPECT_EQ(
      html::of_markdown("### A\n\nb **c** `<d>` [e](f.md)\n\n- g\n- h\n"),
      "<h3>A</h3>\n<p>b <strong>c</strong> <code>&lt;d&gt;</code> <a href=\"f.md\">e</a></p>\n"
      "<ul>\n<li>g</li>\n<li>h</li>\n</ul>\n");
  EXPECT_THAT(html::of_markdown("| a | b |\n|:--|--:|\n| 1 |   |\n"),
              HasSubstr("<tr><td>1</td><td></td></tr>"));
  EXPECT_EQ(html::of_markdown("a ** b ` c [d"), "<p>a ** b ` c [d</p>\n");
}

TEST(HtmlOfMarkdown, follows_no_link_out_of_the_session) {
  for (const std::string target :
       {"javascript:alert(1)", "//a.example", "../other", "/etc/passwd"}) {
    EXPECT_THAT(html::of_markdown("[x](" + target + ")"), Not(HasSubstr("href"))) << target;
  }
}

/// Test vectors of RFC 4648, section 10.
TEST(Base64, equals_the_examples_of_its_standard) {
  const std::vector<std::pair<std::string, std::string>> examples{{"", ""},
                                                                  {"f", "Zg=="},
                                                                  {"fo", "Zm8="},
                                                                  {"foo", "Zm9v"},
                                                                  {"foob", "Zm9vYg=="},
                                                                  {"foobar", "Zm9vYmFy"}};
  for (const auto& [text, wanted] : examples) {
    EXPECT_EQ(html::base64(std::vector<char>(text.begin(), text.end())), wanted);
  }
}

/// Chunks of a PNG by type; those of one type follow each other.
std::map<std::string, std::string> chunks_of(const std::string& png) {
  std::map<std::string, std::string> chunks;
  const auto number_at = [&](std::size_t at) {
    std::uint32_t number = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      number = number << 8U | static_cast<unsigned char>(png.at(at + i));
    }
    return number;
  };
  for (std::size_t at = 8; at < png.size();) {
    const std::size_t size = number_at(at);
    chunks[png.substr(at + 4, 4)] += png.substr(at + 8, size);
    at += 12 + size;
  }
  return chunks;
}

/// RFC 1950's sums in closed form: a = 1 + sum d_i, b = n + sum (n - i) d_i.
std::uint32_t adler_in_closed_form(const std::string& data) {
  std::uint64_t a = 1;
  std::uint64_t b = data.size();
  for (std::size_t i = 0; i < data.size(); ++i) {
    a += static_cast<unsigned char>(data[i]);
    b += (data.size() - i) * static_cast<unsigned char>(data[i]);
  }
  return static_cast<std::uint32_t>(b % 65'521 << 16U | a % 65'521);
}

TEST(Png, holds_the_cells_from_the_north_and_its_check_sums) {
  MapRaster raster;
  raster.columns = 3;
  raster.rows = 2;
  raster.darkness = {0.0F, 0.0F, 0.5F, 1.0F, 0.001F, 0.0F};  // the second row is the northern one
  const auto bytes = png_of(raster);
  const std::string png(bytes.begin(), bytes.end());
  const auto chunks = chunks_of(png);
  EXPECT_EQ(chunks.at("IHDR"), std::string("\0\0\0\3\0\0\0\2\4\3\0\0\0", 13));
  EXPECT_EQ(chunks.at("PLTE").size(), 48U);
  EXPECT_EQ(chunks.at("tRNS").size(), 16U);
  const std::string cells("\0\xf1\0\0\0\x80", 6);
  const std::string& zlib = chunks.at("IDAT");
  ASSERT_EQ(zlib.size(), 2 + 5 + cells.size() + 4);  // head, head of the block, cells, sum
  EXPECT_EQ(zlib.substr(2, 5), std::string("\1\6\0\xf9\xff", 5));
  EXPECT_EQ(zlib.substr(7, cells.size()), cells);
  std::uint32_t sum = 0;
  for (const char c : zlib.substr(zlib.size() - 4)) {
    sum = sum << 8U | static_cast<unsigned char>(c);
  }
  EXPECT_EQ(sum, adler_in_closed_form(cells));
  // The CRC of every PNG's last chunk.
  EXPECT_EQ(png.substr(png.size() - 4), "\xae\x42\x60\x82");
}

TEST(Png, of_many_cells_is_in_several_blocks_with_one_sum) {
  MapRaster raster;
  raster.columns = 400;
  raster.rows = 400;
  raster.darkness.assign(160'000, 1.0F);
  const auto bytes = png_of(raster);
  const std::string zlib = chunks_of(std::string(bytes.begin(), bytes.end())).at("IDAT");
  const std::size_t cells_size = 400 * 201;  // two cells a byte, and one byte of filter a row
  ASSERT_EQ(zlib.size(), 2 + 5 + 5 + cells_size + 4);
  const std::string cells =
      zlib.substr(7, 65'535) + zlib.substr(7 + 65'535 + 5, cells_size - 65'535);
  std::uint32_t sum = 0;
  for (const char c : zlib.substr(zlib.size() - 4)) {
    sum = sum << 8U | static_cast<unsigned char>(c);
  }
  EXPECT_EQ(sum, adler_in_closed_form(cells));
  EXPECT_EQ(zlib[2], 0);  // more blocks follow
  EXPECT_EQ(zlib[7 + 65'535], 1);
}

TEST(SvgPlot, draws_values_where_they_are_and_breaks_at_gaps) {
  SvgPlot plot("p", "t", {0.0, 10.0, false, ""}, {0.0, 4.0, false, ""}, 8000.0);
  plot.add(PlotCurve{"gps", "c", {{0.0, 0.0}, {5.0, 4.0}, {6.0, NAN}, {10.0, 1.0}}});
  EXPECT_THAT(plot.html("time"), HasSubstr(" d=\"M0 8000l0 0 10000 -8000M20000 6000l0 0\""));
}

TEST(SvgPlot, has_round_numbers_along_its_axes) {
  const auto texts = [](const Axis& axis, int most) {
    std::vector<std::string> found;
    for (const auto& mark : marks_of(axis, most)) {
      found.push_back(mark.text);
    }
    return found;
  };
  EXPECT_THAT(texts({-3.0, 9.0, false, ""}, 4), ElementsAre("0", "5"));
  EXPECT_THAT(texts({0.0, 122.0, false, ""}, 8),
              ElementsAre("0", "20", "40", "60", "80", "100", "120"));
  EXPECT_THAT(texts({0.007, 20.0, true, ""}, 4), ElementsAre("0.01", "0.1", "1", "10"));
}

TEST(ThinnedCurve, keeps_every_spike_and_gap) {
  std::vector<Eigen::Vector2d> points;
  for (int i = 0; i < 100'000; ++i) {
    points.emplace_back(i, i == 51'234 ? 7.0 : i == 20'001 ? -3.0 : i == 77'777 ? NAN : 0.0);
  }
  const auto thin = thinned_by_extremes(points, 100);
  EXPECT_LE(thin.size(), 500U);
  const auto has = [&](const auto& is) { return std::any_of(thin.begin(), thin.end(), is); };
  EXPECT_TRUE(has([](const auto& p) { return p == Eigen::Vector2d(51'234, 7.0); }));
  EXPECT_TRUE(has([](const auto& p) { return p == Eigen::Vector2d(20'001, -3.0); }));
  EXPECT_TRUE(has([](const auto& p) { return std::isnan(p.y()); }));
  EXPECT_TRUE(
      std::is_sorted(thin.begin(), thin.end(), [](auto& a, auto& b) { return a.x() < b.x(); }));
}

TEST(SceneSample, keeps_to_its_size_and_leaves_no_place_out) {
  PointCloud cloud;
  for (int i = 0; i < 200'000; ++i) {
    cloud.push_back(
        {0.05F * static_cast<float>(i % 2000), 0.05F * static_cast<float>(i / 2000), 0.0F, 0.0F});
  }
  const auto sample = sample_evenly(cloud, 3000);
  EXPECT_LE(sample.size(), 3000U);
  EXPECT_GT(sample.size(), 1000U);
  // 100 m x 5 m in squares of 1 m: each has a point.
  std::set<std::pair<int, int>> squares;
  for (const auto& point : sample) {
    squares.insert({static_cast<int>(point.x), static_cast<int>(point.y)});
  }
  EXPECT_EQ(squares.size(), 500U);
  EXPECT_EQ(sample_evenly(cloud, cloud.size()).size(), cloud.size());
}

TEST(KindOfVerdict, leaves_out_the_numbers_of_the_one_fix) {
  EXPECT_EQ(kind_of_verdict({0, true, "rows: east sigma 0.1 m <= threshold 0.5 m"}),
            "used, rows for the mapper");
  EXPECT_EQ(kind_of_verdict({0, false, "refused by eskf18: before_imu"}),
            "refused by eskf18: before_imu");
  EXPECT_EQ(kind_of_verdict({0, false, "1.25 s old; limit 1.5 s"}), "n s old");
  EXPECT_EQ(kind_of_verdict({0, false, ""}), "no verdict");
}

}  // namespace
}  // namespace trigpoint::evaluation
