// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "cyclone_node.hpp"

#include <atomic>
#include <map>
#include <mutex>

namespace trigpoint::bus::cyclonedds {

class CycloneReader : public backend::Reader {
 public:
  CycloneReader(CycloneNode& node,
                const backend::TypeOps& type,
                const Topic& topic,
                std::string dds_topic,
                const Qos& qos,
                backend::Deliver deliver,
                SubscriptionEvents events);
  ~CycloneReader() override;

  int matched() const override { return matched_; }

  std::uint64_t malformed() const override { return malformed_; }

 private:
  // On a thread of Cyclone's, or on ours inside a call of ours.
  void on_data_available();
  void take_on_worker();
  void on_matched();
  void on_incompatible_qos(std::uint32_t policy);

  // On a thread of Cyclone's or on the worker.
  void take_all();
  void deliver(const WireData& data, const dds_sample_info_t& info);
  std::string guid_of_writer(dds_instance_handle_t writer);

  // On the worker.
  void update_writers();
  void be_incompatible(std::uint32_t policy);
  void make_anew_as_best_effort();

  dds_entity_t create();

  CycloneNode& node_;
  const backend::TypeOps type_;
  const Topic topic_;
  const std::string dds_topic_;
  const backend::Deliver deliver_;
  const SubscriptionEvents events_;
  const std::shared_ptr<void> message_;  ///< reused for every sample
  std::atomic<std::uint64_t> malformed_{0};
  std::atomic<int> matched_{0};
  std::atomic<bool> take_is_posted_{false};
  std::atomic<dds_entity_t> reader_{0};
  Qos qos_;  ///< of the worker, once the constructor is through

  std::mutex making_mutex_;    ///< while the handle is not stored; listeners do not take it
  std::mutex callback_mutex_;  ///< one callback at a time, none after the destructor
  bool closed_{false};
  std::map<dds_instance_handle_t, std::string> writers_;  ///< GUIDs of those that were told
  std::map<dds_instance_handle_t, std::string> guids_;    ///< also of some that have gone, whose
                                                          ///< samples may still wait
};

}  // namespace trigpoint::bus::cyclonedds
