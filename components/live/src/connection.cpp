// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "connection.hpp"

#include "embedded.hpp"

#include <chrono>
#include <utility>

namespace trigpoint::live {

namespace {

namespace beast = boost::beast;
namespace http = beast::http;
namespace websocket = beast::websocket;

constexpr std::chrono::seconds kRequestLimit{10};  // for a whole HTTP request, or the answer
constexpr std::chrono::seconds kSilenceLimit{20};  // then a ping was not answered either
constexpr std::size_t kLargestRequest = 4096;      // bytes of a body; nobody has reason to send one
constexpr std::size_t kLargestMessage = 64 * 1024;  // bytes; a subscribe to all channels has 2 kB
constexpr int kPatience = 100;                      // wrong messages before a client is sent away
constexpr std::size_t kMostControls = 200;          // answers that wait for a client
// Little, so that what a slow client sees is not old; enough for 1 GB/s on this computer.
constexpr int kSocketBuffer_bytes = 1 << 20;

/// The page is one file and speaks with nobody but its server. "ws:" because not every browser
/// takes 'self' for a WebSocket as well.
constexpr const char* kPagePolicy =
    "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; img-src data:; "
    "connect-src 'self' ws:";

/// With or without words for the page's script behind a question mark.
bool asks_for_page(beast::string_view target) {
  const auto path = target.substr(0, target.find('?'));
  return path == "/" || path == "/index.html";
}

}  // namespace

Connection::Connection(boost::asio::ip::tcp::socket socket, std::size_t max_queued_bytes, Hub& hub)
    : hub_(hub),
      stream_(std::move(socket)),
      buffer_(2 * kLargestMessage),
      outbox_(max_queued_bytes) {}

void Connection::start() {
  Error ignored;
  beast::tcp_stream& tcp = stream_.next_layer();
  tcp.socket().set_option(boost::asio::ip::tcp::no_delay(true), ignored);
  tcp.socket().set_option(boost::asio::socket_base::send_buffer_size(kSocketBuffer_bytes), ignored);
  tcp.expires_after(kRequestLimit);
  parser_.emplace();
  parser_->body_limit(kLargestRequest);
  http::async_read(tcp, buffer_, *parser_, [self = shared_from_this()](Error error, std::size_t) {
    self->on_request(error);
  });
}

void Connection::on_request(Error error) {
  if (error) {
    close();
    return;
  }
  const Request request = parser_->release();
  if (websocket::is_upgrade(request)) {
    upgrade(request);
  } else if (request.method() != http::verb::get) {
    respond(http::status::method_not_allowed, "text/plain", "only GET\n");
  } else if (asks_for_page(request.target())) {
    respond(http::status::ok, "text/html; charset=utf-8", embedded_page());
  } else {
    respond(http::status::not_found, "text/plain", "there is only /\n");
  }
}

void Connection::respond(http::status status, const char* type, std::string_view body) {
  response_.result(status);
  response_.set(http::field::content_type, type);
  response_.set(http::field::cache_control, "no-store");
  response_.set("X-Content-Type-Options", "nosniff");
  response_.set("Content-Security-Policy", kPagePolicy);
  response_.keep_alive(false);
  response_.body() = body;
  response_.prepare_payload();
  http::async_write(
      stream_.next_layer(), response_, [self = shared_from_this()](Error, std::size_t) {
        Error ignored;
        self->stream_.next_layer().socket().shutdown(boost::asio::ip::tcp::socket::shutdown_send,
                                                     ignored);
        self->close();
      });
}

void Connection::upgrade(const Request& request) {
  std::string offered;
  for (auto [field, end] = request.equal_range(http::field::sec_websocket_protocol); field != end;
       ++field) {
    offered += std::string(field->value()) + ",";
  }
  const auto subprotocol = choose_subprotocol(offered);
  if (!subprotocol) {
    respond(http::status::bad_request,
            "text/plain",
            "the WebSocket subprotocol must be foxglove.websocket.v1 or foxglove.sdk.v1\n");
    return;
  }
  stream_.next_layer().expires_never();  // from here on the WebSocket's own limits hold
  websocket::stream_base::timeout limits{};
  limits.handshake_timeout = kRequestLimit;
  limits.idle_timeout = kSilenceLimit;
  limits.keep_alive_pings = true;
  stream_.set_option(limits);
  stream_.set_option(websocket::stream_base::decorator(
      [chosen = *subprotocol](websocket::response_type& response) {
        response.set(http::field::sec_websocket_protocol, chosen);
      }));
  stream_.read_message_max(kLargestMessage);
  stream_.auto_fragment(false);  // a message goes out in one piece, from where it lies
  stream_.async_accept(request,
                       [self = shared_from_this()](Error error) { self->on_upgraded(error); });
}

void Connection::on_upgraded(Error error) {
  if (error) {
    close();
    return;
  }
  buffer_.clear();  // nobody may speak before the handshake is done
  outbox_.push_control(text_frame(hub_.server_info()));
  outbox_.push_control(text_frame(hub_.advertisement()));
  hub_.joined(shared_from_this());
  write_next();
  read();
}

void Connection::read() {
  stream_.async_read(
      buffer_, [self = shared_from_this()](Error error, std::size_t) { self->on_message(error); });
}

void Connection::on_message(Error error) {
  if (error || closed_) {
    close();
    return;
  }
  if (stream_.got_text()) {
    const auto data = buffer_.cdata();
    take(parse_client_message({static_cast<const char*>(data.data()), data.size()}));
  } else {
    complain("this server takes no binary messages");
  }
  buffer_.consume(buffer_.size());
  if (complaints_ > kPatience || outbox_.waiting_controls() > kMostControls) {
    close();
    return;
  }
  read();
}

void Connection::take(const ClientMessage& message) {
  if (!message.complaint.empty()) {
    complain(message.complaint);
    return;
  }
  for (const Subscription& subscription : message.subscribe) {
    subscribe(subscription);
  }
  for (const std::uint32_t id : message.unsubscribe) {
    unsubscribe(id);
  }
}

void Connection::subscribe(const Subscription& subscription) {
  const std::size_t channel = subscription.channel;
  if (channel >= hub_.channels().size()) {
    complain("subscribe: there is no channel " + std::to_string(channel));
  } else if (channel_of_.contains(subscription.id) || subscription_of_.contains(channel)) {
    complain("subscribe: subscription " + std::to_string(subscription.id) + " or channel " +
             std::to_string(channel) + " is in use by this client");
  } else {
    channel_of_[subscription.id] = channel;
    subscription_of_[channel] = subscription.id;
    hub_.subscribed(*this, channel);
  }
}

void Connection::unsubscribe(std::uint32_t id) {
  const auto found = channel_of_.find(id);
  if (found == channel_of_.end()) {
    complain("unsubscribe: there is no subscription " + std::to_string(id));
    return;
  }
  const std::size_t channel = found->second;
  channel_of_.erase(found);
  subscription_of_.erase(channel);
  outbox_.forget(id);
  hub_.unsubscribed(channel);
}

void Connection::complain(const std::string& text) {
  ++complaints_;
  if (outbox_.waiting_controls() <= kMostControls) {
    outbox_.push_control(text_frame(warning_json(text)));
  }
  write_next();
}

void Connection::send(std::size_t channel, Nanoseconds stamp_ns, const Payload& cdr) {
  const auto found = subscription_of_.find(channel);
  if (found != subscription_of_.end()) {
    hub_.count(
        0, outbox_.push(data_frame(found->second, stamp_ns, cdr), hub_.channels()[channel].depth));
    write_next();
  }
}

void Connection::send_time(Nanoseconds now_ns) {
  outbox_.push(time_frame(now_ns), 1);
  write_next();
}

void Connection::write_next() {
  if (writing_ || closed_) {
    return;
  }
  std::optional<Frame> next = outbox_.pop();
  if (!next) {
    return;
  }
  writing_ = true;
  current_ = std::move(*next);
  stream_.text(current_.text);
  std::array<boost::asio::const_buffer, 2> parts{
      boost::asio::buffer(current_.header.data(), current_.header_bytes),
      boost::asio::const_buffer()};
  if (current_.payload) {
    parts[1] = boost::asio::buffer(*current_.payload);
  }
  stream_.async_write(
      parts, [self = shared_from_this()](Error error, std::size_t) { self->on_written(error); });
}

void Connection::on_written(Error error) {
  writing_ = false;
  if (error) {
    close();
    return;
  }
  hub_.count(current_.text || current_.stream == kTimeStream ? 0 : 1, 0);
  current_ = Frame{};
  write_next();
}

void Connection::close() {
  if (closed_) {
    return;
  }
  closed_ = true;
  for (const auto& [channel, subscription] : subscription_of_) {
    hub_.unsubscribed(channel);
  }
  subscription_of_.clear();
  channel_of_.clear();
  stream_.next_layer().close();
  hub_.left(*this);
}

}  // namespace trigpoint::live
