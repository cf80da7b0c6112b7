// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/bus/message_definition.hpp"

#include "embedded_idl.hpp"

#include <algorithm>
#include <array>
#include <cctype>
#include <stdexcept>
#include <utility>

namespace trigpoint::bus {

namespace {

constexpr std::size_t kRuleLength = 80;  // of the line between definitions

bool is_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == ':';
}

/// Words and single signs, without comments, preprocessor lines and annotations.
std::vector<std::string> tokens_of(std::string_view text) {
  std::vector<std::string> tokens;
  const auto skip_line = [&text](std::size_t at) {
    return std::min(text.find('\n', at), text.size());
  };
  for (std::size_t at = 0; at < text.size();) {
    const char c = text[at];
    if (c == '#' || text.substr(at, 2) == "//") {
      at = skip_line(at);
    } else if (c == '@') {
      for (++at; at < text.size() && is_word(text[at]);) {
        ++at;
      }
    } else if (is_word(c)) {
      const std::size_t begin = at;
      while (at < text.size() && is_word(text[at])) {
        ++at;
      }
      tokens.emplace_back(text.substr(begin, at - begin));
    } else {
      if (std::isspace(static_cast<unsigned char>(c)) == 0) {
        tokens.emplace_back(1, c);
      }
      ++at;
    }
  }
  return tokens;
}

/// "geometry_msgs::msg::Pose" -> "geometry_msgs/Pose"; primitives by their ROS names.
std::string ros_name(const std::string& idl_type) {
  static const std::map<std::string, std::string> primitives{
      {"double", "float64"}, {"float", "float32"}, {"boolean", "bool"}, {"octet", "uint8"}};
  const auto primitive = primitives.find(idl_type);
  if (primitive != primitives.end()) {
    return primitive->second;
  }
  const std::string inner = "::msg::";
  const std::size_t at = idl_type.find(inner);
  return at == std::string::npos
             ? idl_type
             : idl_type.substr(0, at) + "/" + idl_type.substr(at + inner.size());
}

/// ROS 2 allows no capitals in a field's name, and its readers refuse them; CDR has no names.
std::string in_small_letters(std::string name) {
  std::transform(name.begin(), name.end(), name.begin(), [](unsigned char c) {
    return static_cast<char>(std::tolower(c));
  });
  return name;
}

bool is_primitive(const std::string& type) {
  static constexpr std::array<const char*, 12> kNames{"bool",
                                                      "int8",
                                                      "uint8",
                                                      "int16",
                                                      "uint16",
                                                      "int32",
                                                      "uint32",
                                                      "int64",
                                                      "uint64",
                                                      "float32",
                                                      "float64",
                                                      "string"};
  return std::find(kNames.begin(), kNames.end(), type) != kNames.end();
}

class Parser {
 public:
  explicit Parser(std::string_view text) : tokens_(tokens_of(text)) {}

  Structs parse() {
    while (at_ < tokens_.size()) {
      package();
    }
    return std::move(structs_);
  }

 private:
  std::string next() {
    if (at_ >= tokens_.size()) {
      throw std::runtime_error("IDL ends in the middle of a definition");
    }
    return tokens_[at_++];
  }

  bool accept(const std::string& token) {
    const bool is_it = at_ < tokens_.size() && tokens_[at_] == token;
    at_ += is_it ? 1 : 0;
    return is_it;
  }

  void expect(const std::string& token) {
    const std::string found = next();
    if (found != token) {
      throw std::runtime_error("IDL: '" + token + "' expected, not '" + found + "'");
    }
  }

  void package() {
    expect("module");
    const std::string name = next();
    for (const char* token : {"{", "module", "msg", "{"}) {
      expect(token);
    }
    while (!accept("}")) {
      structure(name);
    }
    for (const char* token : {";", "}", ";"}) {
      expect(token);
    }
  }

  void structure(const std::string& package_name) {
    expect("struct");
    std::vector<Field>& fields = structs_[package_name + "/" + next()];
    expect("{");
    while (!accept("}")) {
      fields.push_back(field());
    }
    expect(";");
  }

  Field field() {
    Field field;
    if (accept("sequence")) {
      expect("<");
      field.type = ros_name(next());
      expect(">");
      field.array = "[]";
    } else {
      field.type = ros_name(next());
    }
    field.name = in_small_letters(next());
    if (accept("[")) {
      field.array = "[" + next() + "]";
      expect("]");
    }
    expect(";");
    return field;
  }

  std::vector<std::string> tokens_;
  std::size_t at_{0};
  Structs structs_;
};

const std::vector<Field>& fields_of(const Structs& structs, const std::string& type) {
  const auto found = structs.find(type);
  if (found == structs.end()) {
    throw std::runtime_error("no message type '" + type + "' in idl/");
  }
  return found->second;
}

/// Depth first, each type once, after the one that needs it.
void add_dependencies(const Structs& structs,
                      const std::string& type,
                      std::vector<std::string>& order) {
  for (const Field& field : fields_of(structs, type)) {
    if (!is_primitive(field.type) &&
        std::find(order.begin(), order.end(), field.type) == order.end()) {
      order.push_back(field.type);
      add_dependencies(structs, field.type, order);
    }
  }
}

}  // namespace

Structs parse_idl(std::string_view text) {
  return Parser(text).parse();
}

std::string message_definition(const Structs& structs, const std::string& ros_type) {
  const std::string inner = "/msg/";
  const std::size_t at = ros_type.find(inner);
  if (at == std::string::npos) {
    throw std::runtime_error("'" + ros_type + "' is no ROS 2 message type");
  }
  std::vector<std::string> order{ros_type.substr(0, at) + "/" + ros_type.substr(at + inner.size())};
  add_dependencies(structs, order.front(), order);
  std::string text;
  for (const std::string& type : order) {
    if (!text.empty()) {
      text += std::string(kRuleLength, '=') + "\nMSG: " + type + "\n";
    }
    for (const Field& field : fields_of(structs, type)) {
      text += field.type + field.array + " " + field.name + "\n";
    }
  }
  return text;
}

std::string message_definition(const std::string& ros_type) {
  static const Structs structs = parse_idl(embedded_idl());
  return message_definition(structs, ros_type);
}

}  // namespace trigpoint::bus
