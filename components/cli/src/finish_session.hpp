// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#pragma once

#include <string>

namespace trigpoint::cli {

/// Throws ConfigError when `folder` is no session: whoever named it meant another.
void refuse_other_folder(const std::string& folder);

/// Renders map.pcd from the keyframes and writes report.md with its pictures; prints the table.
/// Returns an exit code.
int finish_session(const std::string& session);

}  // namespace trigpoint::cli
