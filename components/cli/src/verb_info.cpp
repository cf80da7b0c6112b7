// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "input.hpp"
#include "verbs.hpp"

#include <iomanip>
#include <iostream>
#include <memory>

namespace trigpoint::cli {

namespace {

int run(const InputOptions& options) {
  const Input input = open_input(options);
  const recording::LogSummary& summary = input.reader->summary();
  const double duration_s = to_seconds(summary.last_ns - summary.first_ns);
  std::cout << summary.path << "\n  format    " << summary.format << "\n  begins    " << std::fixed
            << std::setprecision(3) << to_seconds(summary.first_ns) << " s\n  lasts     "
            << duration_s << " s\n  topics\n";
  for (const recording::TopicSummary& topic : summary.topics) {
    std::cout << "    " << std::left << std::setw(28) << topic.topic << " " << std::setw(34)
              << topic.type << " " << std::right << std::setw(9) << topic.messages;
    if (duration_s > 0.0) {
      std::cout << std::setprecision(1) << std::setw(9)
                << static_cast<double>(topic.messages) / duration_s << " Hz";
    }
    std::cout << "\n";
  }
  if (const auto truth = input.reader->truth_file()) {
    std::cout << "  truth     " << *truth << "\n";
  }
  for (const std::string& fault : summary.faults) {
    std::cout << "  ! " << fault << "\n";
  }
  return summary.faults.empty() ? 0 : 1;
}

}  // namespace

void add_info(CLI::App& app, Chosen& chosen) {
  CLI::App* verb =
      app.add_subcommand("info", "Tell what is in a log: topics, types, rates, duration");
  const auto options = std::make_shared<InputOptions>();
  add_input_options(*verb, *options);
  options->lenient = true;
  verb->footer(
      "Exit code 0, or 1 when the log is cut off or damaged (see the lines with '!').\n"
      "trigpoint doctor LOG reads it through and tells what is wrong with it.");
  verb->callback([options, &chosen] { chosen = [options] { return run(*options); }; });
}

}  // namespace trigpoint::cli
