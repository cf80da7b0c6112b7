// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "told_once.hpp"

namespace trigpoint::cli {

void ToldOnce::operator()(const Event& event) {
  if (event.severity == Severity::kInfo || ++seen_[event.code] == 1) {
    tell_(event);
  }
}

std::string ToldOnce::summary() const {
  std::string text;
  for (const auto& [code, count] : seen_) {
    if (count > 1) {
      text += "  " + code + ": " + std::to_string(count - 1) + " more like this\n";
    }
  }
  return text;
}

}  // namespace trigpoint::cli
