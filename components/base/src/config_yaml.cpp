// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/base/config.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <map>
#include <numeric>
#include <set>
#include <sstream>
#include <utility>

namespace trigpoint {

namespace {

/// Number of single-letter edits between two words; used only to suggest a key.
std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t substitute = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({row[j] + 1, row[j - 1] + 1, substitute});
    }
  }
  return row[b.size()];
}

/// Shortest decimal text that reads back as the same double; NaN, the default of what is not known,
/// is YAML's null.
std::string shortest_text(double value) {
  if (std::isnan(value)) {
    return "~";
  }
  std::array<char, 40> text{};
  const auto end = std::to_chars(text.data(), text.data() + text.size(), value).ptr;
  return {text.data(), end};
}

/// The same with a point, so that a whole value still shows that the field takes fractions.
std::string number_text(double value) {
  const std::string text = shortest_text(value);
  return text.find_first_of(".en~") == std::string::npos ? text + ".0" : text;
}

std::string bounds_text(const Bounds& bounds) {
  if (std::isinf(bounds.highest)) {
    return bounds.lowest == 0.0                ? "0 or more"
           : bounds.lowest == kPositive.lowest ? "more than 0"
                                               : "at least " + shortest_text(bounds.lowest);
  }
  return "between " + shortest_text(bounds.lowest) + " and " + shortest_text(bounds.highest);
}

/// Reads one mapping of one YAML file into the fields that are described to it.
class Loader final : public ConfigFields {
 public:
  Loader(const YAML::Node& node, std::string file, std::string path)
      : node_(node), file_(std::move(file)), path_(std::move(path)) {
    if (node_ && !node_.IsNull() && !node_.IsMap()) {
      throw ConfigError(file_ + ":" + std::to_string(node_.Mark().line + 1) + ": " +
                        (path_.empty() ? "the document" : path_) +
                        " must be a mapping of keys to values");
    }
    reject_repeated_keys();
  }

  void number(const std::string& key, double& value, const std::string&, Bounds bounds) override {
    read(key, value, bounds, "a number");
  }

  void integer(const std::string& key,
               std::int64_t& value,
               const std::string&,
               Bounds bounds) override {
    read(key, value, bounds, "a whole number");
  }

  void flag(const std::string& key, bool& value, const std::string&) override {
    if (const YAML::Node entry = find(key)) {
      value = as<bool>(entry, key, "true or false");
    }
  }

  void text(const std::string& key, std::string& value, const std::string&) override {
    if (const YAML::Node entry = find(key)) {
      value = as<std::string>(entry, key, "a text");
    }
  }

  void choice(const std::string& key,
              std::string& value,
              const std::string&,
              const std::vector<std::string>& choices) override {
    const YAML::Node entry = find(key);
    if (!entry) {
      return;
    }
    value = as<std::string>(entry, key, "a text");
    if (std::find(choices.begin(), choices.end(), value) == choices.end()) {
      std::string list;
      for (const std::string& each : choices) {
        list += (list.empty() ? "" : ", ") + each;
      }
      fail(entry, key, "must be one of " + list + "; is '" + value + "'");
    }
  }

  void vector3(const std::string& key,
               Eigen::Vector3d& value,
               const std::string&,
               Bounds bounds) override {
    const YAML::Node entry = find(key);
    if (!entry) {
      return;
    }
    if (!entry.IsSequence() || entry.size() != 3) {
      fail(entry, key, "must be three numbers, like [0.0, 0.0, 0.0]; is " + YAML::Dump(entry));
    }
    for (int i = 0; i < 3; ++i) {
      value[i] = as<double>(entry[i], key, "three numbers");
      check(entry, key, value[i], bounds);
    }
  }

  void texts(const std::string& key,
             std::vector<std::string>& values,
             const std::string&) override {
    const YAML::Node entry = find(key);
    if (!entry) {
      return;
    }
    if (!entry.IsSequence()) {
      fail(entry, key, "must be a list of texts; is " + YAML::Dump(entry));
    }
    values.clear();
    for (const YAML::Node& each : entry) {
      values.push_back(as<std::string>(each, key, "a list of texts"));
    }
  }

  void section(const std::string& key,
               const std::string&,
               const std::function<void(ConfigFields&)>& describe_section) override {
    const YAML::Node entry = find(key);
    Loader below(entry ? entry : YAML::Node(), file_, path_.empty() ? key : path_ + "." + key);
    describe_section(below);
    below.reject_unknown_keys();
  }

