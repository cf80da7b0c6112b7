// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Quality of service, with the names and values of ROS 2's profiles.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace trigpoint::bus {

enum class Reliability : std::uint8_t { kBestEffort, kReliable };
enum class Durability : std::uint8_t { kVolatile, kTransientLocal };

/// History is always KEEP_LAST. Depth is a matter of each side alone: it never prevents a match.
struct Qos {
  Reliability reliability{Reliability::kReliable};
  Durability durability{Durability::kVolatile};
  int depth{10};
  /// Samples of hundreds of kilobytes: sent in paced portions when socket buffers are small.
  bool bulk{false};

  constexpr Qos with_depth(int samples) const {
    Qos changed = *this;
    changed.depth = samples;
    return changed;
  }

  constexpr Qos as_bulk() const {
    Qos changed = *this;
    changed.bulk = true;
    return changed;
  }
};

namespace qos {
inline constexpr Qos kDefault{};
inline constexpr Qos kSensorData{Reliability::kBestEffort, Durability::kVolatile, 5};
/// "Latched": the newest sample waits for late joiners as long as its writer lives.
inline constexpr Qos kTransientLocal{Reliability::kReliable, Durability::kTransientLocal, 1};
inline constexpr Qos kTf{Reliability::kReliable, Durability::kVolatile, 100};
inline constexpr Qos kTfStatic = kTransientLocal;
inline constexpr Qos kClock = kDefault;
}  // namespace qos

/// A topic by its ROS name (without leading slash), its generated type and its QoS.
template <class T>
struct Topic {
  using Message = T;
  std::string_view name;
  Qos qos{};

  /// The name on the wire: "rt/" + name.
  std::string dds_name() const {
    const std::size_t slash = name.starts_with('/') ? 1 : 0;
    return "rt/" + std::string(name.substr(slash));
  }

  /// The same type and QoS under a configured name; `other` must outlive the returned value.
  constexpr Topic renamed(std::string_view other) const { return {other, qos}; }
};

}  // namespace trigpoint::bus
