// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Datagrams larger than a frame travel in pieces. Of one lost piece the kernel keeps the others for
// 30 s, and once they take 4 MB it takes no more: then of all large datagrams none arrives.
#pragma once

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>

namespace trigpoint::cli {

/// Datagrams of this network namespace that the kernel gave up on, since it started, from the text
/// of /proc/net/snmp; nothing when it does not tell.
std::optional<std::int64_t> failed_reassemblies(std::istream& snmp);

/// The same, from the kernel.
std::optional<std::int64_t> failed_reassemblies();

/// What is wrong when `before` and `after` listening differ; empty when they do not or are not
/// known. What was sent up to 30 s before counts only when the kernel loses its patience.
std::string reassembly_advice(std::optional<std::int64_t> before,
                              std::optional<std::int64_t> after);

/// What is to be known, and no fault of now, when there were some before and none since; else
/// empty.
std::string past_reassembly_note(std::optional<std::int64_t> before,
                                 std::optional<std::int64_t> after);

}  // namespace trigpoint::cli
