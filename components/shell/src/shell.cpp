// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/shell/shell.hpp"

#include <CLI/CLI.hpp>

#include <exception>
#include <iostream>

namespace trigpoint::shell {

void load_sections(const std::vector<std::string>& files, const Sections& own) {
  load_config(files, [&own](ConfigFields& fields) {
    for (const char* name : kConfigSections) {
      const auto mine = own.find(name);
      if (mine == own.end()) {
        fields.other_section(name);
      } else {
        fields.section(name, "", mine->second);
      }
    }
  });
}

int run_program(int argc,
                char** argv,
                const std::string& name,
                const std::string& description,
                const std::function<int(const Options&, const EventLog&)>& body) {
  Options options;
  CLI::App app{description, name};
  app.add_option("--config",
                 options.config_files,
                 "YAML with the keys to change (trigpoint config prints all); may be repeated, "
                 "later files win")
      ->check(CLI::ExistingFile);
  app.add_option("--session",
                 options.session,
                 "folder in which this program leaves its part of the results; none without it");
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  try {
    return body(options, EventLog(name));
  } catch (const ConfigError& error) {
    std::cerr << name << ": " << error.what() << "\n";
    return 2;
  } catch (const std::exception& error) {
    std::cerr << name << ": " << error.what() << "\n";
    return 1;
  }
}

}  // namespace trigpoint::shell
