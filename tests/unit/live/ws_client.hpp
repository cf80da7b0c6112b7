// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A WebSocket client that waits a bounded time for everything.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

namespace trigpoint::live::test {

struct Received {
  bool text{false};
  std::string bytes;
};

class WsClient {
 public:
  /// Throws std::runtime_error when the server refuses or nobody is there.
  WsClient(std::uint16_t port, const std::string& subprotocol);
  ~WsClient();

  std::string subprotocol() const;
  void send_text(const std::string& text);
  /// Nothing when the connection ended or `limit_ms` passed; then the client is of no more use.
  std::optional<Received> receive(int limit_ms = 20000);
  /// The next message of data, other ones left out.
  std::optional<Received> receive_data(int limit_ms = 20000);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

/// The whole answer to a request as it stands, for what a WebSocket client does not say.
std::string http(std::uint16_t port, const std::string& request);

}  // namespace trigpoint::live::test
