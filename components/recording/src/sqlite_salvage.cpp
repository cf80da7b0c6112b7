// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Section numbers are those of SQLite's file format, https://www.sqlite.org/fileformat2.html.
#include "sqlite_salvage.hpp"

#include <algorithm>
#include <filesystem>
#include <span>
#include <tuple>

namespace trigpoint::recording {

namespace {

using PageView = std::span<const std::uint8_t>;

constexpr std::uint8_t kTableLeaf = 13;
constexpr std::size_t kFileHeader_bytes = 100;
constexpr std::size_t kLeafHeader_bytes = 8;
constexpr std::size_t kOverflowLink_bytes = 4;
constexpr std::size_t kColumns = 4;  // id, topic_id, timestamp, data

std::uint64_t big_endian(PageView bytes) {
  std::uint64_t value = 0;
  for (const std::uint8_t byte : bytes) {
    value = value << 8U | byte;
  }
  return value;
}

/// 1.6: seven bits a byte, high bits first; the ninth byte counts with all its bits. Moves `at`
/// behind it; nullopt when the bytes end before.
std::optional<std::uint64_t> take_varint(PageView bytes, std::size_t& at) {
  std::uint64_t value = 0;
  for (int i = 0; i < 9; ++i) {
    if (at >= bytes.size()) {
      return std::nullopt;
    }
    const std::uint8_t byte = bytes[at++];
    if (i == 8) {
      return value << 8U | byte;
    }
    value = value << 7U | (byte & 0x7FU);
    if ((byte & 0x80U) == 0) {
      return value;
    }
  }
  return std::nullopt;
}

/// 2.1: bytes of an integer column, or nullopt for a serial type that is none.
std::optional<std::size_t> integer_size(std::uint64_t serial_type) {
  constexpr std::size_t kSizes[] = {0, 1, 2, 3, 4, 6, 8};
  if (serial_type == 8 || serial_type == 9) {
    return 0;
  }
  return serial_type >= 1 && serial_type <= 6 ? std::optional(kSizes[serial_type]) : std::nullopt;
}

/// 2.1: two's complement, or the constants 0 and 1.
std::int64_t integer(PageView bytes, std::uint64_t serial_type) {
  if (bytes.empty()) {
    return serial_type == 9 ? 1 : 0;
  }
  const auto unused_bits = 64U - 8U * static_cast<unsigned>(bytes.size());
  return static_cast<std::int64_t>(big_endian(bytes) << unused_bits) >> unused_bits;
}

struct Columns {
  std::int64_t topic_id;
  std::int64_t timestamp_ns;
  std::uint64_t data_begin;
};

/// The columns of a message; nullopt when the record is of another table.
std::optional<Columns> parse_record(PageView record, std::uint64_t record_size) {
  std::size_t at = 0;
  const auto header_size = take_varint(record, at);
  std::uint64_t types[kColumns];
  for (std::uint64_t& type : types) {
    const auto found = take_varint(record, at);
    if (!found) {
      return std::nullopt;
    }
    type = *found;
  }
  const auto topic_size = integer_size(types[1]);
  const auto time_size = integer_size(types[2]);
  const bool is_message = types[0] == 0 && topic_size && time_size && types[3] >= 12 &&
                          types[3] % 2 == 0 && header_size == at;
  if (!is_message || at + *topic_size + *time_size > record.size()) {
    return std::nullopt;
  }
  const std::uint64_t data_begin = at + *topic_size + *time_size;
  if (data_begin + (types[3] - 12) / 2 != record_size) {
    return std::nullopt;
  }
  return Columns{integer(record.subspan(at, *topic_size), types[1]),
                 integer(record.subspan(at + *topic_size, *time_size), types[2]),
                 data_begin};
}

}  // namespace

SqliteSalvage::SqliteSalvage(const std::string& file)
    : stream_(file, std::ios::binary), file_size_(std::filesystem::file_size(file)) {
  const auto header = read(0, kFileHeader_bytes);
  if (header.size() < kFileHeader_bytes) {
    return;
  }
  // 1.3: the value 1 stands for 65536; a part of every page may be reserved.
  page_size_ = big_endian(PageView(header).subspan(16, 2));
  page_size_ = page_size_ == 1 ? 65536 : page_size_;
  if (page_size_ < 512 || header[20] >= page_size_ / 2) {
    return;
  }
  usable_size_ = page_size_ - header[20];
  for (std::uint64_t number = 2; number * page_size_ <= file_size_; ++number) {
    scan_page(number);
  }
  std::erase_if(rows_, [this](const SalvagedRow& row) { return !data(row); });
  const auto order = [](const SalvagedRow& row) { return std::tuple(row.timestamp_ns, row.id); };
  std::sort(rows_.begin(), rows_.end(), [&](const SalvagedRow& a, const SalvagedRow& b) {
    return order(a) < order(b);
  });
  // A page that was given up may still hold an older copy of a row.
  rows_.erase(
      std::unique(rows_.begin(),
                  rows_.end(),
                  [&](const SalvagedRow& a, const SalvagedRow& b) { return order(a) == order(b); }),
      rows_.end());
}

std::vector<std::uint8_t> SqliteSalvage::read(std::uint64_t begin, std::uint64_t size) {
  if (begin > file_size_ || size > file_size_ - begin) {
    return {};
  }
  std::vector<std::uint8_t> bytes(size);
  stream_.clear();
  stream_.seekg(static_cast<std::streamoff>(begin));
  stream_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(size));
  return stream_ ? bytes : std::vector<std::uint8_t>{};
}

