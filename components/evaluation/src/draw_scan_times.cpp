// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gnuplot.hpp"
#include "pictures.hpp"

#include <sstream>
#include <stdexcept>

namespace trigpoint::evaluation {

std::string draw_scan_times(const SessionData& data, const std::string& gnuplot) {
  const Picture picture(data.path(exporter::session_file::kPlots), "scan_times");
  DataFile rows;
  for (const auto& scan : data.scans) {
    rows.add({seconds_since(data.scans.front().status.stamp_ns, scan.status.stamp_ns),
              scan.status.scan_ms,
              static_cast<double>(scan.points)});
  }
  if (rows.is_empty()) {
    throw std::runtime_error("scan_times.png: there is no scan to draw");
  }
  const auto quoted = picture.data("scans.dat", rows);
  std::ostringstream body;
  body << "set title 'Processing time of each scan'\nset xlabel 'time [s]'\nset ylabel 'ms'\n"
       << "set y2label 'points'\nset ytics nomirror\nset y2tics\nset grid\nset key outside below "
          "center horizontal\n"
       << "set yrange [0:*]\nset y2range [0:*]\n"
       << "plot " << quoted << " using 1:3 axes x1y2 with lines lc rgb '#bbbbbb' title 'points', "
       << quoted << " using 1:2 with lines lw 1.5 lc rgb '#1f6fbf' title 'scan'\n";
  return picture.draw(gnuplot, 1300, 420, body.str());
}

}  // namespace trigpoint::evaluation
