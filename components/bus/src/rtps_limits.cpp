// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rtps_limits.hpp"

#include "rtps_submessages.hpp"

#include <cstddef>

namespace trigpoint::bus {

bool announces_more_than(std::span<const std::uint8_t> datagram, std::int64_t most_bytes) {
  constexpr std::size_t kSampleSizeAt = 32;  // in a DATA_FRAG submessage with its header
  bool is_more = false;
  visit_submessages(datagram, [&](const Submessage& part) {
    is_more = part.kind == Submessage::kDataFragment &&
              std::int64_t{part.word_at(kSampleSizeAt).value_or(0)} > most_bytes;
    return !is_more;
  });
  return is_more;
}

}  // namespace trigpoint::bus
