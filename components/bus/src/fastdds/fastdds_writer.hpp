// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "fastdds_node.hpp"
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/DataWriterListener.hpp>
#include <fastdds/dds/topic/Topic.hpp>

#include <mutex>

namespace trigpoint::bus::fastdds {

class FastWriter : public backend::Writer, private eprosima::fastdds::dds::DataWriterListener {
 public:
  FastWriter(FastNode& node,
             const backend::TypeOps& type,
             eprosima::fastdds::dds::Topic* topic,
             const Qos& qos,
             PublisherEvents events);
  ~FastWriter() override;

  bool write(const void* value) override;
  bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) override;
  int matched() const override;
  std::string guid() const override;

 private:
  void on_publication_matched(
      eprosima::fastdds::dds::DataWriter* writer,
      const eprosima::fastdds::dds::PublicationMatchedStatus& status) override;
  void on_offered_incompatible_qos(
      eprosima::fastdds::dds::DataWriter* writer,
      const eprosima::fastdds::dds::OfferedIncompatibleQosStatus& status) override;

  FastNode& node_;
  const backend::TypeOps type_;
  const Qos qos_;
  const PublisherEvents events_;
  std::mutex callback_mutex_;
  bool closed_{false};
  eprosima::fastdds::dds::DataWriter* writer_{nullptr};
  BulkQueue* bulk_queue_{nullptr};  ///< where its samples wait for their turn, if they do
};

}  // namespace trigpoint::bus::fastdds
