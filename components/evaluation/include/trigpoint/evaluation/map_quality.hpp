// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// How good a map is: without truth by how sharp it is and whether walls that were passed twice are
// double; with the simulator's truth by how far its points are from the true surfaces.
// [1] D. Droeschel, S. Behnke, "Efficient continuous-time SLAM for 3D lidar-based online mapping",
//     ICRA 2018, and J. Razlaw et al., ECMR 2015 (mean map entropy).
#pragma once

#include "trigpoint/base/measurements.hpp"
#include "trigpoint/evaluation/plane_thickness.hpp"

#include <Eigen/Core>

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Mean over the points of h = 1/2 ln det(2 pi e Sigma), Sigma the covariance (m^2) of the points
/// within `radius_m`, itself among them ([1]). Smaller is sharper; compare only maps of one place
/// and one cell size.
struct MapEntropy {
  double radius_m{0.5};
  std::size_t points{0};        ///< that h was worked out for
  std::size_t lonely{0};        ///< with fewer than 8 points, or only such on a plane, about them
  double mean{kNaN};            ///< NaN without points
  double share_looked_at{1.0};  ///< of the map's blocks
};

/// Looks at all points within blocks of 4 m, of which a share is drawn by a hash of their place
/// when the cloud has more than `most_points`.
MapEntropy mean_map_entropy(const PointCloud& cloud,
                            double radius_m = 0.5,
                            std::size_t most_points = 1'000'000);

/// Walls that several parts of a drive saw: how far apart they put them.
struct PassOffset {
  std::size_t passes{0};
  std::size_t walls{0};   ///< seen by two passes; 0: the numbers below are NaN
  double median_m{kNaN};  ///< of the largest distance at each wall
  double p90_m{kNaN};
};

class PassWalls {
 public:
  PassWalls();
  ~PassWalls();
  PassWalls(const PassWalls&) = delete;
  PassWalls& operator=(const PassWalls&) = delete;

  /// The cloud of the next part, in the frame of all.
  void add_pass(const PointCloud& cloud);

  /// Between parts that are at least `apart` from each other in the order of adding.
  PassOffset offset(std::size_t apart = 1) const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// nullopt: the place has no surface (leaves).
using SurfaceDistance = std::function<std::optional<double>(const Eigen::Vector3d& p_map_m)>;

/// Distances of map points to true surfaces.
struct SurfaceError {
  std::size_t points{0};
  std::size_t without_surface{0};
  double rmse_m{kNaN};
  double median_m{kNaN};
  double p90_m{kNaN};
  double share_within_10cm{kNaN};
};

/// Of at most `most_points`, every n-th.
SurfaceError surface_error(const PointCloud& cloud,
                           const SurfaceDistance& distance_m,
                           std::size_t most_points = 500'000);

struct MapQuality {
  std::size_t points{0};
  MapEntropy entropy;
  PlaneThickness thickness;
  std::optional<PassOffset> passes;      ///< when the session holds placed keyframes
  std::optional<SurfaceError> surfaces;  ///< with truth
};

/// Of a session's map.pcd and keyframes. A pass is `pass_m` of the drive; walls are compared
/// between passes with at least another one between them, so that turning on the spot is none.
/// Throws std::runtime_error when there is no map.
MapQuality map_quality(const std::string& session,
                       const SurfaceDistance& distance_m = {},
                       double pass_m = 100.0);

std::string print(const MapQuality& quality);
std::string to_json(const MapQuality& quality);

}  // namespace trigpoint::evaluation
