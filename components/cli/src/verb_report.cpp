// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "finish_session.hpp"
#include "verbs.hpp"

#include <memory>
#include <string>

namespace trigpoint::cli {

void add_report(CLI::App& app, Chosen& chosen) {
  CLI::App* verb = app.add_subcommand(
      "report", "Render a session's map and write its report.md, report.html and pictures (anew)");
  const auto session = std::make_shared<std::string>();
  verb->add_option("SESSION", *session, "folder that bringup/run or trigpoint map has left")
      ->required()
      ->check(CLI::ExistingDirectory);
  verb->callback([session, &chosen] {
    chosen = [session] {
      refuse_other_folder(*session);
      return finish_session(*session);
    };
  });
}

}  // namespace trigpoint::cli
