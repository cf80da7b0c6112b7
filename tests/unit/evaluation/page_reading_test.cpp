// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the page shows, read back from it: plots in the numbers of their axes, the map's cells and
// points in metres.
#include "trigpoint/evaluation/report.hpp"
#include "trigpoint/export/map.hpp"
#include "trigpoint/export/session.hpp"

#include "../export/scratch_folder.hpp"
#include "made_session.hpp"
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <map>
#include <regex>
#include <set>

namespace trigpoint::evaluation {
namespace {

using test::make_session;
using trigpoint::test::read_all;
using trigpoint::test::ScratchFolder;

std::string read_page_of(const std::string& session) {
  ReportOptions only_page;
  only_page.pictures = false;
  return read_all(write_report(session, only_page).page_file);
}

/// A plot of the page, read back as a person reads it: in the numbers of its axes.
class PlotOfPage {
 public:
  PlotOfPage(const std::string& page, const std::string& id) {
    const auto from = page.find("id=\"" + id + "\"");
    text_ = from == std::string::npos ? "" : page.substr(from, page.find("</figure>", from) - from);
  }

  const std::string& text() const { return text_; }

  /// The points of the first curve with this class.
  std::vector<Eigen::Vector2d> curve(const std::string& style) const {
    const auto at = text_.find("<path class=\"" + style + "\" data-title=");
    if (at == std::string::npos) {
      return {};
    }
    const auto begin = text_.find(" d=\"", at) + 4;
    std::string path = text_.substr(begin, text_.find('"', begin) - begin);
    std::vector<Eigen::Vector2d> points;
    Eigen::Vector2d pen = Eigen::Vector2d::Zero();
    bool is_relative = false;
    for (std::size_t i = 0; i < path.size();) {
      const char c = path[i];
      if (c == 'M' || c == 'l' || c == 'h' || c == ' ') {
        is_relative = c == 'l' || (c == ' ' && is_relative);
        if (c == 'h') {  // a dot's "h0"
          i += 2;
          continue;
        }
        ++i;
      }
      std::size_t used = 0;
      const double x = std::stod(path.substr(i, 24), &used);
      i += used + 1;
      const double y = std::stod(path.substr(i, 24), &used);
      i += used;
      pen = is_relative ? Eigen::Vector2d(pen + Eigen::Vector2d(x, y)) : Eigen::Vector2d(x, y);
      points.push_back(in_numbers(pen));
    }
    return points;
  }

  struct Bar {
    double from{0.0};
    double to{0.0};
  };

