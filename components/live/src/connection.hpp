// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// One client: HTTP first, and when it asks for it the Foxglove protocol over WebSocket. All of it
// runs on the server's thread.
#pragma once

#include "trigpoint/live/live_server.hpp"

#include "outbox.hpp"
#include "protocol.hpp"
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/http.hpp>
#include <boost/beast/websocket.hpp>

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>

namespace trigpoint::live {

class Connection;

/// What a connection asks of its server.
class Hub {
 public:
  virtual ~Hub() = default;
  virtual const std::string& server_info() const = 0;
  virtual const std::string& advertisement() const = 0;
  virtual const std::vector<Channel>& channels() const = 0;
  virtual void joined(const std::shared_ptr<Connection>& client) = 0;
  virtual void left(Connection& connection) = 0;
  virtual void subscribed(Connection& client, std::size_t channel) = 0;
  virtual void unsubscribed(std::size_t channel) = 0;
  virtual void count(std::uint64_t sent, std::uint64_t dropped) = 0;
};

class Connection : public std::enable_shared_from_this<Connection> {
 public:
  Connection(boost::asio::ip::tcp::socket socket, std::size_t max_queued_bytes, Hub& hub);

  void start();
  /// Nothing happens when the client has not subscribed to the channel.
  void send(std::size_t channel, Nanoseconds stamp_ns, const Payload& cdr);
  void send_time(Nanoseconds now_ns);
  void close();

 private:
  using Error = boost::beast::error_code;
  using Request = boost::beast::http::request<boost::beast::http::string_body>;
  using Parser = boost::beast::http::request_parser<boost::beast::http::string_body>;

  void on_request(Error error);
  void upgrade(const Request& request);
  void on_upgraded(Error error);
  void respond(boost::beast::http::status status, const char* type, std::string_view body);
  void read();
  void on_message(Error error);
  void take(const ClientMessage& message);
  void subscribe(const Subscription& subscription);
  void unsubscribe(std::uint32_t id);
  void complain(const std::string& text);
  void write_next();
  void on_written(Error error);

  Hub& hub_;
  boost::beast::websocket::stream<boost::beast::tcp_stream> stream_;
  boost::beast::flat_buffer buffer_;
  std::optional<Parser> parser_;
  boost::beast::http::response<boost::beast::http::string_body> response_;
  Outbox outbox_;
  Frame current_;  ///< being written
  bool writing_{false};
  bool closed_{false};
  int complaints_{0};
  std::map<std::size_t, std::uint32_t> subscription_of_;  ///< by channel
  std::map<std::uint32_t, std::size_t> channel_of_;       ///< by subscription
};

}  // namespace trigpoint::live
