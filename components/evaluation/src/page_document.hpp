// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>
#include <vector>

namespace trigpoint::evaluation {

/// What differs between the pages that we write.
struct PageDocument {
  std::string title;                 ///< text
  std::string body;                  ///< HTML
  std::vector<std::string> scripts;  ///< run in this order behind the body
};

/// A whole page in our style. Its content security policy forbids every load, even from the page's
/// own folder; pictures are data URLs.
std::string html_of(const PageDocument& page);

}  // namespace trigpoint::evaluation
