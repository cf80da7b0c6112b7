// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/evaluation/comparison.hpp"

#include "gnuplot.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <sstream>

namespace trigpoint::evaluation {

namespace {

constexpr int kComparisonWidth_px = 1300;
constexpr std::array<const char*, 5> kColours{"#17853c",
                                              "#8e3fae",
                                              "#e8772e",
                                              "#1f6fbf",
                                              "#c02942"};

/// "withheld fixes" and "drive/truth.tum" as parts of file names.
std::string word_of(const std::string& name) {
  std::string word = name.substr(name.find_last_of('/') + 1);
  std::replace_if(
      word.begin(),
      word.end(),
      [](unsigned char c) { return std::isalnum(c) == 0 && c != '_'; },
      '_');
  return word;
}

std::string title_of(const std::string& name) {
  return name.substr(name.find_last_of('/') + 1);
}

/// A picture goes its own way, without the text that tells of this; empty when nothing is left out.
std::string left_out_of(const Comparison& comparison) {
  namespace file = exporter::session_file;
  std::string names;
  for (const char* name : {file::kFused,
                           file::kFusedSmoothed,
                           file::kLio,
                           file::kGps,
                           file::kTruth,
                           file::kFixes,
                           file::kConfig}) {
    const auto is_of = [&](const std::string& sentence) {
      return sentence.find("/" + std::string(name)) != std::string::npos;
    };
    if (std::any_of(comparison.damaged.begin(), comparison.damaged.end(), is_of)) {
      names += (names.empty() ? "" : ", ") + std::string(name);
    }
  }
  return names.empty() ? ""
                       : "set label 1 " + quoted("Left out, cannot be read: " + names) +
                             " at screen 0.012,0.012 noenhanced textcolor rgb '#c02942'\n";
}

/// The pairs of one estimate, aligned.
struct ComparedCurve {
  std::string title;
  std::string style;
  std::vector<PosePair> pairs;
};

std::vector<PosePair> thinned_pairs(const std::vector<PosePair>& pairs) {
  constexpr std::size_t kMost = 10'000;
  const std::size_t step = pairs.size() / kMost + 1;
  std::vector<PosePair> few;
  for (std::size_t i = 0; i < pairs.size(); i += step) {
    few.push_back(pairs[i]);
  }
  return few;
}

/// The first one is drawn last, over the others: it is the one that is published.
std::vector<ComparedCurve> curves_of(const ComparisonBlock& block, AlignmentKind kind) {
  std::vector<ComparedCurve> curves;
  std::size_t estimate = 0;
  for (const Compared& compared : block.compared) {
    // The same colour in every picture, also where another one is left out.
    const char* colour = kColours[estimate++ % kColours.size()];
    if (kind == AlignmentKind::kNone && !compared.is_in_reference_frame) {
      continue;
    }
    if (const auto T = align(compared.pairs, kind)) {
      curves.push_back({title_of(compared.evaluation.estimate_name),
                        std::string(" lw 1.8 lc rgb '") + colour + "'",
                        place_estimates(*T, thinned_pairs(compared.pairs))});
    }
  }
  std::reverse(curves.begin(), curves.end());
  return curves;
}

Nanoseconds begin_of(const std::vector<ComparedCurve>& curves) {
  Nanoseconds begin_ns = curves.front().pairs.front().stamp_ns;
  for (const ComparedCurve& curve : curves) {
    begin_ns = std::min(begin_ns, curve.pairs.front().stamp_ns);
  }
  return begin_ns;
}

std::string draw_errors(const ComparisonBlock& block,
                        AlignmentKind kind,
                        const std::string& left_out,
                        const std::string& folder,
                        const std::string& gnuplot) {
  const auto curves = curves_of(block, kind);
  if (curves.empty()) {
    return "";
  }
  const std::string name = "error_" + word_of(block.reference_name) +
                           (kind == AlignmentKind::kNone ? "_unaligned" : "_yaw_translation");
  const Picture picture(exporter::path_in(folder, "plots"), name);
  const Nanoseconds begin_ns = begin_of(curves);
  std::vector<std::string> files;
  for (const ComparedCurve& curve : curves) {
    DataFile rows;
    for (const PosePair& pair : curve.pairs) {
      const Eigen::Vector3d e = pair.estimate.p - pair.reference.p;
      rows.add({to_seconds(pair.stamp_ns - begin_ns), e.x(), e.y(), e.z(), e.norm()});
    }
    files.push_back(picture.data(name + "_" + word_of(curve.title) + ".dat", rows));
  }
  constexpr std::array<const char*, 4> kAxes{"x (E) [m]", "y (N) [m]", "z (U) [m]", "3-D [m]"};
  std::ostringstream body;
  body << "set multiplot layout 4,1 title "
       << quoted("Position error against " + title_of(block.reference_name) +
                 ", alignment: " + name_of(kind))
       << " noenhanced\n"
       << "set grid lc rgb '#cccccc'\nset tics out nomirror\nset lmargin 10\nset rmargin 3\n"
       << "set key outside top center horizontal noenhanced\n"
       << left_out;
  for (std::size_t axis = 0; axis < kAxes.size(); ++axis) {
    body << "set ylabel '" << kAxes[axis] << "'\n"
         << (axis + 1 == kAxes.size() ? "set xlabel 'time [s]'\nset yrange [0:*]\n" : "")
         << (axis == 1 ? "unset key\nunset label\n" : "") << "plot ";
    for (std::size_t i = 0; i < files.size(); ++i) {
      body << (i == 0 ? "" : ", ") << files[i] << " using 1:" << axis + 2 << " with lines"
           << curves[i].style << " title " << quoted(curves[i].title);
    }
    body << "\n";
  }
  body << "unset multiplot\n";
  return picture.draw(gnuplot, kComparisonWidth_px, 1100, body.str());
}

std::string draw_top_view(const ComparisonBlock& block,
                          const std::string& left_out,
                          const std::string& folder,
                          const std::string& gnuplot) {
  const auto curves = curves_of(block, AlignmentKind::kYawTranslation);
  if (curves.empty()) {
    return "";
  }
  const std::string name = "top_view_" + word_of(block.reference_name);
  const Picture picture(exporter::path_in(folder, "plots"), name);
  std::ostringstream body;
  body << "set title 'Top view, alignment: " << name_of(AlignmentKind::kYawTranslation)
       << "' noenhanced\nset xlabel 'x (E) [m]' offset 0,0.6\nset ylabel 'y (N) [m]'\nset size "
          "ratio -1\n"
       << "set grid lc rgb '#cccccc'\nset tics out nomirror\n"
       << "set key outside below center horizontal noenhanced\n"
       << left_out << "plot ";
  const auto longest =
      std::max_element(curves.begin(), curves.end(), [](const auto& a, const auto& b) {
        return a.pairs.size() < b.pairs.size();
      });
  DataFile reference;
  for (const PosePair& pair : longest->pairs) {
    reference.add({pair.reference.p.x(), pair.reference.p.y()});
  }
  const bool is_positions =
      block.compared.front().evaluation.reference_kind == ReferenceKind::kPositions;
  body << picture.data(name + "_reference.xy", reference) << " using 1:2 with "
       << (is_positions ? "points pt 6 ps 0.8" : "lines lw 7") << " lc rgb '#f2c230' title "
       << quoted(title_of(block.reference_name));
  for (std::size_t i = 0; i < curves.size(); ++i) {
    DataFile rows;
    for (const PosePair& pair : curves[i].pairs) {
      rows.add({pair.estimate.p.x(), pair.estimate.p.y()});
    }
    body << ", " << picture.data(name + "_" + word_of(curves[i].title) + ".xy", rows)
         << " using 1:2 with lines" << curves[i].style << " title " << quoted(curves[i].title);
  }
  body << "\n";
  return picture.draw(gnuplot, kComparisonWidth_px, 900, body.str());
}

}  // namespace

std::vector<std::string> draw(const Comparison& comparison,
                              const std::string& folder,
                              const std::string& gnuplot) {
  std::vector<std::string> pictures;
  const auto add = [&](const std::string& picture) {
    if (!picture.empty()) {
      pictures.push_back(picture);
    }
  };
  const std::string left_out = left_out_of(comparison);
  for (const ComparisonBlock& block : comparison.blocks) {
    add(draw_errors(block, AlignmentKind::kNone, left_out, folder, gnuplot));
    add(draw_errors(block, AlignmentKind::kYawTranslation, left_out, folder, gnuplot));
    add(draw_top_view(block, left_out, folder, gnuplot));
  }
  return pictures;
}

}  // namespace trigpoint::evaluation
