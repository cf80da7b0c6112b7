// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The verbs of the trigpoint command, one file each. Each adds its subcommand; the one that the
// user chose is left in `chosen` and run by main, which turns what it throws into an exit code.
#pragma once

#include <CLI/App.hpp>
#include <CLI/Config.hpp>
#include <CLI/Formatter.hpp>

#include <functional>

namespace trigpoint::cli {

/// Returns the exit code: 0 done, 1 failed, 2 wrong usage or configuration, 130
/// interrupted.
using Chosen = std::function<int()>;

void add_config(CLI::App& app, Chosen& chosen);
void add_doctor(CLI::App& app, Chosen& chosen);
void add_evaluate(CLI::App& app, Chosen& chosen);
void add_export(CLI::App& app, Chosen& chosen);
void add_gps_plots(CLI::App& app, Chosen& chosen);
void add_info(CLI::App& app, Chosen& chosen);
void add_live(CLI::App& app, Chosen& chosen);
void add_map(CLI::App& app, Chosen& chosen);
void add_merge(CLI::App& app, Chosen& chosen);
void add_play(CLI::App& app, Chosen& chosen);
void add_record(CLI::App& app, Chosen& chosen);
void add_report(CLI::App& app, Chosen& chosen);
void add_reproduce(CLI::App& app, Chosen& chosen);
void add_simulate(CLI::App& app, Chosen& chosen);

}  // namespace trigpoint::cli
