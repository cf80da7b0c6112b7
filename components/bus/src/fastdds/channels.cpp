// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "channels.hpp"

#include <fastrtps/utils/IPLocator.h>

#include <algorithm>

namespace trigpoint::bus::fastdds {

namespace {

using eprosima::fastrtps::rtps::IPLocator;
using eprosima::fastrtps::rtps::Locator_t;
using eprosima::fastrtps::rtps::LocatorList_t;
using eprosima::fastrtps::rtps::SenderResource;

Reach reach_from(const SenderResource& channel) {
  LocatorList_t bound;
  channel.add_locators_to_list(bound);
  if (bound.empty() || IPLocator::isAny(*bound.begin())) {
    return Reach::kAll;
  }
  return IPLocator::isLocal(*bound.begin()) ? Reach::kLoopback : Reach::kInterface;
}

}  // namespace

bool serves(Reach reach, const Locator_t& destination) {
  if (reach == Reach::kAll || IPLocator::isMulticast(destination)) {
    return true;
  }
  return reach != Reach::kMulticast &&
         IPLocator::isLocal(destination) == (reach == Reach::kLoopback);
}

Reach Channels::reach_of(const SenderResource& channel) {
  const std::lock_guard lock(mutex_);
  auto known = std::find_if(known_.begin(), known_.end(), [&channel](const auto& each) {
    return each.first == &channel;
  });
  if (known == known_.end()) {
    known = known_.insert(known_.end(), {&channel, reach_from(channel)});
    are_others_served_ = are_others_served_ || known->second == Reach::kInterface;
    are_all_served_ = are_all_served_ || known->second == Reach::kAll;
  }
  if (are_all_served_ && known->second != Reach::kAll) {
    return Reach::kMulticast;
  }
  const bool serves_all = known->second == Reach::kLoopback && !are_others_served_;
  return serves_all ? Reach::kAll : known->second;
}

}  // namespace trigpoint::bus::fastdds
