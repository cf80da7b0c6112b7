// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::cli {

/// For a command that is to be copied into a shell.
std::string as_shell_word(const std::string& text);

}  // namespace trigpoint::cli
