// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "credentials.hpp"

#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace trigpoint::bus {

std::optional<Credentials> credentials_of(const Config& config, const std::string& vendor) {
  if (config.security_folder.empty()) {
    return std::nullopt;
  }
  const std::filesystem::path folder = std::filesystem::absolute(config.security_folder);
  const auto address = [&](const std::string& name) {
    const std::string file = (folder / name).string();
    if (!std::ifstream(file)) {
      throw std::runtime_error("bus.security_folder: cannot read " + file +
                               "; bringup/make-credentials makes it, readable for its owner only");
    }
    return "file://" + file;
  };
  return Credentials{address("identity_ca.cert.pem"),
                     address(vendor + ".cert.pem"),
                     address(vendor + ".key.pem"),
                     address("permissions_ca.cert.pem"),
                     address("governance.p7s"),
                     address("permissions.p7s")};
}

}  // namespace trigpoint::bus
