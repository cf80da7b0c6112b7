// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/simulator/simulator.hpp"

#include <cstdio>
#include <fstream>
#include <stdexcept>

namespace trigpoint::simulator {

namespace {

/// Nine decimals of a stamp do not fit a double: the integer is printed.
std::string line_of(Nanoseconds stamp_ns, const Pose& pose) {
  char text[320];
  std::snprintf(text,
                sizeof text,
                "%lld.%09lld %.6f %.6f %.6f %.9f %.9f %.9f %.9f\n",
                static_cast<long long>(stamp_ns / kNanosecondsPerSecond),
                static_cast<long long>(stamp_ns % kNanosecondsPerSecond),
                pose.p.x(),
                pose.p.y(),
                pose.p.z(),
                pose.q.x(),
                pose.q.y(),
                pose.q.z(),
                pose.q.w());
  return text;
}

}  // namespace

void write_truth(const Truth& truth, const Datum& datum, const std::string& path, double rate_hz) {
  std::ofstream file(path);
  file << "# truth of a simulated drive: base_link in map (ENU at the datum), stamp x y z qx qy qz "
          "qw\n"
       << "# datum " << datum.id()
       << "  # latitude (deg) longitude (deg) height above WGS 84 (m)\n";
  for (std::int64_t i = 0;; ++i) {
    const Nanoseconds stamp_ns = truth.first_ns() + from_seconds(static_cast<double>(i) / rate_hz);
    if (stamp_ns > truth.last_ns()) {
      break;
    }
    file << line_of(stamp_ns, truth.at(stamp_ns).T_map_base);
  }
  file.close();
  if (!file) {
    throw std::runtime_error(
        path + ": the truth cannot be written (does the folder exist, is the disk full?)");
  }
}

}  // namespace trigpoint::simulator
