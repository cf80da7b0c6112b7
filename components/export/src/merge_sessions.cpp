// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/export/correct_session.hpp"
#include "trigpoint/geodesy/local_frame.hpp"
#include "trigpoint/lio_mapper/keyframe_store.hpp"

#include "render_map.hpp"
#include <Eigen/SVD>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::exporter {

namespace {

namespace fs = std::filesystem;

using lio_mapper::GraphInput;
using lio_mapper::KeyframeReader;

/// Long enough for the directions of the axes to millimetres at their ends' distance.
constexpr double kAxis_m = 1000.0;

Datum datum_of(const std::string& session) {
  const std::string file = path_in(session, session_file::kDatum);
  if (!fs::exists(file)) {
    throw std::runtime_error(session + ": has no " + session_file::kDatum +
                             ": only sessions whose place on the Earth is known can be merged");
  }
  return read_datum(file);
}

/// The second tangent plane in the first. Both are Cartesian, so four points tell it exactly.
Pose between(const Datum& first, const Datum& second) {
  const geodesy::LocalFrame map(first);
  const geodesy::LocalFrame other(second);
  const auto moved = [&](const Eigen::Vector3d& p) {
    const std::optional<Eigen::Vector3d> in_map = map.to_map(other.to_geographic(p));
    if (!in_map) {
      throw std::runtime_error("the sessions' datums cannot be brought into one frame");
    }
    return *in_map;
  };
  const Eigen::Vector3d origin_m = moved(Eigen::Vector3d::Zero());
  Eigen::Matrix3d axes;
  for (Eigen::Index i = 0; i < 3; ++i) {
    axes.col(i) = (moved(kAxis_m * Eigen::Vector3d::Unit(i)) - origin_m) / kAxis_m;
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(axes, Eigen::ComputeFullU | Eigen::ComputeFullV);
  return {Eigen::Quaterniond(Eigen::Matrix3d(svd.matrixU() * svd.matrixV().transpose())), origin_m};
}

/// `sessions` names both in an error.
CorrectedPoses poses_of(const GraphInput& input,
                        const lio_mapper::CorrectedPast& past,
                        const std::string& sessions) {
  CorrectedPoses poses;
  poses.frame = past.frame;
  for (std::size_t i = 0; i < input.keyframes.size(); ++i) {
    if (past.T_map_base[i] &&
        !poses.T_frame_base.emplace(input.keyframes[i].stamp_ns, *past.T_map_base[i]).second) {
      throw std::runtime_error(sessions + ": both have a keyframe at " +
                               std::to_string(input.keyframes[i].stamp_ns) +
                               " ns; two drives at different times are expected, not one twice");
    }
  }
  return poses;
}

void write_part(const std::string& file,
                const std::vector<lio_mapper::MapSample>& samples,
                std::size_t begin,
                std::size_t end) {
  TrajectoryWriter writer(file, "base_link in map, corrected past of two sessions in one graph");
  for (std::size_t i = begin; i < end; ++i) {
    writer.append(samples[i].stamp_ns, samples[i].T_map_base);
  }
}

/// Files get into `out` when all of them are whole: they are made in a hidden folder within it. One
/// that a killed program left is removed.
class Staging {
 public:
  explicit Staging(const std::string& out) : out_(out), hidden_(fs::path(out) / ".merging") {
    fs::remove_all(hidden_);
    create_session_folder(hidden_.string());
  }

  ~Staging() {
    std::error_code ignored;
    fs::remove_all(hidden_, ignored);
  }

  Staging(const Staging&) = delete;
  Staging& operator=(const Staging&) = delete;

  std::string file(const char* name) const { return path_in(hidden_.string(), name); }

  void commit() const {
    for (const fs::directory_entry& entry : fs::directory_iterator(hidden_)) {
      fs::rename(entry.path(), out_ / entry.path().filename());
    }
  }

 private:
  fs::path out_;
  fs::path hidden_;
};

}  // namespace

MergeReport merge_sessions(const std::string& first,
                           const std::string& second,
                           const std::string& out,
                           double voxel_m,
                           const std::function<void(double)>& progress) {
  const Datum datum = datum_of(first);
  const Pose T_map_second = between(datum, datum_of(second));
  GraphInput input = graph_input_of(first);
  const std::size_t begin_of_second = input.keyframes.size();
  const std::size_t sweeps_of_first = input.trajectory.size();
  lio_mapper::merge_sessions(input, graph_input_of(second), T_map_second);
  KeyframeReader first_store(path_in(first, session_file::kKeyframes));
  KeyframeReader second_store(path_in(second, session_file::kKeyframes));
  const auto cloud_of = [&](std::size_t i) {
    auto keyframe = i < begin_of_second ? first_store.at(i) : second_store.at(i - begin_of_second);
    return keyframe ? std::move(keyframe->points_base) : PointCloud{};
  };
  const lio_mapper::CorrectedPast past =
      lio_mapper::correct_past(input, cloud_of, {}, [&](double share) {
        if (progress) {
          progress(0.5 * share);
        }
      });
  const CorrectedPoses poses = poses_of(input, past, first + " and " + second);
  const Staging staging(out);
  write_datum(staging.file(session_file::kDatum), datum);
  const std::vector<lio_mapper::MapSample> samples = lio_mapper::corrected_trajectory(input, past);
  const auto second_begins =
      std::find_if(samples.begin(), samples.end(), [&](const lio_mapper::MapSample& sample) {
        return sample.sweep >= sweeps_of_first;
      });
  const auto split = static_cast<std::size_t>(second_begins - samples.begin());
  write_part(staging.file("first.tum"), samples, 0, split);
  write_part(staging.file("second.tum"), samples, split, samples.size());
  render_keyframes(
      [&](const auto& visit) {
        first_store.visit(visit);
        second_store.visit(visit);
      },
      std::nullopt,
      voxel_m,
      staging.file(session_file::kMap),
      [&](double share) {
        if (progress) {
          progress(0.5 + 0.5 * share);
        }
      },
      {&poses, true, past_settings_of(first).lidar_position_base_m});
  staging.commit();
  MergeReport report{past.report, 0};
  for (const lio_mapper::Loop& loop : past.loops) {
    report.loops_between += loop.earlier < begin_of_second && loop.later >= begin_of_second ? 1 : 0;
  }
  return report;
}

}  // namespace trigpoint::exporter
