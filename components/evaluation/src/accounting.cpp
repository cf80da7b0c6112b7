// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "report_sections.hpp"
#include "table.hpp"

#include <algorithm>
#include <map>
#include <optional>

namespace trigpoint::evaluation {

namespace {

/// What one program counted of one stream.
struct StreamCounts {
  std::map<std::string, std::uint64_t> what;     ///< in_log, published, received, used ...
  std::map<std::string, std::uint64_t> reasons;  ///< refused.<reason> and verdict.<reason>
  std::uint64_t refused{0};

  std::optional<std::uint64_t> get(const std::string& name) const {
    const auto found = what.find(name);
    return found == what.end() ? std::nullopt : std::optional(found->second);
  }

  std::string text(const std::string& name) const {
    const auto count = get(name);
    return count ? std::to_string(*count) : "-";
  }
};

const std::vector<std::string> kStreams{"points", "imu", "fix"};

StreamCounts counts_of_stream(const ProgramCounts& program, const std::string& stream) {
  StreamCounts result;
  for (const auto& [name, count] : program.counts) {
    if (!name.starts_with(stream + ".")) {
      continue;
    }
    const auto rest = name.substr(stream.size() + 1);
    const auto dot = rest.find('.');
    if (dot == std::string::npos) {
      result.what[rest] += count;
      continue;
    }
    result.reasons[rest.substr(dot + 1)] += count;
    if (rest.substr(0, dot) == "refused") {
      result.refused += count;
    }
  }
  return result;
}

std::string reasons_text(const StreamCounts& counts) {
  const auto undecodable = counts.get("undecodable").value_or(0);
  std::string text = undecodable > 0 ? "undecodable " + std::to_string(undecodable) : "";
  for (const auto& [reason, count] : counts.reasons) {
    text += (text.empty() ? "" : ", ") + reason + " " + std::to_string(count);
  }
  return text;
}

std::optional<std::uint64_t> published(const SessionData& data, const std::string& stream) {
  for (const auto& program : data.counts) {
    if (const auto count = counts_of_stream(program, stream).get("published")) {
      return count;
    }
  }
  return std::nullopt;
}

std::string of(std::uint64_t part, std::uint64_t whole, const std::string& stream) {
  return std::to_string(part) + " of " + std::to_string(whole) + " " + stream + " messages";
}

/// Sentences about messages that went missing, and about those that were refused with a reason.
struct Findings {
  std::vector<std::string> losses;
  std::vector<std::string> refusals;
};

void find_losses(const ProgramCounts& program,
                 const std::string& stream,
                 std::optional<std::uint64_t> sent,
                 Findings& findings) {
  const auto counts = counts_of_stream(program, stream);
  const auto in_log = counts.get("in_log");
  const auto put_out = counts.get("published");
  const auto withheld = counts.get("withheld").value_or(0);
  const auto undecodable = counts.get("undecodable").value_or(0);
  if (in_log && put_out && *put_out + withheld + undecodable != *in_log) {
    findings.losses.push_back(program.program + " published " +
                              of(*put_out, *in_log - withheld - undecodable, stream));
  }
  if (in_log && undecodable > 0) {
    findings.refusals.push_back(program.program + " skipped " + of(undecodable, *in_log, stream) +
                                " (undecodable: damaged in the log)");
  }
  const auto received = counts.get("received");
  if (received && sent && *received != *sent) {
    findings.losses.push_back(program.program + " received " + of(*received, *sent, stream));
  }
  const auto used = counts.get("used");
  if (!received || !used || *used == *received) {
    return;
  }
  const std::string sentence = program.program + " used " + of(*used, *received, stream);
  if (counts.refused > 0) {
    findings.refusals.push_back(sentence + " (refused: " + reasons_text(counts) + ")");
  }
  if (*used + counts.refused != *received) {
    findings.losses.push_back(
        sentence + " and refused " + std::to_string(counts.refused) + ": " +
        std::to_string(static_cast<std::int64_t>(*received - *used - counts.refused)) +
        " without a counted reason");
  }
}

std::string list_of(const std::vector<std::string>& sentences) {
  std::string text;
  for (const auto& sentence : sentences) {
    text += "- " + sentence + "\n";
  }
  return text;
}

std::string conclude(const SessionData& data) {
  Findings findings;
  bool counted = false;
  for (const auto& stream : kStreams) {
    const auto sent = published(data, stream);
    counted = counted || sent;
    for (const auto& program : data.counts) {
      find_losses(program, stream, sent, findings);
    }
  }
  if (!counted) {
    return "\nNobody counted what was published: nothing can be said about losses.\n";
  }
  if (!findings.losses.empty()) {
    return "\nNOT ALL ACCOUNTED FOR:\n\n" + list_of(findings.losses) + list_of(findings.refusals);
  }
  if (!findings.refusals.empty()) {
    return "\nALL ACCOUNTED FOR: every message of the log was published and received, and used but "
           "for those refused with a reason (withheld fixes apart):\n\n" +
           list_of(findings.refusals);
  }
  return "\nALL USED: every message of the log was published, received and used (withheld fixes "
         "apart).\n";
}

}  // namespace

std::string print_accounting(const SessionData& data) {
  Table table({"stream",
               "program",
               "in log",
               "withheld",
               "published",
               "received",
               "used",
               "refused",
               "reasons and verdicts"});
  for (const auto& stream : kStreams) {
    for (const auto& program : data.counts) {
      const auto counts = counts_of_stream(program, stream);
      if (counts.what.empty() && counts.reasons.empty()) {
        continue;
      }
      table.add({stream,
                 program.program,
                 counts.text("in_log"),
                 counts.text("withheld"),
                 counts.text("published"),
                 counts.text("received"),
                 counts.text("used"),
                 std::to_string(counts.refused),
                 reasons_text(counts)});
    }
  }
  return "## Messages\n\n" + table.str() + conclude(data);
}

}  // namespace trigpoint::evaluation
