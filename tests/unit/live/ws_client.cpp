// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "ws_client.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/asio/read.hpp>
#include <boost/asio/write.hpp>
#include <boost/beast/core.hpp>
#include <boost/beast/websocket.hpp>

#include <chrono>
#include <stdexcept>

namespace trigpoint::live::test {

namespace {

namespace asio = boost::asio;
namespace beast = boost::beast;
namespace websocket = beast::websocket;

asio::ip::tcp::endpoint local(std::uint16_t port) {
  return {asio::ip::make_address("127.0.0.1"), port};
}

}  // namespace

struct WsClient::Impl {
  asio::io_context io;
  websocket::stream<beast::tcp_stream> stream{io};
  websocket::response_type response;
  beast::flat_buffer buffer;
};

WsClient::WsClient(std::uint16_t port, const std::string& subprotocol)
    : impl_(std::make_unique<Impl>()) {
  impl_->stream.next_layer().socket().connect(local(port));
  impl_->stream.set_option(
      websocket::stream_base::decorator([&subprotocol](websocket::request_type& request) {
        if (!subprotocol.empty()) {
          request.set(beast::http::field::sec_websocket_protocol, subprotocol);
        }
      }));
  impl_->stream.read_message_max(0);
  impl_->stream.handshake(impl_->response, "localhost", "/");
}

WsClient::~WsClient() = default;

std::string WsClient::subprotocol() const {
  return std::string(impl_->response[beast::http::field::sec_websocket_protocol]);
}

void WsClient::send_text(const std::string& text) {
  impl_->stream.text(true);
  beast::error_code ignored;  // a server that closes is seen by receive()
  impl_->stream.write(asio::buffer(text), ignored);
}

std::optional<Received> WsClient::receive(int limit_ms) {
  beast::error_code result = asio::error::would_block;
  impl_->buffer.clear();
  impl_->stream.async_read(impl_->buffer,
                           [&result](beast::error_code error, std::size_t) { result = error; });
  impl_->io.restart();
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(limit_ms);
  while (result == asio::error::would_block && impl_->io.run_one_until(end) > 0) {
  }
  if (result == asio::error::would_block) {
    impl_->stream.next_layer().cancel();
    impl_->io.restart();
    impl_->io.run();
    return std::nullopt;
  }
  if (result) {
    return std::nullopt;
  }
  return Received{impl_->stream.got_text(), beast::buffers_to_string(impl_->buffer.data())};
}

std::optional<Received> WsClient::receive_data(int limit_ms) {
  std::optional<Received> next;
  do {
    next = receive(limit_ms);
  } while (next && (next->text || next->bytes.front() != 1));
  return next;
}

std::string http(std::uint16_t port, const std::string& request) {
  asio::io_context io;
  asio::ip::tcp::socket socket(io);
  socket.connect(local(port));
  std::string answer;
  beast::error_code end_of_file;  // or a server that closes before it has heard all
  asio::write(socket, asio::buffer(request), end_of_file);
  asio::read(socket, asio::dynamic_buffer(answer), end_of_file);
  return answer;
}

}  // namespace trigpoint::live::test
