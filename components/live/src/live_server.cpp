// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/live/live_server.hpp"

#include "trigpoint/base/config.hpp"

#include "connection.hpp"
#include "protocol.hpp"
#include <boost/asio/io_context.hpp>
#include <boost/asio/post.hpp>
#include <boost/asio/steady_timer.hpp>

#include <atomic>
#include <chrono>
#include <exception>
#include <set>
#include <stdexcept>
#include <thread>
#include <utility>

namespace trigpoint::live {

namespace {

namespace asio = boost::asio;
using tcp = asio::ip::tcp;
using Error = boost::system::error_code;

// Between the bus and our thread; it never waits, so this is reached only when the computer is
// overloaded.
constexpr std::size_t kMostPending_bytes = std::size_t{128} << 20U;
constexpr std::size_t kPendingOverhead_bytes = 256;  // of a posted task
constexpr std::chrono::milliseconds kRetry{200};     // after accept failed: no more file handles

std::string new_session_id() {
  return std::to_string(std::chrono::system_clock::now().time_since_epoch().count());
}

tcp::endpoint endpoint_of(const ServerOptions& options) {
  Error error;
  const auto address = asio::ip::make_address(options.bind_address, error);
  if (error) {
    throw ConfigError("'" + options.bind_address +
                      "' is no IP address to listen on; 127.0.0.1 is this computer alone, 0.0.0.0 "
                      "every network");
  }
  return {address, options.port};
}

}  // namespace

struct LiveServer::Impl : Hub {
  Impl(const ServerOptions& server_options,
       std::vector<Channel> offered,
       Wanted on_wanted,
       Sink sink)
      : options(server_options),
        channel_list(std::move(offered)),
        wanted(std::move(on_wanted)),
        tell(std::move(sink)),
        info(server_info_json(new_session_id())),
        channels_json(advertise_json(channel_list)),
        subscribers(channel_list.size(), 0),
        latched(channel_list.size()),
        acceptor(io),
        retry(io) {
    listen();
    accept();
    thread = std::thread([this] { io.run(); });
  }

  ~Impl() override {
    // With the thread gone nothing runs any more; handlers still waiting in `io` go with it, last.
    io.stop();
    thread.join();
  }

  Impl(const Impl&) = delete;
  Impl& operator=(const Impl&) = delete;

  void listen() {
    const tcp::endpoint endpoint = endpoint_of(options);
    try {
      acceptor.open(endpoint.protocol());
      acceptor.set_option(asio::socket_base::reuse_address(true));
      acceptor.bind(endpoint);
      acceptor.listen();
      port = acceptor.local_endpoint().port();
    } catch (const boost::system::system_error& error) {
      throw std::runtime_error("cannot listen on " + options.bind_address + " port " +
                               std::to_string(options.port) + ": " + error.code().message() +
                               "; another port: --port N");
    }
  }

  void accept() {
    acceptor.async_accept([this](Error error, tcp::socket socket) {
      if (error) {
        retry.expires_after(kRetry);
        retry.async_wait([this](Error) { accept(); });
        return;
      }
      take(std::move(socket));
      accept();
    });
  }

  void take(tcp::socket socket) {
    if (connections.size() >= options.max_clients) {
      ++turned_away;
      if (tell) {
        tell({Severity::kWarning,
              0,
              "live_too_many_clients",
              "a connection was turned away: " + std::to_string(connections.size()) +
                  " are open, which is all that are let in"});
      }
      return;  // closes it
    }
    const auto connection =
        std::make_shared<Connection>(std::move(socket), options.max_queued_bytes, *this);
    connections.insert(connection);
    connection->start();
  }

  const std::string& server_info() const override { return info; }

  const std::string& advertisement() const override { return channels_json; }

  const std::vector<Channel>& channels() const override { return channel_list; }

  void joined(const std::shared_ptr<Connection>& client) override {
    clients.insert(client);
    client_count = clients.size();
  }

