// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What the mapper costs, stage by stage, with both local maps on the same log, beside PCL's voxel
// grid and nearest-neighbour search on the same scans as a fixed reference. Figures are CPU time of
// the whole process, so other programs on the machine disturb them little; compare the ratios.
#include "trigpoint/base/config.hpp"
#include "trigpoint/lio_mapper/lio_mapper.hpp"
#include "trigpoint/recording/log.hpp"

#include "downsample.hpp"
#include "ikd_tree.hpp"
#include "input.hpp"
#include "local_map.hpp"
#include "sweep.hpp"
#include <CLI/CLI.hpp>
#include <pcl/filters/voxel_grid.h>
#include <pcl/kdtree/kdtree_flann.h>
#include <pcl/point_types.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ctime>
#include <map>
#include <numeric>
#include <random>
#include <span>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace {

using namespace trigpoint;
using lio_mapper::Stage;
using Cloud = pcl::PointCloud<pcl::PointXYZ>;

constexpr double kReferenceVoxel_m = 0.5;
constexpr int kNeighbours = 5;

double cpu_ms() {
  timespec now{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// One number a scan.
struct Series {
  std::vector<double> values;

  double quantile(double share) const {
    if (values.empty()) {
      return 0.0;
    }
    std::vector<double> sorted = values;
    std::sort(sorted.begin(), sorted.end());
    const auto last = static_cast<double>(sorted.size() - 1);
    return sorted[static_cast<std::size_t>(share * last + 0.5)];
  }

  double mean() const {
    return values.empty() ? 0.0
                          : std::accumulate(values.begin(), values.end(), 0.0) /
                                static_cast<double>(values.size());
  }
};

constexpr std::array<std::pair<Stage, const char*>, 8> kStages{{{Stage::kDecode, "decode"},
                                                                {Stage::kPredict, "predict"},
                                                                {Stage::kUndistort, "undistort"},
                                                                {Stage::kDownsample, "down-sample"},
                                                                {Stage::kMatch, "match"},
                                                                {Stage::kSolve, "solve"},
                                                                {Stage::kInsert, "insert"},
                                                                {Stage::kReport, "report"}}};

/// Adds up the CPU time of each stage of one scan.
class StageClock {
 public:
  void operator()(Stage stage) {
    const double now_ms = cpu_ms();
    spent_ms_[stage_] += now_ms - since_ms_;
    stage_ = stage;
    since_ms_ = now_ms;
  }

  std::map<Stage, double> take() {
    (*this)(stage_);
    return std::exchange(spent_ms_, {});
  }

 private:
  Stage stage_{Stage::kOutside};
  double since_ms_{cpu_ms()};
  std::map<Stage, double> spent_ms_;
};

struct Result {
  std::map<Stage, Series> stages;
  Series total;  ///< everything but the reading of the log
  Series match_and_insert;
  std::size_t map_bytes{0};
  PointCloud map_points;
  std::vector<PointCloud> scans_odom;  ///< thinned as for matching
  std::uint64_t scans_used{0};
};

Result run(const cli::InputOptions& options, const std::string& kind) {
  cli::Input input = cli::open_input(options);
  lio_mapper::Config config = input.config.cores.lio_mapper;
  config.local_map.kind = kind;
  lio_mapper::LioMapper mapper(config, input.config.cores.robot);
  StageClock clock;
  mapper.observe_stages(std::ref(clock));
  Result result;
  double spent_ms = 0.0;
  while (const auto entry = input.reader->next()) {
    const double before_ms = cpu_ms();
    lio_mapper::Output output;
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      output = mapper.on_imu(*imu);
    } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry->measurement)) {
      output = mapper.on_cloud(*cloud);
    } else {
      continue;
    }
    spent_ms += cpu_ms() - before_ms;
    if (output.scans.size() != 1) {
      // The start processes many sweeps at once.
      if (!output.scans.empty()) {
        clock.take();
        spent_ms = 0.0;
      }
      continue;
    }
    const auto stages = clock.take();
    for (const auto& [stage, ms] : stages) {
      result.stages[stage].values.push_back(ms);
    }
    result.total.values.push_back(std::exchange(spent_ms, 0.0));
    result.match_and_insert.values.push_back(stages.at(Stage::kMatch) + stages.at(Stage::kInsert));
    result.scans_odom.push_back(
        lio_mapper::downsample(output.scans.front().points_odom, config.matching.voxel_m));
    clock.take();  // the thinning is not the mapper's
  }
  result.map_bytes = mapper.map_memory_bytes();
  result.map_points = mapper.local_map();
  result.scans_used = mapper.status().scans_used;
  return result;
}

