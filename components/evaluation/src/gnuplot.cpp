// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "gnuplot.hpp"

#include "trigpoint/export/session.hpp"

#include <fcntl.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <stdexcept>

namespace trigpoint::evaluation {

namespace {

namespace fs = std::filesystem;

/// Starts `program script` in `folder` with both outputs in `log`; returns the exit code. Throws
/// when the program cannot be started. Without a shell, so no path needs quoting.
int run(const std::string& program,
        const std::string& folder,
        const std::string& script,
        const std::string& log) {
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_addopen(
      &actions, STDOUT_FILENO, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  ::posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
  ::posix_spawn_file_actions_addchdir_np(&actions, folder.c_str());
  std::array<std::string, 2> words{program, script};
  std::array<char*, 3> arguments{words[0].data(), words[1].data(), nullptr};
  pid_t child = 0;
  const int error =
      ::posix_spawnp(&child, program.c_str(), &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (error != 0) {
    throw std::runtime_error("cannot start " + program + " (" + std::strerror(error) +
                             "): pictures need the Debian package gnuplot-nox");
  }
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128;
}

std::string first_words_of(const std::string& file) {
  std::ifstream in(file);
  std::string text;
  constexpr std::size_t kEnough = 300;
  for (std::string line; text.size() < kEnough && std::getline(in, line);) {
    if (line.find_first_not_of(" \t^") != std::string::npos) {
      text += (text.empty() ? "" : " / ") + line;
    }
  }
  return text;
}

}  // namespace

std::string quoted(const std::string& text) {
  std::string inside;
  for (const char c : text) {
    inside += c == '\'' ? "''" : std::string(1, c);
  }
  return "'" + inside + "'";
}

void DataFile::add(const std::vector<double>& row) {
  std::string line;
  for (const double value : row) {
    if (!std::isfinite(value)) {
      text_ += "\n";
      return;
    }
    std::array<char, 40> number{};
    std::snprintf(number.data(), number.size(), "%.9g ", value);
    line += number.data();
  }
  text_ += line + "\n";
  ++rows_;
}

Picture::Picture(const std::string& folder, const std::string& name)
    : folder_(folder), name_(name) {
  exporter::create_session_folder(folder);
  fs::remove(fs::path(folder).parent_path() / (name + ".png"));  // an old one is not a new one
}

std::string Picture::data(const std::string& name, const DataFile& data) const {
  return this->data(name, data.text());
}

std::string Picture::data(const std::string& name, const std::string& bytes) const {
  exporter::write_text(exporter::path_in(folder_, name), bytes);
  return "'" + name + "'";
}

std::string Picture::draw(const std::string& gnuplot,
                          int width_px,
                          int height_px,
                          const std::string& body) const {
  const auto png = fs::path(folder_).parent_path() / (name_ + ".png");
  const std::string script = name_ + ".gp";
  std::ostringstream text;
  text << "# cd into this folder and run: gnuplot " << script << "\n"
       << "set terminal pngcairo size " << width_px << "," << height_px
       << " font 'DejaVu Sans,11' background '#ffffff'\n"
       << "set output '../" << name_ << ".png'\n"
       << body;
  exporter::write_text(exporter::path_in(folder_, script), text.str());
  const auto log = fs::absolute(exporter::path_in(folder_, name_ + ".log")).string();
  const int code = run(gnuplot, folder_, script, log);
  const auto said = first_words_of(log);
  std::error_code error;
  if (code != 0 || fs::file_size(png, error) == 0 || error) {
    throw std::runtime_error(png.string() + ": gnuplot failed with exit code " +
                             std::to_string(code) + ": " + said);
  }
  if (said.empty()) {
    fs::remove(log);
  }
  return png.string();
}

}  // namespace trigpoint::evaluation
