// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/bus/backend.hpp"

#include "../incoming_samples.hpp"
#include "../worker.hpp"
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantListener.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>

#include <atomic>
#include <map>
#include <memory>
#include <mutex>

namespace trigpoint::bus::fastdds {

class BulkQueue;

class FastNode : public backend::Node, private eprosima::fastdds::dds::DomainParticipantListener {
 public:
  FastNode(const Config& config, const std::string& name, EventSink sink);
  ~FastNode() override;

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

  eprosima::fastdds::dds::Publisher& publisher() { return *publisher_; }

  eprosima::fastdds::dds::Subscriber& subscriber() { return *subscriber_; }

  Worker& worker() { return worker_; }

  const Config& config() const { return config_; }

  bool is_paced() const { return is_paced_; }

  /// Nothing when clouds are not paced, or by Fast DDS.
  BulkQueue* bulk_queue() const { return bulk_queue_.get(); }

  IncomingSamples& incoming() { return *incoming_; }

  void tell(const Event& event) const;
  void tell_too_large(std::size_t size_bytes, const Qos& qos);

 private:
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                                eprosima::fastrtps::rtps::ParticipantDiscoveryInfo&& info) override;

  void on_publisher_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                              eprosima::fastrtps::rtps::WriterDiscoveryInfo&& info) override;
  void on_subscriber_discovery(eprosima::fastdds::dds::DomainParticipant* participant,
                               eprosima::fastrtps::rtps::ReaderDiscoveryInfo&& info) override;
  /// `Data` is what Fast DDS knows of a remote writer or reader.
  template <class Data>
  void note_endpoint(bool writes, const Data& data, bool removed);

  eprosima::fastdds::dds::Topic* topic(const std::string& dds_type, const std::string& dds_topic);

  const Config config_;
  const EventSink sink_;
  bool is_paced_{false};
  std::shared_ptr<BulkQueue> bulk_queue_;
  const std::shared_ptr<IncomingSamples> incoming_{std::make_shared<IncomingSamples>()};
  std::atomic<std::uint64_t> not_sent_{0};
  std::mutex discovery_mutex_;
  std::map<std::string, unsigned> processes_;            ///< by the participant's part of a GUID
  std::map<std::string, DiscoveredEndpoint> endpoints_;  ///< by GUID
  std::mutex topics_mutex_;
  eprosima::fastdds::dds::DomainParticipant* participant_{nullptr};
  eprosima::fastdds::dds::Publisher* publisher_{nullptr};
  eprosima::fastdds::dds::Subscriber* subscriber_{nullptr};
  Worker worker_;
};

}  // namespace trigpoint::bus::fastdds
