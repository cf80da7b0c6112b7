// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/backend.hpp"

#include "../worker.hpp"
#include "cyclone_type.hpp"
#include "paced_sender.hpp"

#include <atomic>
#include <map>
#include <memory>
#include <mutex>

namespace trigpoint::bus::cyclonedds {

/// A participant in a Cyclone domain of its own. Cyclone keeps settings and sockets by domain, so a
/// second participant of a process would not be asked for its settings, and would talk to the first
/// in memory; so both take the same path as in two processes.
class CycloneNode : public backend::Node {
 public:
  CycloneNode(const Config& config, const std::string& name, EventSink sink);
  ~CycloneNode() override;

  std::unique_ptr<backend::Writer> make_writer(const backend::TypeOps& type,
                                               const std::string& dds_topic,
                                               const Qos& qos,
                                               PublisherEvents events) override;
  std::unique_ptr<backend::Reader> make_reader(const backend::TypeOps& type,
                                               const std::string& dds_topic,
                                               const Qos& qos,
                                               backend::Deliver deliver,
                                               SubscriptionEvents events) override;

  std::optional<unsigned> process_of(const std::string& writer_guid) override;
  std::vector<DiscoveredEndpoint> discovered() override;

  dds_entity_t participant() const { return participant_; }

  Worker& worker() { return worker_; }

  /// Null where socket buffers are large enough for clouds.
  PacedSender* paced_sender() { return paced_sender_.get(); }

  void tell(const Event& event) const;
  void tell_of_unknown_writer(const std::string& dds_topic);
  void tell_too_large(std::size_t size_bytes, const Qos& qos);
  void tell_not_sent(std::size_t size_bytes, dds_return_t why);

 private:
  Topic topic(const std::string& dds_type, const std::string& dds_topic);

  struct KnownTopic {
    std::string dds_type;
    Topic topic;
  };

  const EventSink sink_;
  const std::shared_ptr<BufferPool> pool_{std::make_shared<BufferPool>()};
  std::atomic<std::uint64_t> not_sent_{0};
  std::atomic<std::uint64_t> of_unknown_writer_{0};
  std::unique_ptr<PacedSender> paced_sender_;  // outlives the messages that name its pacer
  dds_entity_t domain_{0};
  dds_entity_t participant_{0};
  std::mutex topics_mutex_;
  std::map<std::string, KnownTopic> topics_;
  Worker worker_;
};

}  // namespace trigpoint::bus::cyclonedds
