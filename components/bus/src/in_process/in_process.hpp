// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The bus within one process, without a network: for tests and tools. Messages are serialised as on
// the wire, and every reader has its own thread.
#pragma once

#include "trigpoint/bus/backend.hpp"

#include "../worker.hpp"

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

namespace trigpoint::bus::in_process {

using Bytes = std::vector<std::uint8_t>;

/// How many deliveries of a writer are still under way.
class Outstanding {
 public:
  void add();
  void remove();
  bool wait_for_none(std::chrono::nanoseconds timeout);

 private:
  std::mutex mutex_;
  std::condition_variable none_;
  int count_{0};
};

/// One sample on its way to one reader; counted as outstanding as long as it lives.
class Parcel {
 public:
  Parcel(std::shared_ptr<const Bytes> bytes, MessageInfo info, std::shared_ptr<Outstanding> count);
  ~Parcel();
  Parcel(const Parcel&) = delete;
  Parcel& operator=(const Parcel&) = delete;

  std::shared_ptr<const Bytes> bytes;
  MessageInfo info;

 private:
  std::shared_ptr<Outstanding> count_;
};

struct Endpoint {
  std::string dds_type;
  std::string dds_topic;
  Qos qos;
  const void* participant;  ///< tells apart whose it is
};

class LocalWriter : public backend::Writer {
 public:
  LocalWriter(int domain, const backend::TypeOps& type, Endpoint endpoint, PublisherEvents events);
  ~LocalWriter() override;

  bool write(const void* value) override;
  bool wait_for_acknowledgments(std::chrono::nanoseconds timeout) override;

  int matched() const override { return readers_; }

  std::string guid() const override { return guid_; }

 private:
  friend class Hub;

  struct Sample {
    std::shared_ptr<const Bytes> bytes;
    Nanoseconds stamp_ns;
  };

  void readers_changed(int change);
  void refused(const std::string& policy);

  const int domain_;
  const backend::TypeOps type_;
  const Endpoint endpoint_;
  const PublisherEvents events_;
  const std::string guid_;
  const std::shared_ptr<Outstanding> outstanding_;
  std::atomic<int> readers_{0};
  std::deque<Sample> history_;  ///< for late joiners; guarded by the hub
  Worker notices_;              ///< told outside the hub's lock; ends before what it uses
};

class LocalReader : public backend::Reader {
 public:
  LocalReader(int domain,
              const backend::TypeOps& type,
              Endpoint endpoint,
              backend::Deliver deliver,
              SubscriptionEvents events,
              EventSink sink);
  ~LocalReader() override;

  int matched() const override { return matched_; }

  std::uint64_t malformed() const override { return malformed_; }

 private:
  friend class Hub;

  void push_sample(std::unique_ptr<Parcel> parcel);
  void push_notice(std::function<void()> notice);
  void matched_with(const std::string& writer_guid);
  void lost(const std::string& writer_guid);
  void refused(const std::string& policy);
  void work();
  void deliver(const Parcel& parcel);

  struct Item {
    std::unique_ptr<Parcel> parcel;  ///< or ...
    std::function<void()> notice;
  };

  const int domain_;
  const backend::TypeOps type_;
  Endpoint endpoint_;  ///< reliability may fall to best effort; guarded by the hub
  const backend::Deliver deliver_;
  const SubscriptionEvents events_;
  const EventSink sink_;
  const std::shared_ptr<void> message_;
  const std::string guid_;
  std::set<std::string> writers_;  ///< guarded by the hub
  std::atomic<int> matched_{0};
  std::atomic<std::uint64_t> malformed_{0};

  std::mutex mutex_;
  std::condition_variable work_;
  std::deque<Item> items_;
  std::size_t samples_{0};
  bool ended_{false};
  std::thread thread_;
};

/// Everybody who takes part, in this process.
class Hub {
 public:
  static Hub& instance();

  void add(LocalWriter& writer);
  void remove(LocalWriter& writer);
  void add(LocalReader& reader);
  void remove(LocalReader& reader);
  void publish(LocalWriter& writer, std::shared_ptr<const Bytes> bytes);
  std::vector<DiscoveredEndpoint> others(int domain, const void* participant);

 private:
  static bool same_topic(const LocalWriter& writer, const LocalReader& reader);
  static std::string incompatible_policy(const LocalWriter& writer, const LocalReader& reader);
  static void send(LocalWriter& writer, LocalReader& reader, const LocalWriter::Sample& sample);
  void meet(LocalWriter& writer, LocalReader& reader);
  void part(LocalWriter& writer, LocalReader& reader);

  std::mutex mutex_;
  std::vector<LocalWriter*> writers_;
  std::vector<LocalReader*> readers_;
};

}  // namespace trigpoint::bus::in_process
