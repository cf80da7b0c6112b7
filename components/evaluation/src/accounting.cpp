// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "report_sections.hpp"
#include "table.hpp"

#include <algorithm>
#include <filesystem>
#include <map>
#include <optional>

namespace trigpoint::evaluation {

namespace {

/// What one program counted of one stream.
struct StreamCounts {
  std::map<std::string, std::uint64_t> what;     ///< in_log, published, received, used ...
  std::map<std::string, std::uint64_t> reasons;  ///< refused.<reason> and verdict.<reason>
  std::map<std::string, std::uint64_t> notes;    ///< note.<reason>: used all the same
  std::uint64_t refused{0};
  std::uint64_t verdicts{0};

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
    const std::string kind = rest.substr(0, dot);
    (kind == "note" ? result.notes : result.reasons)[rest.substr(dot + 1)] += count;
    result.refused += kind == "refused" ? count : 0;
    result.verdicts += kind == "verdict" ? count : 0;
  }
  return result;
}

std::string list_text(const std::map<std::string, std::uint64_t>& counts) {
  std::string text;
  for (const auto& [reason, count] : counts) {
    text += (text.empty() ? "" : ", ") + reason + " " + std::to_string(count);
  }
  return text;
}

/// With what could not be read at all.
std::string reasons_text(const StreamCounts& counts) {
  const auto undecodable = counts.get("undecodable").value_or(0);
  const std::string reasons = list_text(counts.reasons);
  const std::string skipped = "undecodable " + std::to_string(undecodable);
  return undecodable == 0 ? reasons : reasons.empty() ? skipped : skipped + ", " + reasons;
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
  std::vector<std::string> surplus;
  std::vector<std::string> refusals;
};

/// Of the gate: it judges each fix that was published, and each once.
void find_verdictless(const std::string& program,
                      const std::string& stream,
                      const StreamCounts& counts,
                      std::optional<std::uint64_t> sent,
                      Findings& findings) {
  const auto judged = counts.get("judged");
  if (!judged) {
    return;
  }
  if (sent && *judged != *sent) {
    findings.losses.push_back(program + " saw " + of(*judged, *sent, stream));
  }
  if (counts.verdicts != *judged) {
    findings.losses.push_back(program + " gave " + std::to_string(counts.verdicts) +
                              " verdicts on " + std::to_string(*judged) + " " + stream +
                              " messages");
  }
  if (const auto waiting = counts.reasons.find("waiting"); waiting != counts.reasons.end()) {
    findings.refusals.push_back(program + " has no verdict on " +
                                of(waiting->second, *judged, stream) +
                                ": no GPS filter told of them, or no LiDAR odometry reached them");
  }
}

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
    if (*received > *sent) {
      findings.surplus.push_back(findings.losses.back());
    }
  }
  find_verdictless(program.program, stream, counts, sent, findings);
  const auto used = counts.get("used");
  if (!used && counts.refused > 0) {
    // IMU samples are not counted one by one when they are used.
    findings.refusals.push_back(program.program + " refused " +
                                of(counts.refused, received.value_or(0), stream) + " (" +
                                list_text(counts.reasons) + ")");
  }
  if (!received || !used || (*used == *received && counts.refused == 0)) {
    return;
  }
  const std::string sentence = program.program + " used " + of(*used, *received, stream);
  if (counts.refused > 0) {
    findings.refusals.push_back(sentence + " (refused: " + list_text(counts.reasons) + ")");
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

/// A part of the session and the program that closes it with its counts.
struct ExpectedPart {
  const char* program;
  const char* log_prefix;  ///< of its log in logs/, when it ran on the bus
  std::vector<const char*> files;
};

bool has_log(const SessionData& data, const std::string& prefix) {
  std::error_code none;
  const std::filesystem::directory_iterator logs(data.path("logs"), none);
  return !none && std::any_of(begin(logs), end(logs), [&](const auto& entry) {
    return entry.path().filename().string().starts_with(prefix);
  });
}

/// A program that began its part and never closed it was killed, or crashed: what it received
/// nobody knows.
void find_missing_counts(const SessionData& data, Findings& findings) {
  namespace file = exporter::session_file;
  const std::vector<ExpectedPart> parts{
      {"gps_odometry", "trigpoint_gps_", {file::kGps, file::kGpsStatus}},
      {"lio_mapper", "trigpoint_lio_mapper", {file::kLio, file::kScans, file::kKeyframes}},
      {"fusion_gate", "trigpoint_fusion_gate", {file::kFused, file::kGate}}};
  const auto there = [&](const char* name) { return std::filesystem::exists(data.path(name)); };
  for (const ExpectedPart& part : parts) {
    const bool counted = std::any_of(data.counts.begin(), data.counts.end(), [&](const auto& c) {
      return c.program == part.program;
    });
    const bool began =
        has_log(data, part.log_prefix) || std::any_of(part.files.begin(), part.files.end(), there);
    if (began && !counted) {
      findings.losses.push_back("no counts of " + std::string(part.program) +
                                ": it ended without closing its part");
    }
  }
  if (there(file::kFixes) && !published(data, "fix")) {
    findings.losses.push_back("no counts of the log: what read it ended without closing its part");
  }
}

}  // namespace

Accounting account(const SessionData& data) {
  Findings findings;
  bool counted = false;
  for (const auto& stream : kStreams) {
    const auto sent = published(data, stream);
    counted = counted || sent;
    for (const auto& program : data.counts) {
      find_losses(program, stream, sent, findings);
    }
  }
  find_missing_counts(data, findings);
  return {counted, findings.losses, findings.surplus, findings.refusals};
}

namespace {

std::string conclude(const SessionData& data, const Accounting& found) {
  if (!found.losses.empty()) {
    return std::string("\nNOT ALL ACCOUNTED FOR") +
           (data.interrupted()       ? ", because the run was interrupted by the user"
            : !found.surplus.empty() ? ", because somebody else published into the drive"
            : !data.restarts.empty() ? ", because processes were down for a while (see Restarts)"
                                     : "") +
           ":\n\n" + list_of(found.losses) + list_of(found.refusals);
  }
  if (!found.counted) {
    return "\nNobody counted what was published: nothing can be said about losses.\n";
  }
  if (!found.refusals.empty()) {
    return "\nALL ACCOUNTED FOR: every message of the log was published and received, and used but "
           "for those refused with a reason (withheld fixes apart):\n\n" +
           list_of(found.refusals);
  }
  return "\nALL USED: every message of the log was published, received and used (withheld fixes "
         "apart).\n";
}

}  // namespace

std::string print_accounting(const SessionData& data, const Accounting& found) {
  Table table({"stream",
               "program",
               "in log",
               "withheld",
               "published",
               "received",
               "used",
               "refused",
               "reasons and verdicts",
               "used with a note"});
  for (const auto& stream : kStreams) {
    for (const auto& program : data.counts) {
      const auto counts = counts_of_stream(program, stream);
      if (counts.what.empty() && counts.reasons.empty() && counts.notes.empty()) {
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
                 reasons_text(counts),
                 list_text(counts.notes)});
    }
  }
  return "## Messages\n\n" + table.str() + conclude(data, found);
}

}  // namespace trigpoint::evaluation
