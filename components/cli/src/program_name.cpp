// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "program_name.hpp"

#include <filesystem>
#include <fstream>

namespace trigpoint::cli {

std::string program_of(unsigned number) {
  std::ifstream file("/proc/" + std::to_string(number) + "/cmdline", std::ios::binary);
  std::string program;
  std::getline(file, program, '\0');
  return std::filesystem::path(program).filename().string();
}

}  // namespace trigpoint::cli
