// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Datagrams of clouds on their way to the socket, at most a portion each period. Fast DDS 2.9 has
// flow controllers for that, but they let repairs wait until no new cloud is left to send, and
// heartbeats tell of clouds that are still being sent. Readers on Cyclone DDS ask for 256
// fragments of one cloud at a time: of 3 MB (2,300 fragments of a frame each) at 10 Hz and 1 % loss
// the gaps between clouds were too short for the nine rounds.
#pragma once

#include "../rtps_submessages.hpp"
#include "../socket_buffers.hpp"
#include <fastdds/rtps/network/SenderResource.h>

#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <thread>
#include <unordered_set>

namespace trigpoint::bus::fastdds {

/// Everything that a participant sends passes here, so that heartbeats tell the truth; only samples
/// of bulk writers wait. Up to an eighth of a portion, but at least one datagram, is for repairs
/// before anything else, so that new clouds do not stop when much is asked for.
class BulkQueue {
 public:
  /// A period of which its thread is late, up to `catches_up`, is made up for at once: else a busy
  /// computer sends too little.
  explicit BulkQueue(const Pacing& pacing, std::chrono::milliseconds catches_up = {});
  ~BulkQueue();

  /// Nothing waits any longer, and all is sent at once: before sockets are closed.
  void stop();

  /// `depth` samples of it may wait: of more the oldest are not sent unless asked for.
  void add_writer(EntityNumber writer, std::size_t depth);
  /// What waits of it is dropped.
  void remove_writer(EntityNumber writer);

  /// While it lives, what this thread sends is new; else it is a repair.
  class NewSample {
   public:
    NewSample();
    ~NewSample();
    NewSample(const NewSample&) = delete;
    NewSample& operator=(const NewSample&) = delete;
  };

  /// Whether it was sent, or waits. The socket must stay until stop().
  bool send(eprosima::fastrtps::rtps::SenderResource& socket,
            std::span<const std::uint8_t> bytes,
            const eprosima::fastdds::rtps::LocatorList& to);

 private:
  struct Destinations {
    eprosima::fastrtps::rtps::SenderResource* socket{nullptr};
    eprosima::fastdds::rtps::LocatorList to;
  };

  struct Datagram {
    std::vector<std::uint8_t> bytes;
    CarriedSample sample;
    std::vector<Destinations> destinations;  ///< it counts once, as with Fast DDS's own pacing

    std::size_t hash() const;
  };

  struct Writer {
    std::size_t depth{0};
    std::map<std::uint64_t, std::size_t> waiting;  ///< new datagrams by number of the sample
  };

  void add_new(Datagram&& datagram, Writer& writer);
  template <typename Which>
  void drop_repairs(const Which& which);
  void drop_new(EntityNumber writer, std::uint64_t number);
  bool may_send_repair() const;
  void begin_period_if_due();
  Datagram next();
  void work();

  const Pacing pacing_;
  const std::chrono::milliseconds catches_up_;
  std::mutex mutex_;  ///< of all below, and held while a datagram is sent
  std::condition_variable changed_;
  bool stopped_{false};
  std::map<EntityNumber, Writer> writers_;
  std::deque<Datagram> new_;
  std::deque<Datagram> repairs_;
  std::unordered_set<std::size_t> repaired_;  ///< hashes of `repairs_`: asked for twice, sent once
  std::chrono::steady_clock::time_point period_end_{};
  std::int64_t sent_bytes_{0};  ///< in this period
  std::int64_t repaired_bytes_{0};
  std::thread thread_;
};

}  // namespace trigpoint::bus::fastdds