void SqliteSalvage::scan_page(std::uint64_t number) {
  const auto page = read((number - 1) * page_size_, page_size_);
  if (page.empty() || page[0] != kTableLeaf) {
    return;
  }
  const std::size_t cells = big_endian(PageView(page).subspan(3, 2));
  for (std::size_t i = 0; i < cells && kLeafHeader_bytes + 2 * i + 2 <= page.size(); ++i) {
    take_cell(page, number, big_endian(PageView(page).subspan(kLeafHeader_bytes + 2 * i, 2)));
  }
}

void SqliteSalvage::take_cell(const std::vector<std::uint8_t>& page,
                              std::uint64_t number,
                              std::size_t at) {
  const auto record_size = take_varint(page, at);
  const auto id = record_size ? take_varint(page, at) : std::nullopt;
  if (!id || *record_size > file_size_) {
    return;
  }
  const std::uint64_t local = local_size(*record_size);
  if (at + local > page.size()) {
    return;
  }
  if (const auto columns = parse_record(PageView(page).subspan(at, local), *record_size)) {
    rows_.push_back({static_cast<std::int64_t>(*id),
                     columns->topic_id,
                     columns->timestamp_ns,
                     (number - 1) * page_size_ + at,
                     *record_size,
                     columns->data_begin});
  }
}

/// 1.6, "B-tree Cell Format": how much of a record of P bytes is on the leaf; U, X, M, K as there.
std::uint64_t SqliteSalvage::local_size(std::uint64_t P) const {
  const std::uint64_t U = usable_size_;
  const std::uint64_t X = U - 35;
  if (P <= X) {
    return P;
  }
  const std::uint64_t M = (U - 12) * 32 / 255 - 23;
  const std::uint64_t K = M + (P - M) % (U - kOverflowLink_bytes);
  return K <= X ? K : M;
}

std::optional<std::vector<std::uint8_t>> SqliteSalvage::data(const SalvagedRow& row) {
  const std::uint64_t local = local_size(row.record_size);
  std::vector<std::uint8_t> record = read(row.record_begin, local);
  std::vector<std::uint8_t> link = local < row.record_size
                                       ? read(row.record_begin + local, kOverflowLink_bytes)
                                       : std::vector<std::uint8_t>{};
  while (record.size() < row.record_size) {
    const std::uint64_t next = big_endian(link);
    const std::uint64_t part =
        std::min(row.record_size - record.size(), usable_size_ - kOverflowLink_bytes);
    const auto page = next == 0 ? std::vector<std::uint8_t>{}
                                : read((next - 1) * page_size_, kOverflowLink_bytes + part);
    if (page.empty()) {
      return std::nullopt;
    }
    link.assign(page.begin(), page.begin() + kOverflowLink_bytes);
    record.insert(record.end(), page.begin() + kOverflowLink_bytes, page.end());
  }
  record.erase(record.begin(), record.begin() + static_cast<std::ptrdiff_t>(row.data_in_record));
  return record;
}

}  // namespace trigpoint::recording
