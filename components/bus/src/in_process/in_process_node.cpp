// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "in_process.hpp"
#include <unistd.h>

#include <utility>

namespace trigpoint::bus {

namespace {

class LocalNode : public backend::Node {
 public:
  LocalNode(int domain, EventSink sink) : domain_(domain), sink_(std::move(sink)) {}

  std::unique_ptr<backend::Writer> make_writer(const backend::TypeOps& type,
                                               const std::string& dds_topic,
                                               const Qos& qos,
                                               PublisherEvents events) override {
    return std::make_unique<in_process::LocalWriter>(
        domain_,
        type,
        in_process::Endpoint{type.dds_name, dds_topic, qos, this},
        std::move(events));
  }

  std::unique_ptr<backend::Reader> make_reader(const backend::TypeOps& type,
                                               const std::string& dds_topic,
                                               const Qos& qos,
                                               backend::Deliver deliver,
                                               SubscriptionEvents events) override {
    return std::make_unique<in_process::LocalReader>(
        domain_,
        type,
        in_process::Endpoint{type.dds_name, dds_topic, qos, this},
        std::move(deliver),
        std::move(events),
        sink_);
  }

  std::optional<unsigned> process_of(const std::string&) override {
    return static_cast<unsigned>(getpid());
  }

  std::vector<DiscoveredEndpoint> discovered() override {
    return in_process::Hub::instance().others(domain_, this);
  }

 private:
  const int domain_;
  const EventSink sink_;
};

}  // namespace

namespace backend {

std::unique_ptr<Node> make_node(const Config& config, const std::string&, EventSink sink) {
  return std::make_unique<LocalNode>(domain_of(config), std::move(sink));
}

const char* name() {
  return "in_process";
}

}  // namespace backend
}  // namespace trigpoint::bus
