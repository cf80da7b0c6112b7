// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What a middleware must provide, without types. Shells use bus.hpp; this is for src/<backend>/.
#pragma once

#include "trigpoint/base/event.hpp"
#include "trigpoint/base/time.hpp"
#include "trigpoint/bus/config.hpp"
#include "trigpoint/bus/discovered.hpp"
#include "trigpoint/bus/qos.hpp"

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace trigpoint::bus {

struct MessageInfo {
  std::string writer_guid;            ///< 16 bytes as hexadecimal digits; differs for every writer
  Nanoseconds source_stamp_ns{0};     ///< wall clock of the writer when it wrote
  Nanoseconds reception_stamp_ns{0};  ///< our wall clock when the callback began
};

/// Told on a middleware thread; each may be empty.
struct SubscriptionEvents {
  std::function<void(const std::string& writer_guid)> writer_matched{};
  std::function<void(const std::string& writer_guid)> writer_lost{};
  /// A writer was refused; `policy` is e.g. "RELIABILITY". After RELIABILITY the reader is made
  /// anew.
  std::function<void(const std::string& policy)> incompatible_qos{};
};

struct PublisherEvents {
  std::function<void(int readers)> readers_changed{};
  std::function<void(const std::string& policy)> incompatible_qos{};
};

using EventSink = std::function<void(const Event&)>;

namespace backend {

/// A message type as bytes: names, and functions over `void*` to a value of that type.
struct TypeOps {
  std::string dds_name;                                ///< e.g. "sensor_msgs::msg::dds_::Imu_"
  std::function<std::size_t(const void*)> size_bound;  ///< with encapsulation
  std::function<std::size_t(const void*, std::span<std::uint8_t>)> serialize;  ///< 0: failed
  std::function<bool(std::span<const std::uint8_t>, void*)> deserialize;       ///< never throws
  std::function<std::shared_ptr<void>()> make;
};

using Deliver = std::function<void(void* value, const MessageInfo&)>;

class Writer {
 public:
  virtual ~Writer() = default;
  virtual bool write(const void* value) = 0;
  virtual bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) = 0;
  virtual int matched() const = 0;
  virtual std::string guid() const = 0;
};

class Reader {
 public:
  virtual ~Reader() = default;
  virtual int matched() const = 0;
  virtual std::uint64_t malformed() const = 0;
};

class Node {
 public:
  virtual ~Node() = default;
  virtual std::unique_ptr<Writer> make_writer(const TypeOps& type,
                                              const std::string& dds_topic,
                                              const Qos& qos,
                                              PublisherEvents events) = 0;
  virtual std::unique_ptr<Reader> make_reader(const TypeOps& type,
                                              const std::string& dds_topic,
                                              const Qos& qos,
                                              Deliver deliver,
                                              SubscriptionEvents events) = 0;
  /// Of a matched writer, where that can be told; nobody says on which computer.
  virtual std::optional<unsigned> process_of(const std::string& writer_guid) = 0;
  /// Everybody else's endpoints on the domain that are known by now.
  virtual std::vector<DiscoveredEndpoint> discovered() = 0;
};

/// Defined by the backend that is linked. Throws std::runtime_error with cause and remedy.
std::unique_ptr<Node> make_node(const Config& config, const std::string& name, EventSink sink);

/// "fastdds", "cyclonedds" or "in_process".
const char* name();

/// Defined for every message in topics.hpp.
template <class T>
const TypeOps& type_ops();

/// Values are std::vector<std::uint8_t> holding the serialised message as it is on the wire.
TypeOps serialized_ops(const std::string& ros_type);

}  // namespace backend
}  // namespace trigpoint::bus
