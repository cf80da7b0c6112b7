// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// All of idl/, one file after another, as a part of the program; embed_idl.cmake writes it.
#pragma once

#include <string_view>

namespace trigpoint::bus {

std::string_view embedded_idl();

}  // namespace trigpoint::bus
