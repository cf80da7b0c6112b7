// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Strict configuration: a struct with defaults lists its fields once in
// `void describe(Config&, ConfigFields&)`, and that one list loads it from YAML, prints it and
// documents it. Keys nobody asked for, wrong types and values out of range are errors.
#pragma once

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

namespace trigpoint {

/// What is wrong in a configuration, with file, line, key and rule.
class ConfigError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Closed interval that a number must lie in.
struct Bounds {
  double lowest{-std::numeric_limits<double>::infinity()};
  double highest{std::numeric_limits<double>::infinity()};
};

inline constexpr Bounds kPositive{std::numeric_limits<double>::min()};
inline constexpr Bounds kNotNegative{0.0};

/// A visitor of named, documented fields. Keys equal the member's name, unit included.
class ConfigFields {
 public:
  virtual ~ConfigFields() = default;

  virtual void number(const std::string& key,
                      double& value,
                      const std::string& doc,
                      Bounds bounds = {}) = 0;
  virtual void integer(const std::string& key,
                       std::int64_t& value,
                       const std::string& doc,
                       Bounds bounds = {}) = 0;
  virtual void flag(const std::string& key, bool& value, const std::string& doc) = 0;
  virtual void text(const std::string& key, std::string& value, const std::string& doc) = 0;
  /// `value` must be one of `choices`.
  virtual void choice(const std::string& key,
                      std::string& value,
                      const std::string& doc,
                      const std::vector<std::string>& choices) = 0;
  /// A sequence of exactly three numbers.
  virtual void vector3(const std::string& key,
                       Eigen::Vector3d& value,
                       const std::string& doc,
                       Bounds bounds = {}) = 0;
  /// A sequence of any length.
  virtual void texts(const std::string& key,
                     std::vector<std::string>& values,
                     const std::string& doc) = 0;
  /// A mapping below this one.
  virtual void section(const std::string& key,
                       const std::string& doc,
                       const std::function<void(ConfigFields&)>& describe_section) = 0;
  /// A sequence of mappings, which replaces the default as a whole: loading calls `resize` with the
  /// number of items in the file, then `describe_item` for each; printing describes `size` items.
  virtual void list(const std::string& key,
                    std::size_t size,
                    const std::string& doc,
                    const std::function<void(std::size_t)>& resize,
                    const std::function<void(ConfigFields&, std::size_t)>& describe_item) = 0;
  /// A mapping that another program reads: allowed, and left alone.
  virtual void other_section(const std::string& key) = 0;
};

/// Every section of the one configuration document, in the order of its print.
inline constexpr std::array<const char*, 6> kConfigSections{
    "robot", "bus", "gps_odometry", "lio_mapper", "fusion_gate", "log"};

/// `document` visits every section of the program's configuration. Values in `files` overwrite
/// the defaults, later files win. Throws ConfigError naming file, line, key, rule and nearest key.
void load_config(const std::vector<std::string>& files,
                 const std::function<void(ConfigFields&)>& document);

/// The same for YAML text; `name` stands for the file in errors.
void load_config_text(const std::string& yaml,
                      const std::string& name,
                      const std::function<void(ConfigFields&)>& document);

/// YAML with every key, its value and its documentation as a comment.
std::string print_config(const std::function<void(ConfigFields&)>& document);

}  // namespace trigpoint