/// PCL's voxel grid of each scan and the five nearest neighbours of each of its voxels in the one
/// before.
Series reference(const cli::InputOptions& options) {
  cli::Input input = cli::open_input(options);
  lio_mapper::SweepDecoder decoder(input.config.cores.lio_mapper.sweep);
  Series series;
  Cloud::Ptr previous;
  while (const auto entry = input.reader->next()) {
    const auto* message = std::get_if<PointCloudMessage>(&entry->measurement);
    if (message == nullptr) {
      continue;
    }
    Events events;
    const auto decoded = decoder.decode(*message, events);
    if (!std::holds_alternative<lio_mapper::Sweep>(decoded)) {
      continue;
    }
    auto cloud = pcl::make_shared<Cloud>();
    for (const lio_mapper::TimedPoint& p : std::get<lio_mapper::Sweep>(decoded).points) {
      cloud->push_back({p.x, p.y, p.z});
    }
    const double before_ms = cpu_ms();
    auto thinned = pcl::make_shared<Cloud>();
    pcl::VoxelGrid<pcl::PointXYZ> grid;
    grid.setLeafSize(kReferenceVoxel_m, kReferenceVoxel_m, kReferenceVoxel_m);
    grid.setInputCloud(cloud);
    grid.filter(*thinned);
    if (previous && !previous->empty()) {
      pcl::KdTreeFLANN<pcl::PointXYZ> tree;
      tree.setInputCloud(previous);
      std::vector<int> indices(kNeighbours);
      std::vector<float> distances2(kNeighbours);
      for (const auto& p : *thinned) {
        tree.nearestKSearch(p, kNeighbours, indices, distances2);
      }
    }
    series.values.push_back(cpu_ms() - before_ms);
    previous = thinned;
  }
  return series;
}

/// CPU time of a map alone: each scan's points looked up, then inserted. What the mapper's stage
/// "match" does besides (rows of the normal matrix and their sums) is the same for both maps.
Series map_alone(const cli::InputOptions& options,
                 const std::string& kind,
                 const std::vector<PointCloud>& scans_odom) {
  lio_mapper::LocalMapConfig config = cli::open_input(options).config.cores.lio_mapper.local_map;
  config.kind = kind;
  const auto map = lio_mapper::make_local_map(config);
  Series series;
  std::size_t found = 0;
  for (const PointCloud& scan : scans_odom) {
    const double before_ms = cpu_ms();
    for (const PointXyzi& point : scan) {
      lio_mapper::PlaneMatch plane;
      found += map->match_surface(point.position().cast<double>(), plane) ? 1 : 0;
    }
    map->insert(scan);
    series.values.push_back(cpu_ms() - before_ms);
  }
  std::printf("  (%s alone: %zu planes found)\n", kind.c_str(), found);
  return series;
}

/// Nanoseconds a query of five neighbours, of our tree and of PCL's, in the same points.
struct NeighbourCosts {
  double ikd_ns{0.0};
  double pcl_ns{0.0};
  std::size_t points{0};
  std::size_t queries{0};
};

NeighbourCosts compare_neighbours(const PointCloud& map_points) {
  constexpr std::size_t kQueries = 200000;
  std::mt19937 random(1);
  std::normal_distribution<float> off(0.0F, 0.1F);
  std::uniform_int_distribution<std::size_t> pick(0, map_points.size() - 1);
  auto cloud = pcl::make_shared<Cloud>();
  for (const PointXyzi& p : map_points) {
    cloud->push_back({p.x, p.y, p.z});
  }
  // Neighbours in space follow each other, as in a scan.
  std::vector<Eigen::Vector3f> queries;
  while (queries.size() < kQueries) {
    const std::size_t first = pick(random);
    for (std::size_t i = first; i < std::min(first + 100, map_points.size()); ++i) {
      queries.push_back(map_points[i].position() +
                        Eigen::Vector3f(off(random), off(random), off(random)));
    }
  }
  // Grown scan by scan as in use, not built at once.
  lio_mapper::IkdTree tree;
  PointCloud shuffled = map_points;
  std::shuffle(shuffled.begin(), shuffled.end(), random);
  for (std::size_t i = 0; i < shuffled.size(); i += 1000) {
    tree.insert(std::span(shuffled).subspan(i, std::min<std::size_t>(1000, shuffled.size() - i)));
  }
  tree.finish_rebuilds();
  pcl::KdTreeFLANN<pcl::PointXYZ> flann;
  flann.setInputCloud(cloud);

  NeighbourCosts costs{0.0, 0.0, map_points.size(), queries.size()};
  std::array<lio_mapper::IkdTree::Neighbour, kNeighbours> found;
  double sum = 0.0;
  double before_ms = cpu_ms();
  for (const Eigen::Vector3f& q : queries) {
    tree.nearest(q, 1e6F, found);
    sum += found.back().distance2_m2;
  }
  costs.ikd_ns = 1e6 * (cpu_ms() - before_ms) / static_cast<double>(queries.size());
  std::vector<int> indices(kNeighbours);
  std::vector<float> distances2(kNeighbours);
  before_ms = cpu_ms();
  for (const Eigen::Vector3f& q : queries) {
    flann.nearestKSearch({q.x(), q.y(), q.z()}, kNeighbours, indices, distances2);
    sum -= distances2.back();
  }
  costs.pcl_ns = 1e6 * (cpu_ms() - before_ms) / static_cast<double>(queries.size());
  std::printf("  (sum of differences to the fifth neighbour, ours and PCL's: %.3g m^2)\n", sum);
  return costs;
}

