// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"
#include "trigpoint/evaluation/gps_page.hpp"
#include "trigpoint/gps_odometry/gps_odometry.hpp"
#include "trigpoint/simulator/simulator.hpp"

#include "input.hpp"
#include "number_checks.hpp"
#include "verbs.hpp"

#include <array>
#include <filesystem>
#include <iostream>
#include <memory>
#include <variant>

namespace trigpoint::cli {

namespace {

constexpr std::array<const char*, 3> kFilters{"ekf15", "eskf18", "ekf15_strict"};

struct GpsPlotOptions {
  std::string scenario{"open_sky"};
  std::uint64_t seed{1};
  double outage_from_s{120.0};
  double outage_s{30.0};
  double around_s{30.0};
  std::string out;
};

/// One filter on the scenario, its fixes cut out during the outage.
evaluation::FilterErrors drive(const simulator::Scenario& scenario,
                               const GpsPlotOptions& options,
                               const std::string& name) {
  const double end_s = options.outage_from_s + options.outage_s + options.around_s;
  simulator::StreamOptions stream;
  stream.lidar = false;
  const auto reader = simulator::open_scenario(scenario, options.seed, end_s, stream);
  const auto truth = reader->truth();
  const auto time_s = [&](Nanoseconds stamp_ns) {
    return to_seconds(stamp_ns - scenario.start_ns());
  };
  gps_odometry::Config config;
  config.filter = name;
  gps_odometry::GpsOdometry filter(config, scenario.robot);
  filter.on_datum(scenario.datum);
  evaluation::FilterErrors errors{name, {}};
  while (const auto entry = reader->next()) {
    gps_odometry::Output output;
    if (const auto* imu = std::get_if<ImuSample>(&entry->measurement)) {
      output = filter.on_imu(*imu);
    } else if (const auto* fix = std::get_if<GnssFix>(&entry->measurement)) {
      const double since_s = time_s(fix->stamp_ns) - options.outage_from_s;
      if (since_s < 0.0 || since_s > options.outage_s) {
        output = filter.on_fix(*fix);
      }
    }
    if (!output.odometry ||
        time_s(output.odometry->stamp_ns) < options.outage_from_s - options.around_s) {
      continue;
    }
    const Odometry& odometry = *output.odometry;
    errors.samples.push_back(
        {time_s(odometry.stamp_ns),
         odometry.T_frame_child.p - truth->at(odometry.stamp_ns).T_map_base.p,
         odometry.pose_covariance.diagonal().head<3>().cwiseMax(0.0).cwiseSqrt()});
  }
  return errors;
}

int run(const GpsPlotOptions& options) {
  refuse_used_folder(options.out);
  if (std::filesystem::exists(std::filesystem::path(options.out) / "index.html")) {
    throw ConfigError("gps-plots: " + options.out +
                      " has an index.html already; expected a new folder for --out.");
  }
  scenario_duration_s(options.outage_from_s + options.outage_s + options.around_s,
                      "--outage-from, --outage and --around together");
  const simulator::Scenario scenario = simulator::load_scenario(options.scenario);
  evaluation::GpsPage page;
  page.title =
      "GPS filters through an outage: " + scenario.name + ", seed " + std::to_string(options.seed);
  page.outage_from_s = options.outage_from_s;
  page.outage_to_s = options.outage_from_s + options.outage_s;
  for (const char* name : kFilters) {
    page.filters.push_back(drive(scenario, options, name));
  }
  std::cout << evaluation::draw_gps_page(page, options.out) << "\n";
  return 0;
}

}  // namespace

void add_gps_plots(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "gps-plots",
      "A page of pictures: error and 3 sigma of ekf15, eskf18 and the published filter "
      "(ekf15_strict) through an outage of a simulated drive");
  const auto options = std::make_shared<GpsPlotOptions>();
  verb->add_option("--scenario", options->scenario, "a .yaml file, or the name of a shipped one")
      ->capture_default_str();
  verb->add_option("--seed", options->seed, "of the world and of the noise")
      ->check(whole_number())
      ->capture_default_str();
  verb->add_option("--outage-from", options->outage_from_s, "s after the start")
      ->check(more_than_zero())
      ->capture_default_str();
  verb->add_option("--outage", options->outage_s, "s without fixes")
      ->check(more_than_zero())
      ->capture_default_str();
  verb->add_option("--around", options->around_s, "s shown before and after it")
      ->check(more_than_zero())
      ->capture_default_str();
  verb->add_option("--out", options->out, "folder, created when missing")->required();
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
