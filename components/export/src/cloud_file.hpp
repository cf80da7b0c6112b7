// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Point cloud files that are written as the points come: none is ever in memory whole.
#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace trigpoint::exporter {

/// A point in the coordinates of the file that holds it.
struct FilePoint {
  Eigen::Vector3d position_m;
  float intensity{0.0F};
};

class CloudFile {
 public:
  virtual ~CloudFile() = default;
  virtual void append(const std::vector<FilePoint>& points) = 0;
  /// The file gets its name now. Returns the number of points.
  virtual std::uint64_t finish() = 0;
};

/// float32: for coordinates near zero only, as those in map are.
std::unique_ptr<CloudFile> open_pcd(const std::string& file, const std::string& frame);

/// Binary PLY with double coordinates. Each comment becomes a line of the head.
std::unique_ptr<CloudFile> open_ply(const std::string& file,
                                    const std::vector<std::string>& comments);

struct LasSettings {
  std::string wkt;                                    ///< coordinate system, version 1
  Eigen::Vector3d offset_m{Eigen::Vector3d::Zero()};  ///< near the points
  double intensity_factor{1.0};                       ///< to 0..65535
};

/// LAS 1.4 R15, point data record format 6, in steps of 1 mm.
std::unique_ptr<CloudFile> open_las(const std::string& file, const LasSettings& settings);

/// Squares of a grid whose lines are multiples of `tile_m`, one file each, made when its first
/// point comes: `open(name)` with the south-west corner in the name, e.g. "500100_4865700".
class CloudTiles : public CloudFile {
 public:
  using Open = std::function<std::unique_ptr<CloudFile>(const std::string& corner)>;

  CloudTiles(double tile_m, Open open);
  void append(const std::vector<FilePoint>& points) override;
  std::uint64_t finish() override;

  std::size_t tiles() const { return files_.size(); }

 private:
  using Corner = std::pair<std::int64_t, std::int64_t>;  ///< in tiles, east and north

  std::string name_of(const Corner& corner) const;

  double tile_m_;
  Open open_;
  std::map<Corner, std::unique_ptr<CloudFile>> files_;
};

}  // namespace trigpoint::exporter