  void left(Connection& connection) override {
    const std::shared_ptr<Connection> kept = connection.shared_from_this();
    clients.erase(kept);
    connections.erase(kept);
    client_count = clients.size();
  }

  void subscribed(Connection& client, std::size_t channel) override {
    if (++subscribers[channel] == 1 && wanted) {
      wanted(channel, true);
    }
    if (latched[channel].cdr) {
      client.send(channel, latched[channel].stamp_ns, latched[channel].cdr);
    }
  }

  void unsubscribed(std::size_t channel) override {
    if (--subscribers[channel] > 0) {
      return;
    }
    latched[channel] = {};  // nobody keeps it up to date from here on
    if (wanted) {
      wanted(channel, false);
    }
  }

  void count(std::uint64_t more_sent, std::uint64_t more_dropped) override {
    sent += more_sent;
    dropped += more_dropped;
  }

  void distribute(std::size_t channel, Nanoseconds stamp_ns, const Payload& cdr) {
    if (subscribers[channel] == 0) {
      return;
    }
    if (channel_list[channel].latched) {
      latched[channel] = {stamp_ns, cdr};
    }
    for (const auto& client : std::set(clients)) {  // sending may end with a client that leaves
      client->send(channel, stamp_ns, cdr);
    }
  }

  void distribute_time(Nanoseconds now_ns) {
    for (const auto& client : std::set(clients)) {
      client->send_time(now_ns);
    }
  }

  struct Latched {
    Nanoseconds stamp_ns{0};
    Payload cdr;
  };

  asio::io_context io{1};  ///< outlives every socket below
  const ServerOptions options;
  const std::vector<Channel> channel_list;
  const Wanted wanted;
  const Sink tell;
  const std::string info;
  const std::string channels_json;
  std::vector<int> subscribers;  ///< by channel
  std::vector<Latched> latched;  ///< by channel
  std::set<std::shared_ptr<Connection>> connections;
  std::set<std::shared_ptr<Connection>> clients;  ///< those that speak the protocol
  std::uint16_t port{0};
  std::atomic<std::size_t> pending_bytes{0};
  std::atomic<std::uint64_t> client_count{0};
  std::atomic<std::uint64_t> sent{0};
  std::atomic<std::uint64_t> dropped{0};
  std::atomic<std::uint64_t> turned_away{0};
  tcp::acceptor acceptor;
  asio::steady_timer retry;
  std::thread thread;
};

LiveServer::LiveServer(const ServerOptions& options,
                       std::vector<Channel> channels,
                       Wanted wanted,
                       Sink sink)
    : impl_(std::make_unique<Impl>(options,
                                   std::move(channels),
                                   std::move(wanted),
                                   std::move(sink))) {}

LiveServer::~LiveServer() = default;

std::uint16_t LiveServer::port() const {
  return impl_->port;
}

void LiveServer::publish(std::size_t channel, Nanoseconds stamp_ns, std::vector<std::uint8_t> cdr) {
  const std::size_t size = cdr.size() + kPendingOverhead_bytes;
  if (impl_->pending_bytes.fetch_add(size) + size > kMostPending_bytes) {
    impl_->pending_bytes -= size;
    ++impl_->dropped;
    return;
  }
  asio::post(impl_->io,
             [impl = impl_.get(),
              channel,
              stamp_ns,
              size,
              payload = std::make_shared<const Bytes>(std::move(cdr))] {
               impl->pending_bytes -= size;
               impl->distribute(channel, stamp_ns, payload);
             });
}

void LiveServer::publish_time(Nanoseconds now_ns) {
  asio::post(impl_->io, [impl = impl_.get(), now_ns] { impl->distribute_time(now_ns); });
}

Counters LiveServer::counters() const {
  return {impl_->client_count, impl_->sent, impl_->dropped, impl_->turned_away};
}

}  // namespace trigpoint::live
