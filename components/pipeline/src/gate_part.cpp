// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "trigpoint/pipeline/session_parts.hpp"

#include "damaged_files.hpp"

#include <filesystem>
#include <stdexcept>
#include <utility>

namespace trigpoint::pipeline {

namespace file = exporter::session_file;
using exporter::path_in;

namespace {

constexpr double kRewriteAfter_s = 3.0;

}  // namespace

GatePart::GatePart(const std::string& session, exporter::Opening opening)
    : session_(session),
      trajectory_(path_in(session, file::kFused), "base_link in map, as published online", opening),
      gate_log_(path_in(session, file::kGate), opening),
      counts_(open_counts(session, "fusion_gate", opening, events_)) {
  const std::string alignment = path_in(session, file::kAlignment);
  if (opening == exporter::Opening::kContinue && std::filesystem::exists(alignment)) {
    try {
      newest_alignment_ = written_alignment_ = exporter::read_alignment(alignment);
    } catch (const std::runtime_error& damaged) {
      events_.push_back(warning_of(damaged, "going on as if it had not been there"));
    }
  }
}

Events GatePart::take_events() {
  return std::exchange(events_, {});
}

void GatePart::on_fused(const Odometry& odometry) {
  trajectory_.append(odometry.stamp_ns, odometry.T_frame_child);
}

void GatePart::on_status(const FusionStatus& status) {
  gate_log_.append(status);
  last_ = status;
}

void GatePart::on_alignment(const std::optional<Alignment>& best, bool admitted) {
  const bool was_admitted =
      newest_alignment_ && (newest_alignment_->admitted || newest_alignment_->was_admitted);
  if (best && exporter::is_known(*best)) {
    newest_alignment_ = {*best,
                         admitted,
                         admitted       ? ""
                         : was_admitted ? "not admitted by the gate; one before it was"
                                        : "not admitted by the gate",
                         was_admitted && !admitted};
  } else if (newest_alignment_ && newest_alignment_->admitted) {
    newest_alignment_->admitted = false;
    newest_alignment_->was_admitted = true;
    newest_alignment_->comment =
        best ? "not admitted any more: the mapper has not found its place in the map again"
             : "not admitted any more: odom began anew and has not been aligned since";
  }
  if (!newest_alignment_) {
    return;
  }
  const bool new_verdict =
      !written_alignment_ || written_alignment_->admitted != newest_alignment_->admitted;
  const bool due = to_seconds(last_.stamp_ns - written_ns_) >= kRewriteAfter_s;
  if (new_verdict ||
      (due && exporter::differs_substantially(*newest_alignment_, *written_alignment_))) {
    write_alignment(*newest_alignment_);
  }
}

void GatePart::write_alignment(const exporter::AlignmentRecord& record) {
  exporter::write_alignment(path_in(session_, file::kAlignment), record);
  written_alignment_ = record;
  written_ns_ = last_.stamp_ns;
}

void GatePart::keep_counts() {
  counts_.write(exporter::counts_of(last_));
}

void GatePart::close() {
  if (newest_alignment_) {
    write_alignment(*newest_alignment_);
  }
  keep_counts();
}

}  // namespace trigpoint::pipeline
