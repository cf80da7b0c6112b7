// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "top_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace trigpoint::exporter {

namespace {

constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
/// The colours span this share of all heights: a crane or a reflection must not take them all.
constexpr double kLowShare = 0.02;
constexpr double kHighShare = 0.98;
/// Below this span (m) a flat place would be painted in all colours for its noise.
constexpr float kSmallestSpan_m = 5.0F;

/// From low to high: asphalt grey, green, yellow, red-brown, white.
constexpr std::array<std::array<float, 3>, 5> kColours{{{90.0F, 96.0F, 110.0F},
                                                        {74.0F, 140.0F, 90.0F},
                                                        {225.0F, 205.0F, 105.0F},
                                                        {200.0F, 110.0F, 70.0F},
                                                        {250.0F, 245.0F, 240.0F}}};

std::array<float, 3> colour_of(float share) {
  const float at = std::clamp(share, 0.0F, 1.0F) * static_cast<float>(kColours.size() - 1);
  const auto below = std::min(static_cast<std::size_t>(at), kColours.size() - 2);
  const float rest = at - static_cast<float>(below);
  std::array<float, 3> colour{};
  for (std::size_t i = 0; i < 3; ++i) {
    colour[i] = (1.0F - rest) * kColours[below][i] + rest * kColours[below + 1][i];
  }
  return colour;
}

/// Lowest and highest of the colours' heights.
std::array<float, 2> span_of(const std::vector<float>& heights_m) {
  std::vector<float> known;
  std::copy_if(heights_m.begin(), heights_m.end(), std::back_inserter(known), [](float h) {
    return std::isfinite(h);
  });
  if (known.empty()) {
    return {0.0F, kSmallestSpan_m};
  }
  const auto at = [&](double share) {
    const auto nth =
        known.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(known.size() - 1));
    std::nth_element(known.begin(), nth, known.end());
    return *nth;
  };
  const float low = at(kLowShare);
  return {low, std::max(at(kHighShare), low + kSmallestSpan_m)};
}

}  // namespace

Grid grid_over(const Eigen::Vector2d& lowest,
               const Eigen::Vector2d& highest,
               const Eigen::Vector2d& cell,
               std::size_t most_cells) {
  Grid grid;
  grid.cell = cell;
  const Eigen::Vector2d size = highest - lowest;
  // One more along each axis: corners are on multiples of a cell.
  const double cells = (size.x() / cell.x() + 2.0) * (size.y() / cell.y() + 2.0);
  if (cells > static_cast<double>(most_cells)) {
    grid.cell *= 1.01 * std::sqrt(cells / static_cast<double>(most_cells));
  }
  const double west = std::floor(lowest.x() / grid.cell.x());
  const double north = std::floor(highest.y() / grid.cell.y()) + 1.0;
  grid.north_west = Eigen::Vector2d(west * grid.cell.x(), north * grid.cell.y());
  grid.columns = static_cast<int>(std::floor(highest.x() / grid.cell.x()) - west) + 1;
  grid.rows = static_cast<int>(north - std::floor(lowest.y() / grid.cell.y()));
  return grid;
}

TopView::TopView(const Grid& grid) : grid_(grid), heights_m_(grid.cells(), kNone) {}

void TopView::add(const Eigen::Vector2d& place, double height_m) {
  const double column = std::floor((place.x() - grid_.north_west.x()) / grid_.cell.x());
  const double row = std::floor((grid_.north_west.y() - place.y()) / grid_.cell.y());
  if (!(column >= 0.0 && column < grid_.columns && row >= 0.0 && row < grid_.rows)) {
    return;
  }
  float& highest_m =
      heights_m_[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid_.columns) +
                 static_cast<std::size_t>(column)];
  highest_m =
      std::fmax(highest_m, static_cast<float>(height_m));  // of a number and NaN: the number
}

std::vector<std::uint8_t> TopView::picture() const {
  const auto [low_m, high_m] = span_of(heights_m_);
  const auto columns = static_cast<std::size_t>(grid_.columns);
  std::vector<std::uint8_t> rgba(4 * heights_m_.size(), 0);
  for (std::size_t i = 0; i < heights_m_.size(); ++i) {
    const float height_m = heights_m_[i];
    if (!std::isfinite(height_m)) {
      continue;
    }
    const float behind_m = i > columns ? heights_m_[i - columns - 1] : kNone;  // north-west
    const float rise_m = std::isfinite(behind_m) ? height_m - behind_m : 0.0F;
    const float light = 1.0F + 0.35F * std::clamp(rise_m / 1.5F, -1.0F, 0.6F);
    const auto colour = colour_of((height_m - low_m) / (high_m - low_m));
    for (std::size_t band = 0; band < 3; ++band) {
      rgba[4 * i + band] =
          static_cast<std::uint8_t>(std::clamp(light * colour[band], 0.0F, 255.0F));
    }
    rgba[4 * i + 3] = 255;
  }
  return rgba;
}

}  // namespace trigpoint::exporter
