// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include "trigpoint/base/messages.hpp"
#include "trigpoint/bus/participant_of.hpp"

#include <map>
#include <optional>
#include <string>
#include <utility>

namespace trigpoint::gps_odometry {

/// What other programs on the bus say of where the vehicle is, joined with the datum that they name
/// elsewhere (gps/status of a filter, `datum` of the gate). Told apart by participant.
class OtherFilters {
 public:
  struct Heard {
    Odometry odometry;
    std::string datum_id;
  };

  std::optional<Heard> on_odometry(const std::string& writer_guid, Odometry odometry) {
    Said& said = said_[bus::participant_of(writer_guid)];
    said.odometry = std::move(odometry);
    return joined(said);
  }

  /// What is published here: the gate hands it back.
  void on_own_odometry(Nanoseconds stamp_ns) { own_since_ns_ = own_since_ns_.value_or(stamp_ns); }

  /// What the gate follows or, from a filter that has died, keeps. From our first odometry on it
  /// may be ours; a filter that lives is heard by itself.
  std::optional<Heard> on_selected(const std::string& writer_guid, Odometry odometry) {
    if (own_since_ns_ && odometry.stamp_ns >= *own_since_ns_) {
      return std::nullopt;
    }
    return on_odometry(writer_guid, std::move(odometry));
  }

  std::optional<Heard> on_datum_id(const std::string& writer_guid, const std::string& id) {
    Said& said = said_[bus::participant_of(writer_guid)];
    said.datum_id = id;
    return joined(said);
  }

 private:
  struct Said {
    std::optional<Odometry> odometry;
    std::string datum_id;
  };

  static std::optional<Heard> joined(const Said& said) {
    if (!said.odometry || said.datum_id.empty()) {
      return std::nullopt;
    }
    return Heard{*said.odometry, said.datum_id};
  }

  std::map<std::string, Said> said_;
  std::optional<Nanoseconds> own_since_ns_;
};

}  // namespace trigpoint::gps_odometry
