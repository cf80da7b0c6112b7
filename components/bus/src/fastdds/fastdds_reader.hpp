// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fastdds_node.hpp"
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/DataReaderListener.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include <atomic>
#include <mutex>
#include <set>

namespace trigpoint::bus::fastdds {

class FastReader : public backend::Reader, private eprosima::fastdds::dds::DataReaderListener {
 public:
  FastReader(FastNode& node,
             const backend::TypeOps& type,
             eprosima::fastdds::dds::Topic* topic,
             const Qos& qos,
             backend::Deliver deliver,
             SubscriptionEvents events);
  ~FastReader() override;

  int matched() const override { return matched_; }

  std::uint64_t malformed() const override { return malformed_; }

 private:
  void on_data_available(eprosima::fastdds::dds::DataReader* reader) override;
  void on_subscription_matched(
      eprosima::fastdds::dds::DataReader* reader,
      const eprosima::fastdds::dds::SubscriptionMatchedStatus& status) override;
  void on_requested_incompatible_qos(
      eprosima::fastdds::dds::DataReader* reader,
      const eprosima::fastdds::dds::RequestedIncompatibleQosStatus& status) override;

  eprosima::fastdds::dds::DataReader* create(const Qos& qos);
  void remove(eprosima::fastdds::dds::DataReader* reader);
  void deliver(const eprosima::fastdds::dds::SampleInfo& info, bool decoded);
  void make_anew_as_best_effort();

  FastNode& node_;
  const backend::TypeOps type_;
  eprosima::fastdds::dds::Topic* const topic_;
  const backend::Deliver deliver_;
  const SubscriptionEvents events_;
  const std::shared_ptr<void> message_;  ///< reused for every sample
  std::atomic<std::uint64_t> malformed_{0};
  std::atomic<int> matched_{0};

  std::mutex callback_mutex_;  ///< one callback at a time, none after the destructor
  bool closed_{false};
  bool being_made_anew_{false};
  std::set<std::string> writers_;

  std::mutex reader_mutex_;  ///< between the constructor and the worker
  Qos qos_;
  eprosima::fastdds::dds::DataReader* reader_{nullptr};
};

}  // namespace trigpoint::bus::fastdds
