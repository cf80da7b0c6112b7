// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Rows of a rosbag2's messages out of a database that SQLite itself can't walk any more.
#pragma once

#include <cstdint>
#include <fstream>
#include <optional>
#include <string>
#include <vector>

namespace trigpoint::recording {

struct SalvagedRow {
  std::int64_t id{0};
  std::int64_t topic_id{0};
  std::int64_t timestamp_ns{0};
  std::uint64_t record_begin{0};    ///< in the file, byte
  std::uint64_t record_size{0};     ///< with what lies on overflow pages
  std::uint64_t data_in_record{0};  ///< the blob is the record's last column
};

/// Looks through every page of the file for leaves of a table (id, topic_id, timestamp, data), so
/// that it needs no page above them. SQLite's file format: https://www.sqlite.org/fileformat2.html,
/// 1.6 (b-tree pages), 2.1 (records).
class SqliteSalvage {
 public:
  explicit SqliteSalvage(const std::string& file);

  /// Those whose bytes are all there, in order of time and id.
  const std::vector<SalvagedRow>& rows() const { return rows_; }

  /// nullopt when the chain of its overflow pages is broken.
  std::optional<std::vector<std::uint8_t>> data(const SalvagedRow& row);

 private:
  std::vector<std::uint8_t> read(std::uint64_t begin, std::uint64_t size);
  void scan_page(std::uint64_t number);
  void take_cell(const std::vector<std::uint8_t>& page, std::uint64_t number, std::size_t at);
  std::uint64_t local_size(std::uint64_t record_size) const;

  std::ifstream stream_;
  std::uint64_t file_size_{0};
  std::uint64_t page_size_{0};
  std::uint64_t usable_size_{0};
  std::vector<SalvagedRow> rows_;
};

}  // namespace trigpoint::recording
