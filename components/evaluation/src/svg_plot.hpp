// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Plots as inline SVG in a page. Every text is HTML beside the SVG, which can so be stretched to
// any width while its letters keep their size; lines keep their width. Colours are classes of the
// page's style sheet. The page's script reads values back from the paths (plots.js).
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace trigpoint::evaluation {

struct Axis {
  double from{0.0};
  double to{1.0};
  bool logarithmic{false};
  std::string label;

  /// 0 at `from`, 1 at `to`.
  double share(double value) const;
};

struct Mark {
  double value{0.0};
  std::string text;
};

/// Round numbers along an axis, about `most` of them; of a logarithmic one the powers of ten.
std::vector<Mark> marks_of(const Axis& axis, int most);

enum class Drawn { kLine, kDots };

struct PlotCurve {
  std::string style;  ///< class of the style sheet
  std::string title;
  std::vector<Eigen::Vector2d> points;  ///< one that is not finite breaks a line
  Drawn drawn{Drawn::kLine};
};

/// A stretch of time, over the whole height or, with `lane`, in one row from the top.
struct Band {
  std::string style;
  std::string title;
  double from{0.0};
  double to{0.0};
};

class SvgPlot {
 public:
  /// Of the drawing's own units: many times as many as pixels, so that one can zoom.
  static constexpr double kWidth = 20'000.0;

  /// `height` in the drawing's own units.
  SvgPlot(std::string id, std::string title, Axis x, Axis y, double height = 8'000.0);

  void add(const PlotCurve& curve);
  /// Over the whole height, behind the curves; `title` is theirs in the legend.
  void add_bands(const std::vector<Band>& bands, const std::string& title);
  /// In a row along the lower edge.
  void add_strip(const std::vector<Band>& bands);

  /// Instead of the y axis' numbers, e.g. names of rows.
  void set_y_marks(std::vector<Mark> marks) { y_marks_ = std::move(marks); }

  /// Behind everything, from one corner to the other.
  void add_picture(const std::string& data_url, Eigen::Vector2d low, Eigen::Vector2d high);
  /// Text at a place of the plot, with HTML's escapes made here.
  void add_label(double x, double y, const std::string& text, const std::string& style);

  /// A `<figure>`; `style` is its class: "time" (the page zooms all of them together) or "map".
  std::string html(const std::string& style) const;

 private:
  double x_of(double value) const { return kWidth * x_.share(value); }

  double y_of(double value) const { return height_ * (1.0 - y_.share(value)); }

  std::string path_of(const PlotCurve& curve) const;
  std::string rect_of(const Band& band, double top, double bottom) const;
  void add_legend(const std::string& style, const std::string& title, const std::string& kind);

  std::string id_;
  std::string title_;
  Axis x_;
  Axis y_;
  double height_;
  std::vector<Mark> y_marks_;
  std::string back_;
  std::string front_;
  std::string legend_;
  std::string labels_;
};

/// At most 5 * `buckets` of a curve's points, in their order: of each part along x the first,
/// the last, the lowest, the highest and one that is not finite: no spike and no gap is lost.
std::vector<Eigen::Vector2d> thinned_by_extremes(const std::vector<Eigen::Vector2d>& points,
                                                 std::size_t buckets = 1500);

}  // namespace trigpoint::evaluation
