// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::cli {

/// A folder among the system's temporary ones that goes with this object, with all that is in it:
/// for the truth of a scenario whose session has one already, to which it is appended from there.
class PassingFolder {
 public:
  /// Throws std::runtime_error when it cannot be made.
  PassingFolder();
  ~PassingFolder();
  PassingFolder(const PassingFolder&) = delete;
  PassingFolder& operator=(const PassingFolder&) = delete;

  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace trigpoint::cli
