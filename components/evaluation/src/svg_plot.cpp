// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "svg_plot.hpp"

#include "html.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace trigpoint::evaluation {

namespace {

constexpr int kMostMarksX = 8;
constexpr int kMostMarksY = 5;
constexpr long kDotStep = 4;         ///< dots nearer to each other are one
constexpr double kStripPart = 0.07;  ///< of the height

std::string text_of(const char* format, double value) {
  std::array<char, 48> text{};
  std::snprintf(text.data(), text.size(), format, value);
  return text.data();
}

std::string percent(double share) {
  return text_of("%.3f%%", 100.0 * share);
}

std::string attribute(const std::string& name, const std::string& value) {
  return " " + name + "=\"" + html::escape(value) + "\"";
}

std::vector<Mark> powers_of_ten(const Axis& axis) {
  std::vector<Mark> marks;
  const int first = static_cast<int>(std::ceil(std::log10(axis.from) - 1e-9));
  for (int power = first; std::pow(10.0, power) <= axis.to * (1.0 + 1e-9); ++power) {
    const double value = std::pow(10.0, power);
    marks.push_back({value, text_of("%g", value)});
  }
  return marks;
}

}  // namespace

double Axis::share(double value) const {
  if (logarithmic) {
    return std::log(value / from) / std::log(to / from);
  }
  return (value - from) / (to - from);
}

std::vector<Mark> marks_of(const Axis& axis, int most) {
  if (!(axis.to > axis.from)) {
    return {};
  }
  if (axis.logarithmic) {
    return powers_of_ten(axis);
  }
  const double rough = (axis.to - axis.from) / most;
  const double power = std::pow(10.0, std::floor(std::log10(rough)));
  double step = 10.0 * power;
  for (const double round : {5.0, 2.0, 1.0}) {
    step = round * power >= rough ? round * power : step;
  }
  std::vector<Mark> marks;
  for (double k = std::ceil(axis.from / step - 1e-9); k * step <= axis.to + 1e-9 * step; ++k) {
    marks.push_back({k * step, text_of("%g", k == 0.0 ? 0.0 : k * step)});
  }
  return marks;
}

SvgPlot::SvgPlot(std::string id, std::string title, Axis x, Axis y, double height)
    : id_(std::move(id)),
      title_(std::move(title)),
      x_(std::move(x)),
      y_(std::move(y)),
      height_(height),
      y_marks_(marks_of(y_, kMostMarksY)) {}

std::string SvgPlot::path_of(const PlotCurve& curve) const {
  std::string path;
  long x = 0;
  long y = 0;
  bool pen_down = false;
  for (const auto& point : curve.points) {
    if (!point.allFinite() || (y_.logarithmic && point.y() <= 0.0)) {
      pen_down = false;
      continue;
    }
    const long next_x = std::lround(x_of(point.x()));
    const long next_y = std::lround(y_of(point.y()));
    if (curve.drawn == Drawn::kDots) {
      if (pen_down && next_x / kDotStep == x / kDotStep && next_y / kDotStep == y / kDotStep) {
        continue;  // it would lie on the one before
      }
      path += "M" + std::to_string(next_x) + " " + std::to_string(next_y) + "h0";
    } else if (!pen_down) {
      path += "M" + std::to_string(next_x) + " " + std::to_string(next_y) + "l0 0";
    } else if (next_x != x || next_y != y) {
      path += " " + std::to_string(next_x - x) + " " + std::to_string(next_y - y);
    }
    pen_down = true;
    x = next_x;
    y = next_y;
  }
  return path;
}

void SvgPlot::add(const PlotCurve& curve) {
  const std::string path = path_of(curve);
  if (path.empty()) {
    return;
  }
  const std::string kind = curve.drawn == Drawn::kDots ? "dots" : "line";
  front_ += "<path" + attribute("class", kind + " " + curve.style) +
            attribute("data-title", curve.title) + " d=\"" + path + "\"/>\n";
  add_legend(curve.style, curve.title, kind);
}

std::string SvgPlot::rect_of(const Band& band, double top, double bottom) const {
  const double left = std::clamp(x_of(band.from), 0.0, kWidth);
  const double right = std::clamp(x_of(band.to), 0.0, kWidth);
  return "<rect" + attribute("class", "band " + band.style) + attribute("data-title", band.title) +
         " x=\"" + text_of("%.0f", left) + "\" y=\"" + text_of("%.0f", top) + "\" width=\"" +
         text_of("%.0f", std::max(1.0, right - left)) + "\" height=\"" +
         text_of("%.0f", bottom - top) + "\"/>\n";
}

void SvgPlot::add_bands(const std::vector<Band>& bands, const std::string& title) {
  for (const auto& band : bands) {
    back_ += rect_of(band, 0.0, height_);
  }
  if (!bands.empty()) {
    add_legend(bands.front().style, title, "box");
  }
}

void SvgPlot::add_strip(const std::vector<Band>& bands) {
  for (const auto& band : bands) {
    back_ += rect_of(band, height_ * (1.0 - kStripPart), height_);
    if (legend_.find(">" + html::escape(band.title) + "<") == std::string::npos) {
      add_legend(band.style, band.title, "box");
    }
  }
}

