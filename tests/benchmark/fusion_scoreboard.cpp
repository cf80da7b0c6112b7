// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "fusion_scoreboard.hpp"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

namespace trigpoint::fusion_table {

namespace {

std::string text_of(double value) {
  char text[32];
  std::snprintf(text, sizeof text, std::abs(value) < 10.0 ? "%.3f" : "%.1f", value);
  return std::isnan(value) ? "-" : text;
}

double mean_of(const std::vector<Figure>& figures) {
  double sum = 0.0;
  for (const Figure& figure : figures) {
    sum += figure.value;
  }
  return sum / static_cast<double>(figures.size());
}

/// NaN, an error that could not even be measured, is worse than any number.
double worst_of(const std::vector<Figure>& figures) {
  double worst = -HUGE_VAL;
  for (const Figure& figure : figures) {
    worst = std::isnan(figure.value) ? figure.value : std::max(worst, figure.value);
    if (std::isnan(worst)) {
      break;
    }
  }
  return worst;
}

bool is_judged(const std::vector<Figure>& figures) {
  return std::any_of(
      figures.begin(), figures.end(), [](const Figure& figure) { return figure.is_judged(); });
}

std::string text_of(const Bound& bound) {
  if (bound.lowest && bound.highest) {
    return text_of(*bound.lowest) + " to " + text_of(*bound.highest);
  }
  return bound.highest ? text_of(*bound.highest) : "";
}

/// The bounds of all seeds and modes: one, or from the least to the largest.
std::string bounds_of(const std::map<std::string, std::vector<Figure>>& by_mode) {
  std::optional<Figure> least;
  std::optional<Figure> most;
  for (const auto& [mode, figures] : by_mode) {
    for (const Figure& figure : figures) {
      if (!figure.bound.highest) {
        continue;
      }
      least = !least || *figure.bound.highest < *least->bound.highest ? figure : least;
      most = !most || *figure.bound.highest > *most->bound.highest ? figure : most;
    }
  }
  if (!least) {
    return "";
  }
  const std::string low = text_of(least->bound);
  const std::string high = text_of(most->bound);
  return low == high ? low : low + " to " + high;
}

std::string cell_of(const std::vector<Figure>& figures, bool met) {
  std::string cell = text_of(mean_of(figures)) + " / " + text_of(worst_of(figures));
  if (!is_judged(figures)) {
    return cell;
  }
  if (figures.front().judged_by_mean || met) {
    return cell + (met ? " met" : " NOT");
  }
  const auto n = std::count_if(
      figures.begin(), figures.end(), [](const Figure& figure) { return figure.is_met(); });
  return cell + " NOT (" + std::to_string(n) + " of " + std::to_string(figures.size()) + ")";
}

std::string quoted(const std::string& text) {
  std::string result = "\"";
  for (const char c : text) {
    result += c == '"' ? "\"\"" : std::string(1, c);
  }
  return result + "\"";
}

}  // namespace

Scoreboard::Scoreboard(std::vector<std::string> modes, const std::string& csv)
    : modes_(std::move(modes)) {
  if (csv.empty()) {
    return;
  }
  csv_.open(csv);
  csv_ << "scenario,mode,seed,figure,value,lowest,highest,met,words,detail\n";
  csv_.flush();
  if (!csv_) {
    throw std::runtime_error(csv +
                             ": cannot be written (does the folder exist, is the disk full?)");
  }
}

const Scoreboard::Group* Scoreboard::group_of(const Row& row) const {
  const auto found = std::find_if(groups_.begin(), groups_.end(), [&](const Group& group) {
    return group.scenario == row.scenario && group.what == row.what;
  });
  return found == groups_.end() ? nullptr : &*found;
}

Scoreboard::Line& Scoreboard::line_of(const Row& row, const std::string& name) {
  if (group_of(row) == nullptr) {
    groups_.push_back({row.scenario, row.what, {}});
  }
  auto& lines = groups_[static_cast<std::size_t>(group_of(row) - groups_.data())].lines;
  const auto found =
      std::find_if(lines.begin(), lines.end(), [&](const Line& line) { return line.name == name; });
  if (found != lines.end()) {
    return *found;
  }
  lines.push_back({name, {}});
  return lines.back();
}

void Scoreboard::add(const Row& row,
                     const std::string& mode,
                     std::uint64_t seed,
                     const Figures& figures) {
  for (const Figure& figure : figures) {
    line_of(row, figure.name).by_mode[mode].push_back(figure);
    if (csv_.is_open()) {
      const auto number = [](const std::optional<double>& value) {
        return value ? std::to_string(*value) : std::string();
      };
      csv_ << quoted(row.scenario) << ',' << mode << ',' << seed << ',' << quoted(figure.name)
           << ',' << figure.value << ',' << number(figure.bound.lowest) << ','
           << number(figure.bound.highest) << ','
           << (figure.is_judged() ? (figure.is_met() ? "yes" : "no") : "") << ','
           << quoted(figure.words) << ',' << quoted(figure.detail) << '\n';
    }
  }
  csv_.flush();
}

bool Scoreboard::is_met(const std::vector<Figure>& figures) {
  if (figures.front().judged_by_mean) {
    return figures.front().bound.holds(mean_of(figures));
  }
  return std::all_of(figures.begin(), figures.end(), [](const Figure& figure) {
    return !figure.is_judged() || figure.is_met();
  });
}

std::string Scoreboard::head() const {
  std::string head = "| scenario | figure (mean / worst over the seeds) | bound |";
  std::string rule = "|---|---|---|";
  for (const std::string& mode : modes_) {
    head += " " + mode + " |";
    rule += "---|";
  }
  return head + "\n" + rule + "\n";
}

std::string Scoreboard::print(const Row& row) const {
  std::string text;
  const Group* group = group_of(row);
  if (group == nullptr) {
    return text;
  }
  for (const Line& line : group->lines) {
    const bool first = &line == &group->lines.front();
    text += "| " + (first ? group->scenario + ": " + group->what : std::string()) + " | " +
            line.name + " | " + bounds_of(line.by_mode) + " |";
    for (const std::string& mode : modes_) {
      const auto found = line.by_mode.find(mode);
      text += found == line.by_mode.end()
                  ? std::string(" |")
                  : " " + cell_of(found->second, is_met(found->second)) + " |";
    }
    text += "\n";
  }
  return text;
}

std::string Scoreboard::print_words(const Row& row) const {
  std::string text;
  const Group* group = group_of(row);
  for (const Line& line : group != nullptr ? group->lines : std::vector<Line>{}) {
    for (const auto& [mode, figures] : line.by_mode) {
      const auto said = std::find_if(figures.begin(), figures.end(), [](const Figure& figure) {
        return !figure.words.empty();
      });
      if (said != figures.end()) {
        text += "- " + row.scenario + ", " + mode + ", " + line.name + ": " + said->words + "\n";
      }
    }
  }
  return text;
}

std::string Scoreboard::print_ratios(const std::string& mode) const {
  std::string text = "| mean of " + mode + " over that of |";
  std::string rule = "|---|";
  for (const std::string& other : modes_) {
    text += other == mode ? "" : " " + other + " |";
    rule += other == mode ? "" : "---|";
  }
  text += "\n" + rule + "\n";
  for (const Group& group : groups_) {
    for (const Line& line : group.lines) {
      const auto ours = line.by_mode.find(mode);
      // Errors only: counts may be zero, and ANEES is not the better the smaller.
      if (ours == line.by_mode.end() || ours->second.front().judged_by_mean ||
          bounds_of(line.by_mode).empty() || ours->second.front().bound.highest == 0.0) {
        continue;
      }
      text += "| " + group.scenario + ", " + line.name + " |";
      for (const std::string& other : modes_) {
        const auto theirs = line.by_mode.find(other);
        if (other != mode) {
          text += " " +
                  (theirs == line.by_mode.end()
                       ? std::string()
                       : text_of(mean_of(ours->second) / mean_of(theirs->second))) +
                  " |";
        }
      }
      text += "\n";
    }
  }
  return text;
}

std::string Scoreboard::print_summary() const {
  std::string text;
  for (const std::string& mode : modes_) {
    int judged = 0;
    int met = 0;
    for (const Group& group : groups_) {
      for (const Line& line : group.lines) {
        const auto found = line.by_mode.find(mode);
        if (found != line.by_mode.end() && is_judged(found->second)) {
          ++judged;
          met += is_met(found->second) ? 1 : 0;
        }
      }
    }
    text += mode + ": " + std::to_string(met) + " of " + std::to_string(judged) +
            " bounds met with every seed\n";
  }
  return text;
}

}  // namespace trigpoint::fusion_table