  /// Of the rectangles with this class, where they begin and end.
  std::vector<Bar> bars(const std::string& style) const {
    static const std::regex kRect(
        R"re(class="band ([^"]*)"[^>]*? x="(\d+)"[^>]*? width="(\d+)")re");
    std::vector<Bar> bars;
    for (std::sregex_iterator at(text_.begin(), text_.end(), kRect), end; at != end; ++at) {
      if ((*at)[1] == style) {
        const double left = std::stod((*at)[2]);
        bars.push_back(
            {in_numbers({left, 0.0}).x(), in_numbers({left + std::stod((*at)[3]), 0.0}).x()});
      }
    }
    return bars;
  }

  /// Of a place in units of the drawing.
  Eigen::Vector2d in_numbers(const Eigen::Vector2d& drawn) const {
    const double height = std::stod(text_.substr(text_.find("viewBox=\"0 0 20000 ") + 19, 12));
    const double x0 = number("data-x0");
    const double y0 = number("data-y0");
    const double y1 = number("data-y1");
    const double up = 1.0 - drawn.y() / height;
    return {x0 + (number("data-x1") - x0) * drawn.x() / 20'000.0,
            number("data-log") > 0.0 ? y0 * std::pow(y1 / y0, up) : y0 + (y1 - y0) * up};
  }

 private:
  double number(const std::string& name) const {
    const auto at = text_.find(name + "=\"") + name.size() + 2;
    return std::stod(text_.substr(at, 24));
  }

  std::string text_;
};

TEST(ReportPage, draws_sigma_threshold_choices_and_dropouts_where_the_session_has_them) {
  const ScratchFolder folder;
  make_session(folder.path());
  const std::string page = read_page_of(folder.path());
  constexpr double kPixel_s = 0.01;
  constexpr double kShare = 0.01;
  const std::map<std::string, double> thresholds_m{{"east", 0.5}, {"north", 0.5}, {"up", 1.0}};
  for (const auto& [axis, threshold_m] : thresholds_m) {
    const PlotOfPage plot(page, "sigma-" + axis);
    // Sigma is 0.05 + 0.6 (t - 60) in the outage, rows come every 0.2 s: above 0.5 from 60.8 on.
    const double over_s = threshold_m == 0.5 ? 60.8 : 61.6;
    const auto expect_bars = [&](const std::string& style,
                                 const std::vector<std::pair<double, double>>& expected) {
      const auto bars = plot.bars(style);
      ASSERT_EQ(bars.size(), expected.size()) << axis << " " << style;
      for (std::size_t i = 0; i < bars.size(); ++i) {
        EXPECT_NEAR(bars[i].from, expected[i].first, kPixel_s) << axis << " " << style;
        EXPECT_NEAR(bars[i].to, expected[i].second, kPixel_s) << axis << " " << style;
      }
    };
    expect_bars("choice-none", {{0.0, 10.0}});
    expect_bars("choice-fused", {{10.0, over_s}, {80.0, 120.0}});
    expect_bars("choice-lio", {{over_s, 80.0}});
    expect_bars("dropout", {{60.0, 80.0}});
    const auto thresholds = plot.curve("line threshold");
    ASSERT_FALSE(thresholds.empty()) << axis;
    for (const auto& point : thresholds) {
      EXPECT_NEAR(point.y(), threshold_m, kShare * threshold_m) << axis;
    }
    const auto sigma = plot.curve("line gps");
    ASSERT_FALSE(sigma.empty()) << axis;
    const auto peak = *std::max_element(
        sigma.begin(), sigma.end(), [](auto& a, auto& b) { return a.y() < b.y(); });
    EXPECT_NEAR(peak.x(), 79.8, kPixel_s) << axis;
    EXPECT_NEAR(peak.y(), 0.05 + 12.0 * 0.99, kShare * 12.0) << axis;
  }
}

TEST(ReportPage, has_a_dot_for_each_fix_in_the_row_of_its_verdict) {
  const ScratchFolder folder;
  make_session(folder.path());
  auto rows = exporter::read_gate_log(folder.file("gate.csv"));
  const Nanoseconds start_ns = rows.front().stamp_ns;
  const auto at = [&](int t_s) { return start_ns + from_seconds(t_s); };
  rows.front().judged = {{at(1), true, "rows: east sigma 0.1 m"},
                         {at(2), true, "rows: east sigma 0.2 m"},
                         {at(3), false, "1.75 s old; limit 1.5 s"},
                         {at(2), false, "refused by eskf18: duplicate_stamp"}};
  rows.front().verdict = rows.front().judged.back();
  std::filesystem::remove(folder.file("gate.csv"));
  exporter::GateLog gate(folder.file("gate.csv"));
  for (const FusionStatus& row : rows) {
    gate.append(row);
  }
  const std::string page = read_page_of(folder.path());
  const PlotOfPage plot(page, "verdicts");
  const auto used = plot.curve("dots used");
  const auto refused = plot.curve("dots refused");
  constexpr double kPixel = 0.01;
  ASSERT_EQ(used.size(), 2U);
  ASSERT_EQ(refused.size(), 1U);
  EXPECT_NEAR(used[0].x(), 1.0, kPixel);
  EXPECT_NEAR(used[1].x(), 2.0, kPixel) << "a fix that came once more was used all the same";
  EXPECT_NEAR(refused[0].x(), 3.0, kPixel);
  EXPECT_NEAR(used[0].y(), 1.25, kPixel) << "the most frequent kind is the upper row";
  EXPECT_NEAR(refused[0].y(), 0.25, kPixel);
  const auto upper = plot.text().find("used, rows for the mapper");
  ASSERT_NE(upper, std::string::npos);
  EXPECT_LT(upper, plot.text().find("n s old"));
  // The made fix of that second has the antenna where truth has it, 0.6 m from base_link.
  const auto seen_from_above = PlotOfPage(page, "top-view").curve("dots refused");
  ASSERT_EQ(seen_from_above.size(), 1U);
  const Eigen::Vector3d base = exporter::read_trajectory(folder.file("truth.tum")).at(60).pose.p;
  EXPECT_NEAR((seen_from_above[0] - base.head<2>()).norm(), std::hypot(0.5, 0.2), 0.05);
}

TEST(ReportPage, draws_what_was_published_east_to_the_right_and_north_up) {
  const ScratchFolder folder;
  make_session(folder.path());
  const auto fused = exporter::read_trajectory(folder.file("fused.tum"));
  const std::string page = read_page_of(folder.path());
  const auto drawn = PlotOfPage(page, "top-view").curve("line fused");
  ASSERT_FALSE(drawn.empty());
  constexpr double kUnit_m = 0.02;
  EXPECT_LT((drawn.front() - fused.front().pose.p.head<2>()).norm(), kUnit_m);
  EXPECT_LT((drawn.back() - fused.back().pose.p.head<2>()).norm(), 2.0 * kUnit_m);
  const auto heights = PlotOfPage(page, "height").curve("line fused");
  ASSERT_FALSE(heights.empty());
  EXPECT_LT((heights.front() - Eigen::Vector2d(10.0, fused.front().pose.p.z())).norm(), kUnit_m);
}

/// RFC 4648, without its checks.
std::string decoded(const std::string& base64) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string bytes;
  std::uint32_t held = 0;
  int bits = 0;
  for (const char c : base64.substr(0, base64.find('='))) {
    held = held << 6U | static_cast<std::uint32_t>(digits.find(c));
    bits += 6;
    if (bits >= 8) {
      bits -= 8;
      bytes += static_cast<char>(held >> static_cast<unsigned>(bits) & 255U);
    }
  }
  return bytes;
}

template <typename Value>
std::vector<Value> values_of(const std::string& base64) {
  const std::string bytes = decoded(base64);
  std::vector<Value> values(bytes.size() / sizeof(Value));
  std::memcpy(values.data(), bytes.data(), values.size() * sizeof(Value));
  return values;
}

/// Between `begin` and the next `end`.
std::string between(const std::string& text, const std::string& begin, const std::string& end) {
  const auto at = text.find(begin);
  EXPECT_NE(at, std::string::npos) << begin;
  const auto from = at + begin.size();
  return at == std::string::npos ? "" : text.substr(from, text.find(end, from) - from);
}

/// Three points that no axis swaps or turns into each other.
const PointCloud& three_points() {
  static const PointCloud cloud{
      {30.0F, -20.0F, 1.0F, 0.0F}, {-50.0F, 10.0F, 2.5F, 5.0F}, {60.0F, 40.0F, -1.5F, 10.0F}};
  return cloud;
}

TEST(PageScene, holds_the_map_s_points_and_the_trajectories_where_and_when_they_are) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::write_pcd(folder.file("map.pcd"), three_points());
  const std::string page = read_page_of(folder.path());
  const auto scene = nlohmann::json::parse(between(page, "id=\"scene\">", "</script>"));
  const auto steps = values_of<std::uint16_t>(between(page, "id=\"scene-points\">", "</script>"));
  ASSERT_EQ(steps.size(), 9U);
  constexpr double kStep_m = 0.002;  // 110 m in 65535 steps
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double value = scene["low"][axis].get<double>() +
                           steps[3 * i + axis] * scene["step"][axis].get<double>();
      EXPECT_NEAR(value, three_points()[i].position()[static_cast<Eigen::Index>(axis)], kStep_m);
    }
  }
  const auto fused = exporter::read_trajectory(folder.file("fused.tum"));
  const auto& track = scene["tracks"].back();
  ASSERT_EQ(track["title"], "fused");
  const auto values = values_of<float>(track["values"]);
  ASSERT_EQ(values.size(), 4 * fused.size());
  constexpr double kFloat = 1e-4;
  EXPECT_NEAR(values[0], 10.0, kFloat) << "seconds since the session's first stamp";
  for (std::size_t axis = 0; axis < 3; ++axis) {
    EXPECT_NEAR(values[1 + axis], fused[0].pose.p[static_cast<Eigen::Index>(axis)], kFloat);
  }
  ASSERT_EQ(scene["dropouts"].size(), 1U);
  EXPECT_NEAR(scene["dropouts"][0][0].get<double>(), test::kOutageBegin_s, kFloat);
  EXPECT_NEAR(scene["dropouts"][0][1].get<double>(), test::kOutageEnd_s, kFloat);
}

