// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "rosbag1_source.hpp"

#include "ros1_source.hpp"
#include <rosbag/bag.h>
#include <rosbag/view.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>

namespace trigpoint::recording {

namespace fs = std::filesystem;

namespace {

Nanoseconds nanoseconds_of(const ros::Time& time) {
  return static_cast<Nanoseconds>(time.sec) * kNanosecondsPerSecond + time.nsec;
}

class IndexedBag : public Ros1Source {
 public:
  explicit IndexedBag(const fs::path& file) {
    bag_.open(file.string(), rosbag::bagmode::Read);
    summarize(file);
  }

  const LogSummary& summary() const override { return summary_; }

  void select(const std::vector<std::string>& topics) override {
    const std::set<std::string> wanted(topics.begin(), topics.end());
    view_.emplace(bag_, [wanted](const rosbag::ConnectionInfo* connection) {
      return wanted.count(connection->topic) > 0;
    });
    at_ = view_->begin();
  }

  std::optional<RawMessage> next() override {
    if (at_ == view_->end()) {
      return std::nullopt;
    }
    try {
      RawMessage raw;
      raw.receive_ns = nanoseconds_of(at_->getTime());
      raw.topic = at_->getTopic();
      raw.bytes.resize(at_->size());
      ros::serialization::OStream stream(raw.bytes.data(),
                                         static_cast<std::uint32_t>(raw.bytes.size()));
      at_->write(stream);
      ++at_;
      return raw;
    } catch (const ros::Exception& error) {
      at_ = view_->end();
      throw LogError(summary_.path + ": the bag is damaged: " + error.what());
    }
  }

 private:
  void summarize(const fs::path& file) {
    summary_.path = file.string();
    summary_.format = "rosbag1";
    rosbag::View all(bag_);
    std::map<std::string, TopicSummary> topics;
    for (const rosbag::ConnectionInfo* connection : all.getConnections()) {
      auto& topic = topics[connection->topic];
      topic.topic = connection->topic;
      topic.type = ros2_type_name(connection->datatype);
    }
    for (auto& [name, topic] : topics) {
      rosbag::View one(bag_, [&name = name](const rosbag::ConnectionInfo* connection) {
        return connection->topic == name;
      });
      topic.messages = one.size();
      summary_.topics.push_back(topic);
    }
    if (all.size() > 0) {
      summary_.first_ns = nanoseconds_of(all.getBeginTime());
      summary_.last_ns = nanoseconds_of(all.getEndTime());
    }
  }

  rosbag::Bag bag_;
  LogSummary summary_;
  std::optional<rosbag::View> view_;
  rosbag::View::iterator at_;
};

}  // namespace

std::unique_ptr<BagSource> open_rosbag1(const fs::path& file) {
  if (fs::file_size(file) == 0) {
    throw LogError(file.string() + ": the file is empty");
  }
  try {
    return std::make_unique<IndexedBag>(file);
  } catch (const ros::Exception&) {
    return salvage_rosbag1(file);
  }
}

}  // namespace trigpoint::recording
