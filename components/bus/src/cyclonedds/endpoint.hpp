// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// What writers and readers have in common.
#pragma once

#include "trigpoint/bus/backend.hpp"
#include "trigpoint/bus/qos.hpp"

#include <dds/dds.h>

#include <memory>
#include <string>

namespace trigpoint::bus::cyclonedds {

struct QosDeleter {
  void operator()(dds_qos_t* qos) const { dds_delete_qos(qos); }
};

struct ListenerDeleter {
  void operator()(dds_listener_t* listener) const { dds_delete_listener(listener); }
};

using QosPointer = std::unique_ptr<dds_qos_t, QosDeleter>;
using ListenerPointer = std::unique_ptr<dds_listener_t, ListenerDeleter>;

/// The policies that writers and readers both have.
QosPointer make_qos(const Qos& qos, const backend::TypeOps& type);

/// 32 hexadecimal digits.
std::string guid_text(const dds_guid_t& guid);

/// "RELIABILITY" and the like.
std::string policy_name(std::uint32_t policy);

/// Throws std::runtime_error with `what` and Cyclone's reason when `result` is an error.
dds_entity_t checked(dds_entity_t result, const std::string& what);

/// While it lives, Cyclone may call our listeners on this thread, inside a call of ours; callbacks
/// of users must not run there.
class OwnCall {
 public:
  OwnCall() { ++depth(); }

  ~OwnCall() { --depth(); }

  OwnCall(const OwnCall&) = delete;
  OwnCall& operator=(const OwnCall&) = delete;

  static bool is_on_this_thread() { return depth() > 0; }

 private:
  static int& depth();
};

}  // namespace trigpoint::bus::cyclonedds
