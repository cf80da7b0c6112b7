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

std::string owner_text(std::optional<unsigned> process, const std::string& guid) {
  const std::string program = process ? program_of(*process) : "";
  return program.starts_with("trigpoint") ? program + " (process " + std::to_string(*process) + ")"
                                          : "participant " + guid.substr(0, 24);
}

}  // namespace trigpoint::cli
