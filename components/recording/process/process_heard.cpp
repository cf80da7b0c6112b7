// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "process_heard.hpp"

#include "trigpoint/base/time.hpp"
#include "trigpoint/bus/bus.hpp"
#include "trigpoint/bus/loop.hpp"
#include "trigpoint/bus/topics.hpp"

#include <chrono>

namespace trigpoint::recording {

bool is_heard(const bus::Config& config, const std::set<unsigned>& processes, double patience_s) {
  bus::Loop loop;
  bus::Participant participant(config, "doctor");
  bool heard = false;
  const auto listen = [&](const diagnostic_msgs::msg::DiagnosticArray&,
                          const bus::MessageInfo& info) {
    loop.post(
        [&, writer = info.writer_guid] {
          const auto process = participant.process_of(writer);
          if (process && processes.contains(*process)) {
            heard = true;
            loop.stop();
          }
        },
        bus::WhenFull::kDropOldest);
  };
  const bus::Subscription diagnostics(participant, bus::topics::diagnostics, listen);
  const bus::Subscription clocks(participant, bus::topics::clock_probe, listen);
  loop.every(std::chrono::nanoseconds(from_seconds(patience_s)), [&loop] { loop.stop(); });
  loop.run();
  return heard;
}

}  // namespace trigpoint::recording
