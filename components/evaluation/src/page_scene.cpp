// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "page_scene.hpp"

#include "html.hpp"
#include "json.hpp"
#include "pictures.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_set>

namespace trigpoint::evaluation {

namespace {

constexpr double kFinestCube_m = 0.1;
constexpr double kCoarser = 1.26;  ///< a step, of a surface about a third of the points
constexpr double kSteps = 65'535.0;
constexpr double kLowShare = 0.02;  ///< colours saturate at these shares of the points
constexpr double kHighShare = 0.98;
constexpr std::size_t kMostPoses = 8000;

struct Cube {
  std::int32_t x, y, z;
  bool operator==(const Cube&) const = default;
};

struct CubeHash {
  std::size_t operator()(const Cube& cube) const {
    const auto wide = [](std::int32_t value) {
      return static_cast<std::size_t>(static_cast<std::uint32_t>(value));
    };
    return wide(cube.x) * 73'856'093U ^ wide(cube.y) * 19'349'669U ^ wide(cube.z) * 83'492'791U;
  }
};

using Cubes = std::unordered_set<Cube, CubeHash>;

/// Whether the point is the first in its cube.
bool is_new(Cubes& cubes, const PointXyzi& point, double cube_m) {
  const auto index = [&](float value) {
    return static_cast<std::int32_t>(std::floor(static_cast<double>(value) / cube_m));
  };
  return cubes.insert({index(point.x), index(point.y), index(point.z)}).second;
}

PointCloud coarser(const PointCloud& cloud, Cubes& cubes, double cube_m) {
  cubes.clear();
  PointCloud kept;
  std::copy_if(cloud.begin(), cloud.end(), std::back_inserter(kept), [&](const auto& point) {
    return is_new(cubes, point, cube_m);
  });
  return kept;
}

struct Range {
  double low{0.0};
  double high{1.0};
};

template <typename Value>
Range range_of(const PointCloud& cloud, const Value& value) {
  std::vector<double> values;
  for (const auto& point : cloud) {
    values.push_back(static_cast<double>(value(point)));
  }
  const auto at = [&](double share) {
    const auto rank = values.begin() +
                      static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
    std::nth_element(values.begin(), rank, values.end());
    return *rank;
  };
  return values.empty() ? Range{}
                        : Range{at(kLowShare), std::max(at(kHighShare), at(kLowShare) + 1e-3)};
}

std::string numbers(const Eigen::Vector3d& v) {
  return json::array({json::number(v.x()), json::number(v.y()), json::number(v.z())});
}

std::string data_element(const std::string& id, const std::string& base64) {
  return "<script type=\"text/plain\" id=\"" + id + "\">" + base64 + "</script>\n";
}

struct SceneBox {
  Eigen::Vector3d low{Eigen::Vector3d::Zero()};
  Eigen::Vector3d step_m{Eigen::Vector3d::Ones()};
};

SceneBox box_of(const PointCloud& cloud) {
  Eigen::Vector3d low = Eigen::Vector3d::Constant(1e12);
  Eigen::Vector3d high = -low;
  for (const auto& point : cloud) {
    const Eigen::Vector3d p = Eigen::Vector3f(point.x, point.y, point.z).cast<double>();
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return cloud.empty() ? SceneBox{} : SceneBox{low, ((high - low) / kSteps).cwiseMax(1e-6)};
}

std::string points_elements(const PointCloud& cloud, const SceneBox& box) {
  std::vector<std::uint16_t> places;
  std::vector<std::uint8_t> intensities;
  const Range range = range_of(cloud, [](const auto& point) { return point.intensity; });
  for (const auto& point : cloud) {
    const Eigen::Vector3d p = Eigen::Vector3f(point.x, point.y, point.z).cast<double>();
    for (int i = 0; i < 3; ++i) {
      places.push_back(
          static_cast<std::uint16_t>(std::lround((p[i] - box.low[i]) / box.step_m[i])));
    }
    const double part =
        (static_cast<double>(point.intensity) - range.low) / (range.high - range.low);
    intensities.push_back(
        static_cast<std::uint8_t>(std::lround(255.0 * std::clamp(part, 0.0, 1.0))));
  }
  return data_element("scene-points", html::base64(places)) +
         data_element("scene-intensities", html::base64(intensities));
}

/// t x y z in float32, of the session's time and `map`.
std::string track(const SessionData& data,
                  const std::string& style,
                  const std::string& title,
                  const Trajectory& trajectory,
                  const Pose& T = Pose{}) {
  std::vector<float> values;
  for (const auto& pose : thinned(trajectory, kMostPoses)) {
    const Eigen::Vector3d p = T * pose.pose.p;
    for (const double value :
         {seconds_since(data.span().begin_ns, pose.stamp_ns), p.x(), p.y(), p.z()}) {
      values.push_back(static_cast<float>(value));
    }
  }
  json::Object object;
  object.add("style", json::text(style)).add("title", json::text(title));
  return object.add("values", json::text(html::base64(values))).str();
}

std::string tracks_of(const SessionData& data) {
  std::vector<std::string> tracks;
  const auto add = [&](const char* style, const char* title, const Trajectory& t, const Pose& T) {
    if (!t.empty()) {
      tracks.push_back(track(data, style, title, t, T));
    }
  };
  const auto T_map_odom = lio_placement(data);
  add("truth", "truth", data.truth, Pose{});
  add("gps", "gps filter", data.gps, Pose{});
  add("lio", lio_title(T_map_odom.has_value()), data.lio, T_map_odom.value_or(Pose{}));
  add("fused", "fused", data.fused, Pose{});
  return json::array(tracks);
}

std::string dropouts_of(const SessionData& data) {
  std::vector<std::string> windows;
  for (const auto& window : data.outages()) {
    const auto begin_ns = data.span().begin_ns;
    windows.push_back(json::array({json::number(seconds_since(begin_ns, window.begin_ns)),
                                   json::number(seconds_since(begin_ns, window.end_ns))}));
  }
  return json::array(windows);
}

}  // namespace

PointCloud sample_evenly(const PointCloud& cloud, std::size_t most) {
  double cube_m = kFinestCube_m;
  Cubes cubes;
  PointCloud kept;
  for (const auto& point : cloud) {
    if (cloud.size() > most ? is_new(cubes, point, cube_m) : true) {
      kept.push_back(point);
    }
    while (kept.size() > most) {
      cube_m *= kCoarser;
      kept = coarser(kept, cubes, cube_m);
    }
  }
  return kept;
}

std::string scene_of(const SessionData& data, const PointCloud& map, std::size_t most_points) {
  if (map.empty() && data.fused.empty() && data.lio.empty() && data.gps.empty()) {
    return "";
  }
  const PointCloud cloud = sample_evenly(map, most_points);
  const SceneBox box = box_of(cloud);
  const Range height = range_of(cloud, [](const auto& point) { return point.z; });
  json::Object scene;
  scene.add("count", json::number(std::uint64_t{cloud.size()}))
      .add("of", json::number(std::uint64_t{map.size()}))
      .add("low", numbers(box.low))
      .add("step", numbers(box.step_m))
      .add("heights", json::array({json::number(height.low), json::number(height.high)}))
      .add("dropouts", dropouts_of(data))
      .add("tracks", tracks_of(data));
  return "<script type=\"application/json\" id=\"scene\">" + scene.str() + "</script>\n" +
         points_elements(cloud, box);
}

}  // namespace trigpoint::evaluation
