// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace trigpoint::simulator {

/// Makers by the name that a scenario file uses.
template <typename Interface>
using Registry = std::map<std::string, std::function<std::shared_ptr<Interface>()>>;

template <typename Interface>
std::vector<std::string> names_of(const Registry<Interface>& registry) {
  std::vector<std::string> names;
  for (const auto& [name, make] : registry) {
    names.push_back(name);
  }
  return names;
}

}  // namespace trigpoint::simulator
