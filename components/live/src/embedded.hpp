// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Files that are part of the program; embed.cmake writes their definitions.
#pragma once

#include <string_view>

namespace trigpoint::live {

std::string_view embedded_page();  ///< page/index.html with its scripts in it

}  // namespace trigpoint::live