  void list(const std::string& key,
            std::size_t,
            const std::string&,
            const std::function<void(std::size_t)>& resize,
            const std::function<void(ConfigFields&, std::size_t)>& describe_item) override {
    const YAML::Node entry = find(key);
    if (!entry) {
      return;
    }
    if (!entry.IsSequence()) {
      fail(entry, key, "must be a list of mappings; is " + YAML::Dump(entry));
    }
    resize(entry.size());
    for (std::size_t i = 0; i < entry.size(); ++i) {
      const std::string item = key + "[" + std::to_string(i) + "]";
      Loader below(entry[i], file_, path_.empty() ? item : path_ + "." + item);
      describe_item(below, i);
      below.reject_unknown_keys();
    }
  }

  void other_section(const std::string& key) override { find(key); }

  void reject_unknown_keys() const {
    if (!node_ || !node_.IsMap()) {
      return;
    }
    for (const auto& pair : node_) {
      const std::string key = text_of(pair.first);
      if (!known_.contains(key)) {
        fail(pair.first, key, "is not a known key" + suggestion(key));
      }
    }
  }

 private:
  /// yaml-cpp keeps both of two equal keys and answers with the first.
  void reject_repeated_keys() const {
    if (!node_ || !node_.IsMap()) {
      return;
    }
    std::map<std::string, int> line_of;
    for (const auto& pair : node_) {
      const std::string key = text_of(pair.first);
      const auto [first, is_new] = line_of.emplace(key, pair.first.Mark().line + 1);
      if (!is_new) {
        fail(pair.first, key, "is given twice, first in line " + std::to_string(first->second));
      }
    }
  }

  static std::string text_of(const YAML::Node& key) {
    return key.IsScalar() ? key.Scalar() : YAML::Dump(key);
  }

  /// Undefined also for null: a key without a value leaves the default.
  YAML::Node find(const std::string& key) {
    known_.insert(key);
    const YAML::Node undefined(YAML::NodeType::Undefined);
    if (!node_ || !node_.IsMap()) {
      return undefined;
    }
    const YAML::Node entry = node_[key];
    return entry && entry.IsNull() ? undefined : entry;
  }

  template <typename T>
  T as(const YAML::Node& entry, const std::string& key, const std::string& what) const {
    try {
      return entry.as<T>();
    } catch (const YAML::Exception&) {
      fail(entry, key, "must be " + what + "; is '" + YAML::Dump(entry) + "'");
    }
  }

  template <typename T>
  void read(const std::string& key, T& value, Bounds bounds, const std::string& what) {
    if (const YAML::Node entry = find(key)) {
      value = as<T>(entry, key, what);
      check(entry, key, static_cast<double>(value), bounds);
    }
  }

  void check(const YAML::Node& entry,
             const std::string& key,
             double value,
             const Bounds& bounds) const {
    if (!std::isfinite(value)) {
      fail(entry, key, "must be finite; is " + YAML::Dump(entry));
    }
    if (value < bounds.lowest || value > bounds.highest) {
      fail(entry, key, "must be " + bounds_text(bounds) + "; is " + YAML::Dump(entry));
    }
  }

  [[noreturn]] void fail(const YAML::Node& at,
                         const std::string& key,
                         const std::string& what) const {
    throw ConfigError(file_ + ":" + std::to_string(at.Mark().line + 1) + ": " +
                      (path_.empty() ? "" : path_ + ".") + key + " " + what);
  }

  std::string suggestion(const std::string& key) const {
    const auto nearest = std::min_element(
        known_.begin(), known_.end(), [&key](const std::string& a, const std::string& b) {
          return edit_distance(key, a) < edit_distance(key, b);
        });
    const bool close = nearest != known_.end() &&
                       edit_distance(key, *nearest) <= std::max<std::size_t>(3, key.size() / 3);
    return close ? "; did you mean '" + *nearest + "'?" : "";
  }

  YAML::Node node_;
  std::string file_;
  std::string path_;
  std::set<std::string> known_;
};

/// Writes what is described to it as YAML.
class Printer final : public ConfigFields {
 public:
  explicit Printer(std::ostream& out, int depth = 0, bool list_item = false)
      : out_(out),
        indent_(static_cast<std::size_t>(depth) * 2, ' '),
        first_indent_(indent_),
        depth_(depth) {
    if (list_item) {
      first_indent_.replace(indent_.size() - 2, 2, "- ");
    }
  }

  void number(const std::string& key, double& value, const std::string& doc, Bounds) override {
    line(key, number_text(value), doc);
  }

