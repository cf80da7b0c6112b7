// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/lio_mapper/cloud_decoder.hpp"

#include "sweep.hpp"

#include <variant>

namespace trigpoint::lio_mapper {

struct DecodedCloud::Content {
  Nanoseconds stamp_ns{0};  ///< of the cloud
  std::variant<Sweep, SweepRefusal> sweep;
  Events events;
};

}  // namespace trigpoint::lio_mapper
