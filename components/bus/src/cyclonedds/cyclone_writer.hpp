// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "cyclone_node.hpp"

#include <atomic>
#include <string>

namespace trigpoint::bus::cyclonedds {

class CycloneWriter : public backend::Writer {
 public:
  CycloneWriter(CycloneNode& node,
                const backend::TypeOps& type,
                const Topic& topic,
                const Qos& qos,
                PublisherEvents events);
  ~CycloneWriter() override;

  bool write(const void* value) override;
  bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) override;
  int matched() const override;
  std::string guid() const override;

 private:
  dds_return_t send(const WireSample& sample);
  void tell_matched(int readers);
  void tell_incompatible(std::uint32_t policy);

  CycloneNode& node_;
  const backend::TypeOps type_;
  const Topic topic_;
  const Qos qos_;
  const PublisherEvents events_;
  PacedSender* const paced_;  ///< of a bulk writer where buffers are small
  dds_entity_t writer_{0};
  // Cyclone locks a writer while it sends, and a paced cloud may take a second.
  std::string guid_;
  std::atomic<int> matched_{0};
};

}  // namespace trigpoint::bus::cyclonedds