  void integer(const std::string& key,
               std::int64_t& value,
               const std::string& doc,
               Bounds) override {
    line(key, std::to_string(value), doc);
  }

  void flag(const std::string& key, bool& value, const std::string& doc) override {
    line(key, value ? "true" : "false", doc);
  }

  void text(const std::string& key, std::string& value, const std::string& doc) override {
    line(key, quoted(value), doc);
  }

  void choice(const std::string& key,
              std::string& value,
              const std::string& doc,
              const std::vector<std::string>& choices) override {
    std::string list;
    for (const std::string& each : choices) {
      list += (list.empty() ? "" : " | ") + each;
    }
    line(key, value, doc + " (" + list + ")");
  }

  void vector3(const std::string& key,
               Eigen::Vector3d& value,
               const std::string& doc,
               Bounds) override {
    line(key,
         "[" + number_text(value.x()) + ", " + number_text(value.y()) + ", " +
             number_text(value.z()) + "]",
         doc);
  }

  void texts(const std::string& key,
             std::vector<std::string>& values,
             const std::string& doc) override {
    std::string list;
    for (const std::string& each : values) {
      list += (list.empty() ? "" : ", ") + quoted(each);
    }
    line(key, "[" + list + "]", doc);
  }

  void section(const std::string& key,
               const std::string& doc,
               const std::function<void(ConfigFields&)>& describe_section) override {
    out_ << (depth_ == 0 ? "\n" : "") << next_indent() << key << ":  # " << doc << "\n";
    Printer below(out_, depth_ + 1);
    describe_section(below);
  }

  void list(const std::string& key,
            std::size_t size,
            const std::string& doc,
            const std::function<void(std::size_t)>&,
            const std::function<void(ConfigFields&, std::size_t)>& describe_item) override {
    out_ << (depth_ == 0 ? "\n" : "") << next_indent() << key << ":" << (size == 0 ? " []" : "")
         << "  # " << doc << "\n";
    for (std::size_t i = 0; i < size; ++i) {
      Printer below(out_, depth_ + 2, true);
      describe_item(below, i);
    }
  }

  void other_section(const std::string&) override {}

 private:
  static std::string quoted(const std::string& text) {
    YAML::Emitter emitter;
    emitter << YAML::DoubleQuoted << text;
    return emitter.c_str();
  }

  void line(const std::string& key, const std::string& value, const std::string& doc) {
    out_ << next_indent() << key << ": " << value << "  # " << doc << "\n";
  }

  /// The first line of a list's item carries its dash.
  std::string next_indent() { return std::exchange(first_indent_, indent_); }

  std::ostream& out_;
  std::string indent_;
  std::string first_indent_;
  int depth_;
};

/// Throws ConfigError when there is a second document, whose keys would count for nothing.
YAML::Node parse(const std::function<std::vector<YAML::Node>()>& load, const std::string& name) {
  try {
    const std::vector<YAML::Node> documents = load();
    if (documents.size() > 1) {
      throw ConfigError(name + ":" + std::to_string(documents[1].Mark().line + 1) +
                        ": a second document begins after ---, one is expected");
    }
    return documents.empty() ? YAML::Node() : documents.front();
  } catch (const YAML::BadFile&) {
    throw ConfigError(name + ": cannot be read: no such file, or no permission");
  } catch (const YAML::Exception& error) {
    throw ConfigError(name + ":" + std::to_string(error.mark.line + 1) +
                      ": is not YAML: " + error.msg);
  }
}

void visit(const YAML::Node& root,
           const std::string& name,
           const std::function<void(ConfigFields&)>& document) {
  Loader loader(root, name, "");
  document(loader);
  loader.reject_unknown_keys();
}

}  // namespace

void load_config(const std::vector<std::string>& files,
                 const std::function<void(ConfigFields&)>& document) {
  for (const std::string& file : files) {
    if (std::error_code ignored; std::filesystem::is_directory(file, ignored)) {
      throw ConfigError(file + ": is a folder; a YAML file is expected");
    }
    visit(parse([&file] { return YAML::LoadAllFromFile(file); }, file), file, document);
  }
}

void load_config_text(const std::string& yaml,
                      const std::string& name,
                      const std::function<void(ConfigFields&)>& document) {
  visit(parse([&yaml] { return YAML::LoadAll(yaml); }, name), name, document);
}

std::string print_config(const std::function<void(ConfigFields&)>& document) {
  std::ostringstream out;
  Printer printer(out);
  document(printer);
  return out.str();
}

}  // namespace trigpoint
