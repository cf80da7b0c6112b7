// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <functional>

namespace trigpoint::lio_mapper {

/// What the mapper is doing; for those who measure it.
enum class Stage : std::uint8_t {
  kOutside,  ///< nothing
  kDecode,
  kPredict,
  kUndistort,
  kDownsample,
  kMatch,
  kSolve,
  kInsert,
  kReport
};

/// Told when a stage begins, on the caller's thread; the one before ends with that.
using StageObserver = std::function<void(Stage)>;

}  // namespace trigpoint::lio_mapper
