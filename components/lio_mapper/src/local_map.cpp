// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "local_map.hpp"

namespace trigpoint::lio_mapper {

std::unique_ptr<LocalMap> make_local_map(const LocalMapConfig& config) {
  return config.kind == "ikd_tree" ? make_ikd_map(config.ikd) : make_surfel_map(config.surfel);
}

}  // namespace trigpoint::lio_mapper
