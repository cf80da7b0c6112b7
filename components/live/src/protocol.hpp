// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The messages of the Foxglove WebSocket protocol, version 1, as far as a server uses them that
// only shows data: github.com/foxglove/ws-protocol, docs/spec.md. Integers are little-endian.
#pragma once

#include "trigpoint/base/time.hpp"
#include "trigpoint/live/live_server.hpp"

#include "outbox.hpp"

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace trigpoint::live {

struct Subscription {
  std::uint32_t id{0};       ///< the client's choice
  std::uint32_t channel{0};  ///< ours
};

/// What a client asks for. When `complaint` is not empty, nothing else is.
struct ClientMessage {
  std::vector<Subscription> subscribe;
  std::vector<std::uint32_t> unsubscribe;
  std::string complaint;
};

/// Of what the client offers ("a, b") the first that we speak: both names mean this protocol.
std::optional<std::string> choose_subprotocol(std::string_view offered);

/// Any bytes; never throws.
ClientMessage parse_client_message(std::string_view json);

std::string server_info_json(const std::string& session_id);
/// With each channel's schema. Throws std::runtime_error for one that is not known.
std::string advertise_json(const std::vector<Channel>& channels);
std::string warning_json(const std::string& text);

Frame text_frame(const std::string& json);
Frame data_frame(std::uint32_t subscription, Nanoseconds stamp_ns, Payload cdr);
Frame time_frame(Nanoseconds now_ns);

}  // namespace trigpoint::live
