// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace trigpoint::evaluation::html {

/// Text as it may stand between tags and in a quoted attribute.
std::string escape(const std::string& text);

/// What the sections of report.md are made of, as HTML: headings, paragraphs, lists, tables, and in
/// them **bold**, `code` and [links](to files of the session). Everything else is text and escaped;
/// a link that leaves the session's folder becomes text. `##` is h2.
std::string of_markdown(const std::string& markdown);

/// RFC 4648, without line breaks.
std::string base64(const std::uint8_t* bytes, std::size_t size);

template <typename Value>
std::string base64(const std::vector<Value>& values) {
  return base64(reinterpret_cast<const std::uint8_t*>(values.data()),
                values.size() * sizeof(Value));
}

}  // namespace trigpoint::evaluation::html