TEST(PageTopView, has_the_map_s_cells_under_the_places_that_they_are_of) {
  const ScratchFolder folder;
  make_session(folder.path());
  exporter::write_pcd(folder.file("map.pcd"), three_points());
  const PlotOfPage plot(read_page_of(folder.path()), "top-view");
  const std::string image = between(plot.text(), "<image", "/>");
  const auto number = [&](const std::string& name) {
    return std::stod(between(image, " " + name + "=\"", "\""));
  };
  const std::string png = decoded(between(image, "href=\"data:image/png;base64,", "\""));
  const auto u32_at = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) {
      value = value << 8U | static_cast<unsigned char>(png.at(at + i));
    }
    return value;
  };
  const std::size_t columns = u32_at(16);
  const std::size_t rows = u32_at(20);
  // The cells stand in IDAT as they are, in blocks of 65535 bytes with a head of 5 each.
  const std::size_t idat = png.find("IDAT") + 4;
  std::string cells;
  for (std::size_t at = idat + 2; cells.size() < rows * (1 + (columns + 1) / 2);) {
    const std::size_t size = static_cast<unsigned char>(png.at(at + 1)) |
                             static_cast<std::size_t>(static_cast<unsigned char>(png.at(at + 2)))
                                 << 8U;
    cells += png.substr(at + 5, size);
    at += 5 + size;
  }
  std::vector<Eigen::Vector2d> places;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < columns; ++column) {
      const auto two =
          static_cast<unsigned char>(cells.at(row * (1 + (columns + 1) / 2) + 1 + column / 2));
      if ((column % 2 == 0 ? two >> 4U : two & 15U) != 0) {
        const double across = (static_cast<double>(column) + 0.5) / static_cast<double>(columns);
        const double down = (static_cast<double>(row) + 0.5) / static_cast<double>(rows);
        places.push_back(plot.in_numbers(
            {number("x") + across * number("width"), number("y") + down * number("height")}));
      }
    }
  }
  ASSERT_EQ(places.size(), 3U);
  constexpr double kCell_m = 0.25;
  for (const PointXyzi& point : three_points()) {
    const Eigen::Vector2d p = point.position().head<2>().cast<double>();
    EXPECT_TRUE(std::any_of(places.begin(), places.end(), [&](const Eigen::Vector2d& place) {
      return (place - p).cwiseAbs().maxCoeff() < kCell_m;
    })) << p.transpose();
  }
}

}  // namespace
}  // namespace trigpoint::evaluation
