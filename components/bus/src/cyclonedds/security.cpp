// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "security.hpp"

#include "../credentials.hpp"
#include <dlfcn.h>

#include <filesystem>
#include <string>

namespace trigpoint::bus::cyclonedds {

namespace {

/// Debian keeps the plugins in a folder of its own beside the library, where the loader does not
/// look; elsewhere it finds them by name.
std::string plugin_path(const std::string& name) {
  Dl_info library{};
  if (dladdr(reinterpret_cast<const void*>(&dds_create_participant), &library) != 0 &&
      library.dli_fname != nullptr) {
    const std::filesystem::path folder = std::filesystem::path(library.dli_fname).parent_path();
    const std::filesystem::path file = folder / "libddsc0debian" / ("lib" + name + ".so");
    if (std::filesystem::exists(file)) {
      return file.string();
    }
  }
  return name;
}

}  // namespace

void set_security(dds_qos_t* qos, const Config& config) {
  const auto credentials = credentials_of(config, "cyclonedds");
  if (!credentials) {
    return;
  }
  const auto set = [qos](const std::string& name, const std::string& value) {
    dds_qset_prop(qos, ("dds.sec." + name).c_str(), value.c_str());
  };
  const auto use_plugin =
      [&](const std::string& kind, const std::string& library, const std::string& functions) {
        set(kind + ".library.path", plugin_path(library));
        set(kind + ".library.init", "init_" + functions);
        set(kind + ".library.finalize", "finalize_" + functions);
      };
  use_plugin("auth", "dds_security_auth", "authentication");
  use_plugin("crypto", "dds_security_crypto", "crypto");
  use_plugin("access", "dds_security_ac", "access_control");
  set("auth.identity_ca", credentials->identity_ca);
  set("auth.identity_certificate", credentials->identity_certificate);
  set("auth.private_key", credentials->private_key);
  set("access.permissions_ca", credentials->permissions_ca);
  set("access.governance", credentials->governance);
  set("access.permissions", credentials->permissions);
}

}  // namespace trigpoint::bus::cyclonedds