void SvgPlot::add_picture(const std::string& data_url, Eigen::Vector2d low, Eigen::Vector2d high) {
  back_ += "<image x=\"" + text_of("%.1f", x_of(low.x())) + "\" y=\"" +
           text_of("%.1f", y_of(high.y())) + "\" width=\"" +
           text_of("%.1f", x_of(high.x()) - x_of(low.x())) + "\" height=\"" +
           text_of("%.1f", y_of(low.y()) - y_of(high.y())) +
           "\" preserveAspectRatio=\"none\" href=\"" + data_url + "\"/>\n";
}

void SvgPlot::add_label(double x, double y, const std::string& text, const std::string& style) {
  labels_ += "<span" + attribute("class", "label " + style) + " data-x=\"" + text_of("%.9g", x) +
             "\" data-y=\"" + text_of("%.9g", y) + "\" style=\"left:" + percent(x_.share(x)) +
             ";top:" + percent(1.0 - y_.share(y)) + "\">" + html::escape(text) + "</span>";
}

void SvgPlot::add_legend(const std::string& style,
                         const std::string& title,
                         const std::string& kind) {
  legend_ += "<button type=\"button\"" + attribute("data-style", style) +
             "><svg class=\"key\" viewBox=\"0 0 24 12\"><path class=\"" + kind + " " +
             html::escape(style) + "\" d=\"" +
             (kind == "box"    ? "M0 6h24"
              : kind == "dots" ? "M6 6h0M18 6h0"
                               : "M1 6h22") +
             "\"/></svg><span>" + html::escape(title) + "</span></button>";
}

std::string SvgPlot::html(const std::string& style) const {
  std::string grid;
  std::string numbers;
  for (const auto& mark : marks_of(x_, kMostMarksX)) {
    grid += "M" + text_of("%.0f", x_of(mark.value)) + " 0v" + text_of("%.0f", height_);
    numbers += "<span class=\"x\" style=\"left:" + percent(x_.share(mark.value)) + "\">" +
               mark.text + "</span>";
  }
  std::string rows;
  for (const auto& mark : y_marks_) {
    rows += "M0 " + text_of("%.0f", y_of(mark.value)) + "h" + text_of("%.0f", kWidth);
    numbers += "<span class=\"y\" style=\"top:" + percent(1.0 - y_.share(mark.value)) + "\">" +
               html::escape(mark.text) + "</span>";
  }
  const std::string view = text_of("%.0f ", kWidth) + text_of("%.0f", height_);
  return "<figure" + attribute("class", "plot " + style) + attribute("id", id_) + " data-x0=\"" +
         text_of("%.9g", x_.from) + "\" data-x1=\"" + text_of("%.9g", x_.to) + "\" data-y0=\"" +
         text_of("%.9g", y_.from) + "\" data-y1=\"" + text_of("%.9g", y_.to) + "\" data-log=\"" +
         (y_.logarithmic ? "1" : "0") + "\">\n<figcaption>" + html::escape(title_) +
         "</figcaption><div class=\"legend\">" + legend_ +
         "</div>\n<div class=\"frame\"><span class=\"ylabel\">" + html::escape(y_.label) +
         "</span><div class=\"area\" style=\"aspect-ratio:" + text_of("%.0f/", kWidth) +
         text_of("%.0f", height_) + "\">\n<svg class=\"drawing\" viewBox=\"0 0 " + view +
         "\" preserveAspectRatio=\"none\" role=\"img\"" + attribute("aria-label", title_) + ">\n" +
         back_ + "<path class=\"grid gridx\" d=\"" + grid + "\"/><path class=\"grid gridy\" d=\"" +
         rows + "\"/>\n" + front_ + "</svg>" + labels_ + "<div class=\"numbers\">" + numbers +
         "</div></div></div><div class=\"xlabel\">" + html::escape(x_.label) +
         "</div>\n</figure>\n";
}

std::vector<Eigen::Vector2d> thinned_by_extremes(const std::vector<Eigen::Vector2d>& points,
                                                 std::size_t buckets) {
  if (points.size() <= 5 * buckets) {
    return points;
  }
  std::vector<Eigen::Vector2d> kept;
  for (std::size_t bucket = 0; bucket < buckets; ++bucket) {
    const std::size_t from = bucket * points.size() / buckets;
    const std::size_t to = (bucket + 1) * points.size() / buckets;
    std::array<std::size_t, 5> chosen{from, from, from, from, to - 1};
    for (std::size_t i = from; i < to; ++i) {
      const auto replaces = [&](std::size_t other, bool is_further) {
        return !points[other].allFinite() || is_further;
      };
      if (!points[i].allFinite()) {
        chosen[3] = i;  // the curve stays broken here
      } else {
        const double y = points[i].y();
        chosen[1] = replaces(chosen[1], y > points[chosen[1]].y()) ? i : chosen[1];
        chosen[2] = replaces(chosen[2], y < points[chosen[2]].y()) ? i : chosen[2];
      }
    }
    std::sort(chosen.begin(), chosen.end());
    const auto end = std::unique(chosen.begin(), chosen.end());
    for (auto at = chosen.begin(); at != end; ++at) {
      kept.push_back(points[*at]);
    }
  }
  return kept;
}

}  // namespace trigpoint::evaluation