void print(const char* name, const Series& series, double reference_ms) {
  std::printf("  %-12s %8.3f %8.3f %8.3f %8.3f %8.2f\n",
              name,
              series.quantile(0.5),
              series.quantile(0.99),
              series.quantile(1.0),
              series.mean(),
              series.quantile(0.5) / reference_ms);
}

void print(const std::string& kind, const Result& result, double reference_ms) {
  std::printf("\n%s: %llu scans used, map %zu points, %.1f MB\n",
              kind.c_str(),
              static_cast<unsigned long long>(result.scans_used),
              result.map_points.size(),
              1e-6 * static_cast<double>(result.map_bytes));
  std::printf("  %-12s %8s %8s %8s %8s %8s\n", "ms of CPU", "p50", "p99", "max", "mean", "p50/ref");
  for (const auto& [stage, name] : kStages) {
    const auto series = result.stages.find(stage);
    if (series != result.stages.end()) {
      print(name, series->second, reference_ms);
    }
  }
  print("match+insert", result.match_and_insert, reference_ms);
  print("all", result.total, reference_ms);
}

int measure(const cli::InputOptions& options, const std::vector<std::string>& kinds) {
  const Series fixed = reference(options);
  const double reference_ms = fixed.quantile(0.5);
  std::printf("%s: %zu scans\n", options.log.c_str(), fixed.values.size());
  std::printf("reference (PCL VoxelGrid %.1f m + tree + 5 neighbours): p50 %.2f ms, p99 %.2f ms\n",
              kReferenceVoxel_m,
              reference_ms,
              fixed.quantile(0.99));
  std::map<std::string, Result> results;
  for (const std::string& kind : kinds) {
    results[kind] = run(options, kind);
    print(kind, results[kind], reference_ms);
  }
  if (results.contains("ikd_tree") && results.contains("surfel_map")) {
    const Result& ikd = results["ikd_tree"];
    const Result& surfel = results["surfel_map"];
    std::printf("\nikd_tree / surfel_map: match + insert %.2f, all %.2f, memory %.2f\n",
                ikd.match_and_insert.mean() / surfel.match_and_insert.mean(),
                ikd.total.mean() / surfel.total.mean(),
                static_cast<double>(ikd.map_bytes) / static_cast<double>(surfel.map_bytes));
    const Series ikd_alone = map_alone(options, "ikd_tree", surfel.scans_odom);
    const Series surfel_alone = map_alone(options, "surfel_map", surfel.scans_odom);
    std::printf(
        "the maps alone, a scan looked up and inserted: ikd_tree %.3f ms, surfel_map %.3f ms, "
        "ratio %.2f\n",
        ikd_alone.mean(),
        surfel_alone.mean(),
        ikd_alone.mean() / surfel_alone.mean());
  }
  if (results.contains("ikd_tree") && !results["ikd_tree"].map_points.empty()) {
    const NeighbourCosts costs = compare_neighbours(results["ikd_tree"].map_points);
    std::printf(
        "5 nearest of %zu points, %zu queries: ikd_tree %.0f ns, PCL KdTreeFLANN %.0f ns, "
        "ratio %.2f\n",
        costs.points,
        costs.queries,
        costs.ikd_ns,
        costs.pcl_ns,
        costs.ikd_ns / costs.pcl_ns);
  }
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app("What the mapper costs, stage by stage, with each local map");
  trigpoint::cli::InputOptions options;
  trigpoint::cli::add_input_options(app, options);
  std::vector<std::string> kinds{"surfel_map", "ikd_tree"};
  app.add_option("--map", kinds, "surfel_map, ikd_tree; both when left out");
  CLI11_PARSE(app, argc, argv);
  try {
    return measure(options, kinds);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "lio_benchmark: %s\n", error.what());
    return 1;
  }
}
