// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "faults/gps_urban.hpp"

#include "faults/gps_nlos.hpp"

#include <array>
#include <cstdint>

namespace trigpoint::simulator {

namespace {

/// One kind of interval: how long it lasts, and its weight among those that may come next.
struct Dwell {
  const char* gnss_class;
  double shortest_s;
  double longest_s;
  double weight;
};

// research/gps C7, "urban dwell". Of the time, 55, 25, 12 and 8 % are meant. The next kind always
// differs from the last; with weights a_i and A their sum, kind i is then entered in a share
// pi_i = a_i (A - a_i) / sum_k a_k (A - a_k) of all changes, and these weights make
// pi_i * (mean dwell of i) stand in the ratio of the shares of time.
constexpr std::array<Dwell, 4> kDwells{{
    {"fixed", 20.0, 60.0, 0.348728},
    {"float", 10.0, 25.0, 0.373669},
    {"code", 5.0, 15.0, 0.281214},
    {"none", 4.0, 16.0, 0.165943},
}};
constexpr std::size_t kFixed = 0;
constexpr std::size_t kCode = 2;
constexpr double kWrongFixLowest_m = 0.4;
constexpr double kWrongFixHighest_m = 1.6;
constexpr double kNlosLowest_m = 3.0;
constexpr double kNlosHighest_m = 12.0;
constexpr double kNlosVerticalRatio = 0.8;

std::size_t next_after(std::size_t current, Random& random) {
  double sum = 0.0;
  for (std::size_t i = 0; i < kDwells.size(); ++i) {
    sum += i == current ? 0.0 : kDwells[i].weight;
  }
  double rest = random.uniform(0.0, sum);
  std::size_t next = current;
  for (std::size_t i = 0; i < kDwells.size(); ++i) {
    if (i == current) {
      continue;
    }
    next = i;
    rest -= kDwells[i].weight;
    if (rest < 0.0) {
      break;
    }
  }
  return next;
}

struct Interval {
  std::size_t kind{kFixed};
  std::uint64_t number{0};
};

/// Walks from the start: the same draws give the same intervals at every moment.
Interval interval_at(double t_s, Random& random) {
  Interval interval;
  while (true) {
    const Dwell& dwell = kDwells[interval.kind];
    t_s -= random.uniform(dwell.shortest_s, dwell.longest_s);
    if (t_s < 0.0) {
      return interval;
    }
    interval.kind = next_after(interval.kind, random);
    ++interval.number;
  }
}

}  // namespace

void GpsUrban::describe(ConfigFields& fields) {
  fields.flag("silent", silent_, "without a solution: no message (true) or status no fix (false)");
  fields.number("wrong_fix_share",
                wrong_fix_share_,
                "of fixed intervals after another kind: 0.4 to 1.6 m off",
                {0.0, 1.0});
  fields.number(
      "nlos_share", nlos_share_, "of code intervals: 3 to 12 m off horizontally", {0.0, 1.0});
}

void GpsUrban::on_gnss(GnssEpoch& epoch, const FaultMoment& moment) const {
  const auto [kind, number] = interval_at(moment.since_start_s, moment.whole);
  epoch.gnss_class = kDwells[kind].gnss_class;
  epoch.lost = epoch.lost || (silent_ && epoch.gnss_class == "none");
  Random interval(derive_seed(moment.seed, number));
  if (kind == kFixed && number > 0 && interval.chance(wrong_fix_share_)) {
    epoch.extra_error_m += interval.level_vector(kWrongFixLowest_m, kWrongFixHighest_m);
  } else if (kind == kCode && interval.chance(nlos_share_)) {
    epoch.extra_error_m += nlos_error(kNlosLowest_m, kNlosHighest_m, kNlosVerticalRatio, interval);
  }
}

}  // namespace trigpoint::simulator
