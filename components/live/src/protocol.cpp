// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "protocol.hpp"

#include "trigpoint/bus/message_definition.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <limits>
#include <span>
#include <stdexcept>
#include <utility>

namespace trigpoint::live {

namespace {

using nlohmann::json;

constexpr std::uint8_t kMessageData = 0x01;
constexpr std::uint8_t kTime = 0x02;

void put_little_endian(std::span<std::uint8_t> to, std::uint64_t value) {
  for (std::uint8_t& byte : to) {
    byte = static_cast<std::uint8_t>(value & 0xffU);
    value >>= 8U;
  }
}

ClientMessage complain(const std::string& text) {
  ClientMessage message;
  message.complaint = text;
  return message;
}

std::optional<std::uint32_t> number_of(const json& value) {
  if (!value.is_number_unsigned() ||
      value.get<std::uint64_t>() > std::numeric_limits<std::uint32_t>::max()) {
    return std::nullopt;
  }
  return value.get<std::uint32_t>();
}

/// Null where there is none.
const json& member(const json& object, const char* key) {
  static const json none;
  const auto found = object.is_object() ? object.find(key) : object.end();
  return object.is_object() && found != object.end() ? *found : none;
}

ClientMessage subscriptions_of(const json& message) {
  ClientMessage parsed;
  for (const json& entry : member(message, "subscriptions")) {
    const auto id = number_of(member(entry, "id"));
    const auto channel = number_of(member(entry, "channelId"));
    if (!id || !channel) {
      return complain("subscribe: every subscription needs the numbers id and channelId");
    }
    parsed.subscribe.push_back({*id, *channel});
  }
  return parsed;
}

ClientMessage ended_of(const json& message) {
  ClientMessage parsed;
  for (const json& entry : member(message, "subscriptionIds")) {
    const auto id = number_of(entry);
    if (!id) {
      return complain("unsubscribe: subscriptionIds must be numbers");
    }
    parsed.unsubscribe.push_back(*id);
  }
  return parsed;
}

/// What newer clients say by themselves and expect no answer to.
bool needs_no_answer(const std::string& op) {
  return op == "clientInfo";
}

}  // namespace

std::optional<std::string> choose_subprotocol(std::string_view offered) {
  while (!offered.empty()) {
    const std::size_t comma = offered.find(',');
    std::string_view name = offered.substr(0, comma);
    name.remove_prefix(std::min(name.find_first_not_of(" \t"), name.size()));
    name = name.substr(0, name.find_first_of(" \t"));
    if (name == "foxglove.websocket.v1" || name == "foxglove.sdk.v1") {
      return std::string(name);
    }
    offered = comma == std::string_view::npos ? std::string_view() : offered.substr(comma + 1);
  }
  return std::nullopt;
}

ClientMessage parse_client_message(std::string_view text) {
  const json message = json::parse(text, nullptr, false);
  const json& op = member(message, "op");
  if (!op.is_string()) {
    return complain("a message must be a JSON object with the string op");
  }
  const std::string name = op.get<std::string>();
  if (name == "subscribe") {
    return subscriptions_of(message);
  }
  if (name == "unsubscribe") {
    return ended_of(message);
  }
  return needs_no_answer(name) ? ClientMessage{}
                               : complain(
                                     "this server only shows data: it takes subscribe and "
                                     "unsubscribe, no other op");
}

std::string server_info_json(const std::string& session_id) {
  return json{{"op", "serverInfo"},
              {"name", "trigpoint live"},
              {"capabilities", json::array({"time"})},
              {"metadata", {{"units", "SI, radians; frames map (ENU), odom, base_link"}}},
              {"sessionId", session_id}}
      .dump();
}

std::string advertise_json(const std::vector<Channel>& channels) {
  json list = json::array();
  for (std::size_t id = 0; id < channels.size(); ++id) {
    list.push_back({{"id", id},
                    {"topic", channels[id].topic},
                    {"encoding", "cdr"},
                    {"schemaName", channels[id].schema_name},
                    {"schema", bus::message_definition(channels[id].schema_name)},
                    {"schemaEncoding", "ros2msg"}});
  }
  return json{{"op", "advertise"}, {"channels", std::move(list)}}.dump();
}

std::string warning_json(const std::string& text) {
  return json{{"op", "status"}, {"level", 1}, {"message", text}}.dump();
}

Frame text_frame(const std::string& text) {
  Frame frame;
  frame.payload = std::make_shared<const Bytes>(text.begin(), text.end());
  frame.text = true;
  return frame;
}

Frame data_frame(std::uint32_t subscription, Nanoseconds stamp_ns, Payload cdr) {
  Frame frame;
  const std::span<std::uint8_t> header(frame.header);
  header[0] = kMessageData;
  put_little_endian(header.subspan(1, 4), subscription);
  put_little_endian(header.subspan(5, 8), static_cast<std::uint64_t>(stamp_ns));
  frame.header_bytes = 13;
  frame.payload = std::move(cdr);
  frame.stream = subscription;
  return frame;
}

Frame time_frame(Nanoseconds now_ns) {
  Frame frame;
  const std::span<std::uint8_t> header(frame.header);
  header[0] = kTime;
  put_little_endian(header.subspan(1, 8), static_cast<std::uint64_t>(now_ns));
  frame.header_bytes = 9;
  frame.stream = kTimeStream;
  return frame;
}

}  // namespace trigpoint::live
