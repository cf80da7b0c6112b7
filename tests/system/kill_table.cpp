// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// kill_table: drives of three minutes, half of them indoors, in which every process is killed and
// stopped again and again; prints what came of every blow and of every drive. Exit code 1 when a
// bound is broken.
#include "kill_drive.hpp"
#include "run_command.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

namespace {

using namespace trigpoint::tests;

constexpr double kDuration_s = 180.0;
constexpr double kApart_s = 20.0;  ///< between two blows, at least
constexpr double kFirst_s = 13.0;  ///< of a drive: odom has begun and is aligned
constexpr int kBlowsInADrive = 8;
constexpr double kErrorFactor = 1.2;
constexpr double kErrorMore_m = 0.05;
constexpr double kFullMap = 0.95;  ///< of the undisturbed run's points

/// Three kills, then a stop: in ten drives 20 kills of each process, 10 pauses and 10 hangs.
Blow blow_of(int number, double at_s) {
  const std::array<std::string, 3> processes{kMapper, kGate, kFilter};
  const auto process = [&](int n) { return processes[static_cast<std::size_t>(n % 3)]; };
  if (number % 4 == 3) {
    const int stop = number / 4;
    return {at_s, process(stop / 2), stop % 2 == 0 ? Kind::kPause : Kind::kHang};
  }
  return {at_s, process(number - number / 4), Kind::kKill};
}

std::vector<Blow> blows_of(int drive) {
  std::vector<Blow> blows;
  const double first_s = kFirst_s + std::fmod(1.7 * drive, 6.0);
  for (int k = 0; k < kBlowsInADrive; ++k) {
    blows.push_back(blow_of(drive * kBlowsInADrive + k, first_s + kApart_s * k));
  }
  return blows;
}

class Table {
 public:
  explicit Table(std::string folder) : folder_(std::move(folder)) {}

  void run(int number) {
    const bool indoors = number % 2 == 1;
    DriveSettings settings;
    settings.scenario = indoors ? "indoor_60" : "campus_twice";
    settings.seed = 1 + number / 2;
    settings.duration_s = kDuration_s;
    settings.domain = own_domain(number);
    settings.session = folder_ + "/undisturbed-" + std::to_string(number);
    settings.rate = "max";
    const DriveResult undisturbed = drive(settings, {});
    settings.session = folder_ + "/drive-" + std::to_string(number);
    settings.rate = "1";
    const DriveResult result = drive(settings, blows_of(number));
    std::printf("\ndrive %d: %s, seed %d\n", number, settings.scenario.c_str(), settings.seed);
    print_blows(result);
    print_drive(undisturbed, result);
    std::fflush(stdout);
  }

  int summary() const {
    std::printf("\n%d blows, %d kills; longest pick-up %.2f s; %d bounds broken\n",
                blows_,
                kills_,
                longest_pick_up_s_,
                broken_);
    return broken_ == 0 ? 0 : 1;
  }

 private:
  const char* bound(bool held) {
    broken_ += held ? 0 : 1;
    return held ? "" : "  BROKEN";
  }

  void print_blows(const DriveResult& result) {
    std::printf("  %6s  %-22s %-11s %9s %9s %12s %13s\n",
                "at s",
                "process",
                "blow",
                "down s",
                "pick-up s",
                "others gap s",
                "worst after m");
    for (const BlowResult& one : result.blows) {
      ++blows_;
      kills_ += one.blow.kind == Kind::kKill ? 1 : 0;
      longest_pick_up_s_ = std::max(longest_pick_up_s_, one.pick_up_s);
      std::printf("  %6.1f  %-22s %-11s %9.2f %9.2f %12.2f %13.2f%s\n",
                  one.blow.at_s,
                  one.blow.process.c_str(),
                  name_of(one.blow.kind),
                  one.down_s,
                  one.pick_up_s,
                  one.others_gap_s,
                  one.worst_after_m,
                  bound(held(one)));
    }
  }

  void print_drive(const DriveResult& undisturbed, const DriveResult& result) {
    const double limit_m = kErrorFactor * undisturbed.rmse_m + kErrorMore_m;
    std::printf("  exit code %d%s\n", result.exit_code, bound(result.exit_code == 0));
    std::printf(
        "  error of fused.tum: rmse %.3f m, undisturbed %.3f m, at most %.3f m%s; worst %.3f m, "
        "undisturbed %.3f m\n",
        result.rmse_m,
        undisturbed.rmse_m,
        limit_m,
        bound(result.rmse_m <= limit_m),
        result.worst_m,
        undisturbed.worst_m);
    std::printf(
        "  error of fused_smoothed.tum: rmse %.3f m, undisturbed %.3f m%s\n",
        result.smoothed_rmse_m,
        undisturbed.smoothed_rmse_m,
        bound(result.smoothed_rmse_m <= kErrorFactor * undisturbed.smoothed_rmse_m + kErrorMore_m));
    const auto full = static_cast<double>(undisturbed.map_points);
    std::printf("  map: %llu points, undisturbed %llu%s\n",
                static_cast<unsigned long long>(result.map_points),
                static_cast<unsigned long long>(undisturbed.map_points),
                bound(static_cast<double>(result.map_points) >= kFullMap * full));
    const double least_s = least_covered_s(undisturbed.covered_s, result.blows);
    std::printf("  fused.tum covers %.1f of %.1f s, undisturbed %.1f s, at least %.1f s%s\n",
                result.covered_s,
                result.truth_s,
                undisturbed.covered_s,
                least_s,
                bound(undisturbed.covered_s > 0.0 && result.covered_s >= least_s));
    std::printf("  scans: %llu played, %llu missed, %llu listed as missed%s\n",
                static_cast<unsigned long long>(result.scans_played),
                static_cast<unsigned long long>(missed_scans(result)),
                static_cast<unsigned long long>(result.scans_listed),
                bound(missed_scans_are_listed(result)));
    std::printf("  left in shared memory: %zu files%s\n",
                result.left_in_shared_memory.size(),
                bound(result.left_in_shared_memory.empty()));
  }

  std::string folder_;
  int blows_{0};
  int kills_{0};
  double longest_pick_up_s_{0.0};
  int broken_{0};
};

}  // namespace

int main(int argc, char** argv) {
  int drives = 10;
  int first = 0;
  std::string folder;
  for (int i = 1; i + 1 < argc; i += 2) {
    if (std::strcmp(argv[i], "--drives") == 0) {
      drives = std::atoi(argv[i + 1]);
    } else if (std::strcmp(argv[i], "--first") == 0) {
      first = std::atoi(argv[i + 1]);
    } else if (std::strcmp(argv[i], "--keep") == 0) {
      folder = argv[i + 1];
    }
  }
  if (argc % 2 == 0 || drives < 1) {
    std::fprintf(stderr,
                 "usage: kill_table [--drives N] [--first N] [--keep FOLDER]\n"
                 "10 drives of 3 minutes in real time, numbers 0 to 9 (odd ones indoors); about 50 "
                 "minutes. Sessions stay in FOLDER.\n");
    return 2;
  }
  const TemporaryFolder temporary;
  if (folder.empty()) {
    folder = temporary.path();
  }
  std::filesystem::create_directories(folder);
  Table table(folder);
  for (int number = first; number < first + drives; ++number) {
    table.run(number);
  }
  return table.summary();
}
