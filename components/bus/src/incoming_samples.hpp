// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Room for samples that come in fragments, for a middleware that takes all of it at the first one.
#pragma once

#include "trigpoint/bus/qos.hpp"

#include "rtps_submessages.hpp"

#include <array>
#include <chrono>
#include <cstdint>
#include <map>
#include <mutex>
#include <span>
#include <string>
#include <vector>

namespace trigpoint::bus {

using Guid = std::array<std::uint8_t, 16>;

/// Keeps count of what the middleware holds: a sample leaves it when it is whole, or when the
/// middleware gives it up, too, not because of its age.
class IncomingSamples {
 public:
  using Time = std::chrono::steady_clock::time_point;

  struct Verdict {
    bool is_refused{false};  ///< too large, without room, or not what it claims
    /// Nobody here could take it: from a best-effort writer that has begun a newer sample, or large
    /// and from one that is not known yet or not read any more.
    bool is_ignored{false};

    bool passes() const { return !is_refused && !is_ignored; }
  };

  void add_reader(const std::string& dds_topic, const Qos& qos);
  void remove_reader(const std::string& dds_topic, const Qos& qos);
  /// One of somebody else that was discovered; may be told again.
  void add_writer(const Guid& guid, const std::string& dds_topic, Reliability offered);
  /// The middleware has dropped what came of it.
  void remove_writer(const Guid& guid);
  void remove_participant(std::span<const std::uint8_t> prefix);

  Verdict judge(std::span<const std::uint8_t> datagram, Time now);

  /// Announced by fragments and not complete, in all.
  std::int64_t open_bytes() const;

 private:
  enum Share : std::size_t { kBulk, kOther, kShares };

  /// Nothing of these is kept by the middleware, since nobody here reads from them: `is_read`.
  struct Terms {
    bool is_read{false};
    Share share{kOther};
    bool keeps_one{false};  ///< best effort: a newer sample takes the place of an unfinished one
    bool is_builtin{false};
  };

  struct Readers {
    int bulk{0};
    int others{0};
    int reliable{0};
  };

  struct Writer {
    std::string dds_topic;
    Reliability offered{Reliability::kReliable};
  };

  struct Sample {
    std::int64_t size_bytes{0};
    std::uint32_t fragment_bytes{0};
    std::vector<bool> seen;
    std::size_t missing{0};
    Time touched;
  };

  struct Stream {
    Terms terms;
    std::uint32_t last_heartbeat{0};  ///< its count
    std::map<std::uint64_t, Sample> open;
    std::map<std::uint64_t, std::int64_t> finished;  ///< sizes; repairs of these may still come
  };

  struct Fragments;

  Terms terms_of(const Guid& writer) const;
  void take(const Fragments& came, Verdict& verdict);
  void begin(const Fragments& came, const Terms& terms, Verdict& verdict);
  void note(const Fragments& came, Stream& stream, Sample& sample);
  void forget_before(const Guid& writer, const HeartbeatOf& told);
  bool make_room(Share share, std::int64_t bytes, Time now);
  void set_terms(Stream& stream, const Terms& terms);
  void free_all_of(const Stream& stream);

  mutable std::mutex mutex_;
  std::map<std::string, Readers> topics_;
  std::map<Guid, Writer> writers_;
  std::map<Guid, Stream> streams_;
  std::array<std::int64_t, kShares> open_bytes_{};
  Time searched_{};  ///< for what may be forgotten
};

}  // namespace trigpoint::bus
