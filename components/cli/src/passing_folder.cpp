// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "passing_folder.hpp"

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace trigpoint::cli {

PassingFolder::PassingFolder()
    : path_((std::filesystem::temp_directory_path() / "trigpoint-XXXXXX").string()) {
  if (::mkdtemp(path_.data()) == nullptr) {
    throw std::runtime_error(path_ + ": cannot make the folder: " + std::strerror(errno));
  }
}

PassingFolder::~PassingFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

}  // namespace trigpoint::cli
