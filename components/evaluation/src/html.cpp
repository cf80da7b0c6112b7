// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "html.hpp"

#include <algorithm>
#include <sstream>

namespace trigpoint::evaluation::html {

namespace {

bool stays_in_the_session(const std::string& target) {
  return !target.empty() && target.front() != '/' && target.find(':') == std::string::npos &&
         target.find("..") == std::string::npos;
}

/// "[text](target)" at `at`; its end, or npos when there is none.
std::size_t link_at(const std::string& line, std::size_t at, std::string& out) {
  const auto middle = line.find("](", at);
  const auto end = middle == std::string::npos ? middle : line.find(')', middle);
  if (end == std::string::npos) {
    return end;
  }
  const std::string text = line.substr(at + 1, middle - at - 1);
  const std::string target = line.substr(middle + 2, end - middle - 2);
  if (!stays_in_the_session(target)) {
    return std::string::npos;
  }
  out += "<a href=\"" + escape(target) + "\">" + escape(text) + "</a>";
  return end + 1;
}

/// What stands between two `mark`s from `at` on, in a tag; its end, or npos when there is none.
std::size_t marked_at(const std::string& line,
                      std::size_t at,
                      const std::string& mark,
                      const std::string& tag,
                      std::string& out) {
  const auto end = line.find(mark, at + mark.size());
  if (end == std::string::npos) {
    return end;
  }
  out += "<" + tag + ">" + escape(line.substr(at + mark.size(), end - at - mark.size())) + "</" +
         tag + ">";
  return end + mark.size();
}

std::string inline_of(const std::string& line) {
  std::string out;
  for (std::size_t at = 0; at < line.size();) {
    std::size_t end = std::string::npos;
    if (line[at] == '`') {
      end = marked_at(line, at, "`", "code", out);
    } else if (line.compare(at, 2, "**") == 0) {
      end = marked_at(line, at, "**", "strong", out);
    } else if (line[at] == '[') {
      end = link_at(line, at, out);
    }
    if (end == std::string::npos) {
      out += escape(line.substr(at, 1));
      end = at + 1;
    }
    at = end;
  }
  return out;
}

std::string trimmed(const std::string& text) {
  const auto from = text.find_first_not_of(' ');
  return from == std::string::npos ? "" : text.substr(from, text.find_last_not_of(' ') - from + 1);
}

std::string row_of(const std::string& line, const std::string& tag) {
  std::string cells;
  std::istringstream in(line.substr(1));
  for (std::string cell; std::getline(in, cell, '|');) {
    cells += "<" + tag + ">" + inline_of(trimmed(cell)) + "</" + tag + ">";
  }
  return "<tr>" + cells + "</tr>\n";
}

bool is_rule(const std::string& line) {
  return line.find_first_not_of("|:- ") == std::string::npos;
}

std::string table_of(const std::vector<std::string>& lines) {
  std::string text =
      "<div class=\"scroll\"><table>\n<thead>" + row_of(lines.front(), "th") + "</thead>\n<tbody>";
  for (std::size_t i = 1; i < lines.size(); ++i) {
    text += is_rule(lines[i]) ? "" : row_of(lines[i], "td");
  }
  return text + "</tbody></table></div>\n";
}

std::string list_of(const std::vector<std::string>& lines) {
  std::string text = "<ul>\n";
  for (const auto& line : lines) {
    text += "<li>" + inline_of(line.substr(2)) + "</li>\n";
  }
  return text + "</ul>\n";
}

std::string heading_of(const std::string& line) {
  const auto level = std::min<std::size_t>(line.find_first_not_of('#'), 6);
  const std::string tag = "h" + std::to_string(level);
  return "<" + tag + ">" + inline_of(trimmed(line.substr(level))) + "</" + tag + ">\n";
}

enum class Kind { kBlank, kHeading, kTable, kList, kText };

Kind kind_of(const std::string& line) {
  if (line.empty()) {
    return Kind::kBlank;
  }
  const auto hashes = line.find_first_not_of('#');
  const bool is_heading = hashes != 0 && hashes < line.size() && line[hashes] == ' ';
  return is_heading                 ? Kind::kHeading
         : line[0] == '|'           ? Kind::kTable
         : line.rfind("- ", 0) == 0 ? Kind::kList
                                    : Kind::kText;
}

std::string block_of(Kind kind, const std::vector<std::string>& lines) {
  std::string text;
  switch (kind) {
    case Kind::kBlank:
      return "";
    case Kind::kTable:
      return table_of(lines);
    case Kind::kList:
      return list_of(lines);
    case Kind::kHeading:
      for (const auto& line : lines) {
        text += heading_of(line);
      }
      return text;
    case Kind::kText:
      for (const auto& line : lines) {
        text += (text.empty() ? "" : " ") + inline_of(line);
      }
      return "<p>" + text + "</p>\n";
  }
  return text;
}

}  // namespace

std::string escape(const std::string& text) {
  std::string out;
  out.reserve(text.size());
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      case '\'':
        out += "&#39;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

std::string of_markdown(const std::string& markdown) {
  std::string out;
  std::vector<std::string> lines;
  Kind kind = Kind::kBlank;
  std::istringstream in(markdown);
  for (std::string line; std::getline(in, line);) {
    const Kind next = kind_of(line);
    if (next != kind) {
      out += block_of(kind, lines);
      lines.clear();
      kind = next;
    }
    lines.push_back(line);
  }
  return out + block_of(kind, lines);
}

std::string base64(const std::uint8_t* bytes, std::size_t size) {
  static constexpr char kDigits[] =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string out;
  out.reserve((size + 2) / 3 * 4);
  for (std::size_t i = 0; i < size; i += 3) {
    const auto byte = [&](std::size_t k) { return i + k < size ? unsigned{bytes[i + k]} : 0U; };
    const unsigned triple = byte(0) << 16U | byte(1) << 8U | byte(2);
    out += kDigits[triple >> 18U];
    out += kDigits[triple >> 12U & 63U];
    out += i + 1 < size ? kDigits[triple >> 6U & 63U] : '=';
    out += i + 2 < size ? kDigits[triple & 63U] : '=';
  }
  return out;
}

}  // namespace trigpoint::evaluation::html
