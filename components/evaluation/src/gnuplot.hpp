// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <Eigen/Core>

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// Rows of numbers as gnuplot reads them; a row with a number that is not finite becomes a blank
/// line, which breaks a curve.
class DataFile {
 public:
  void add(const std::vector<double>& row);

  const std::string& text() const { return text_; }

  bool is_empty() const { return rows_ == 0; }

 private:
  std::string text_;
  std::size_t rows_{0};
};

/// Text as gnuplot reads it between single quotes, with these.
std::string quoted(const std::string& text);

/// A picture in the making: script and data go into `folder` (so that a user can run it again:
/// `cd plots && gnuplot NAME.gp`), the PNG beside that folder.
class Picture {
 public:
  Picture(const std::string& folder, const std::string& name);

  /// Writes a data file; returns its name for the script, already quoted.
  std::string data(const std::string& name, const DataFile& data) const;
  std::string data(const std::string& name, const std::string& bytes) const;

  /// Runs gnuplot on terminal set-up + `body`. Returns the PNG's path. Throws std::runtime_error
  /// when the program is missing (saying what to install) or fails (with what it said).
  std::string draw(const std::string& gnuplot,
                   int width_px,
                   int height_px,
                   const std::string& body) const;

 private:
  std::string folder_;
  std::string name_;
};

}  // namespace trigpoint::evaluation
