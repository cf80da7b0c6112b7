// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// PLY: G. Turk, The PLY Polygon File Format, 1994.
#include "cloud_file.hpp"

#include "part_file.hpp"
#include "pcd_writer.hpp"

#include <bit>
#include <cmath>
#include <cstring>

namespace trigpoint::exporter {

static_assert(std::endian::native == std::endian::little, "the files are little-endian");

namespace {

class PcdFile : public CloudFile {
 public:
  PcdFile(const std::string& file, const std::string& frame) : writer_(file, frame) {}

  void append(const std::vector<FilePoint>& points) override {
    PointCloud cloud;
    cloud.reserve(points.size());
    for (const FilePoint& point : points) {
      const Eigen::Vector3f p = point.position_m.cast<float>();
      cloud.push_back({p.x(), p.y(), p.z(), point.intensity});
    }
    writer_.append(cloud);
  }

  std::uint64_t finish() override { return writer_.finish(); }

 private:
  PcdWriter writer_;
};

class PlyFile : public CloudFile {
 public:
  PlyFile(const std::string& file, const std::vector<std::string>& comments)
      : comments_(comments), file_(file, head()) {}

  void append(const std::vector<FilePoint>& points) override {
    std::string bytes(points.size() * kPointBytes, '\0');
    char* at = bytes.data();
    for (const FilePoint& point : points) {
      std::memcpy(at, point.position_m.data(), 3 * sizeof(double));
      std::memcpy(at + 3 * sizeof(double), &point.intensity, sizeof(float));
      at += kPointBytes;
    }
    file_.append(bytes.data(), bytes.size());
    points_ += points.size();
  }

  std::uint64_t finish() override {
    file_.finish(head());
    return points_;
  }

 private:
  static constexpr std::size_t kPointBytes = 3 * sizeof(double) + sizeof(float);
  static constexpr std::size_t kCountDigits = 20;

  /// Of one length whatever the number of points: a comment makes up for its digits.
  std::string head() const {
    const std::string count = std::to_string(points_);
    std::string text = "ply\nformat binary_little_endian 1.0\n";
    for (const std::string& comment : comments_) {
      text += "comment " + comment + "\n";
    }
    return text + "comment " + std::string(kCountDigits - count.size(), '.') + "\nelement vertex " +
           count +
           "\nproperty double x\nproperty double y\nproperty double z\n"
           "property float intensity\nend_header\n";
  }

  std::vector<std::string> comments_;
  std::uint64_t points_{0};
  PartFile file_;
};

}  // namespace

std::unique_ptr<CloudFile> open_pcd(const std::string& file, const std::string& frame) {
  return std::make_unique<PcdFile>(file, frame);
}

std::unique_ptr<CloudFile> open_ply(const std::string& file,
                                    const std::vector<std::string>& comments) {
  return std::make_unique<PlyFile>(file, comments);
}

CloudTiles::CloudTiles(double tile_m, Open open) : tile_m_(tile_m), open_(std::move(open)) {}

void CloudTiles::append(const std::vector<FilePoint>& points) {
  std::map<Corner, std::vector<FilePoint>> parts;
  for (const FilePoint& point : points) {
    parts[{static_cast<std::int64_t>(std::floor(point.position_m.x() / tile_m_)),
           static_cast<std::int64_t>(std::floor(point.position_m.y() / tile_m_))}]
        .push_back(point);
  }
  for (const auto& [corner, part] : parts) {
    auto& file = files_[corner];
    if (!file) {
      file = open_(name_of(corner));
    }
    file->append(part);
  }
}

std::string CloudTiles::name_of(const Corner& corner) const {
  const auto metres = [&](std::int64_t tiles) {
    return std::to_string(std::llround(static_cast<double>(tiles) * tile_m_));
  };
  return metres(corner.first) + "_" + metres(corner.second);
}

std::uint64_t CloudTiles::finish() {
  std::uint64_t points = 0;
  for (auto& [corner, file] : files_) {
    points += file->finish();
  }
  return points;
}

}  // namespace trigpoint::exporter
