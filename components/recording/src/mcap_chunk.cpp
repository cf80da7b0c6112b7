// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "mcap_chunk.hpp"

#include <lz4frame.h>
#include <zstd.h>

#include <memory>
#include <stdexcept>

namespace trigpoint::recording::mcap {

namespace {

/// zstd, RFC 8878, 3.1.1.2: a block of at least 3 bytes gives at most 128 KiB.
constexpr std::uint64_t kZstdBlock_bytes = 128U << 10U;
constexpr std::uint64_t kZstdBlockHead_bytes = 3;
/// LZ4: a byte of a length field stands for 255 bytes of a match.
constexpr std::uint64_t kLz4Ratio = 255;
/// The fastest: a recorder shares the computer with the robot.
constexpr int kZstdLevel = 1;

/// The most that `stored` bytes can become; 0 for a compression that is not known.
std::uint64_t largest_size(const std::string& compression, std::uint64_t stored) {
  if (compression == "zstd") {
    return (stored / kZstdBlockHead_bytes + 1) * kZstdBlock_bytes;
  }
  if (compression == "lz4") {
    return stored * kLz4Ratio;
  }
  return compression.empty() ? stored : 0;
}

std::string zstd_into(std::vector<std::uint8_t>& records, Bytes stored) {
  const std::size_t size =
      ZSTD_decompress(records.data(), records.size(), stored.data(), stored.size());
  if (ZSTD_isError(size) != 0) {
    return std::string("zstd: ") + ZSTD_getErrorName(size);
  }
  return size == records.size() ? "" : "zstd: " + std::to_string(size) + " bytes came out";
}

std::string lz4_into(std::vector<std::uint8_t>& records, Bytes stored) {
  LZ4F_dctx* context = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&context, LZ4F_VERSION)) != 0) {
    return "lz4: no memory";
  }
  const std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> owner(
      context, &LZ4F_freeDecompressionContext);
  std::size_t out = 0;
  std::size_t in = 0;
  std::size_t wanted = 1;  // 0 when the frame is at its end
  while (wanted != 0) {
    std::size_t out_now = records.size() - out;
    std::size_t in_now = stored.size() - in;
    wanted = LZ4F_decompress(
        context, records.data() + out, &out_now, stored.data() + in, &in_now, nullptr);
    if (LZ4F_isError(wanted) != 0) {
      return std::string("lz4: ") + LZ4F_getErrorName(wanted);
    }
    out += out_now;
    in += in_now;
    if (wanted != 0 && out_now == 0 && in_now == 0) {
      return "lz4: its frame does not end where the chunk does";
    }
  }
  return out == records.size() ? "" : "lz4: " + std::to_string(out) + " bytes came out";
}

std::string into(std::vector<std::uint8_t>& records, const std::string& compression, Bytes stored) {
  if (compression == "zstd") {
    return zstd_into(records, stored);
  }
  if (compression == "lz4") {
    return lz4_into(records, stored);
  }
  records.assign(stored.begin(), stored.end());
  return "";
}

std::string refusal(const ChunkHead& head, std::uint64_t stored) {
  if (head.stored != stored) {
    return "it says that it holds " + std::to_string(head.stored) + " bytes and has " +
           std::to_string(stored);
  }
  const std::uint64_t largest = largest_size(head.compression, stored);
  if (largest == 0 && stored != 0) {
    return "its compression '" + head.compression + "' is not known here (lz4, zstd or none is)";
  }
  if (head.size > largest || head.size > kLargestChunk_bytes ||
      (head.compression.empty() && head.size != stored)) {
    return "it says that its " + std::to_string(stored) + " bytes become " +
           std::to_string(head.size);
  }
  return "";
}

}  // namespace

Unpacked unpack_chunk(Bytes record) {
  Unpacked unpacked;
  const auto head = parse_chunk_head(record);
  if (!head) {
    unpacked.problem = "it is shorter than its fields";
    return unpacked;
  }
  const Bytes stored = record.subspan(head->second);
  unpacked.problem = refusal(head->first, stored.size());
  if (!unpacked.problem.empty()) {
    return unpacked;
  }
  if (head->first.size == 0) {
    return unpacked;
  }
  unpacked.records.resize(head->first.size);
  unpacked.problem = into(unpacked.records, head->first.compression, stored);
  if (unpacked.problem.empty() && head->first.crc != 0 &&
      crc32_of(unpacked.records) != head->first.crc) {
    unpacked.problem = "its CRC does not fit its bytes";
  }
  if (!unpacked.problem.empty()) {
    unpacked.records.clear();
  }
  return unpacked;
}

std::vector<std::uint8_t> compressed(Bytes records) {
  std::vector<std::uint8_t> stored(ZSTD_compressBound(records.size()));
  const std::size_t size =
      ZSTD_compress(stored.data(), stored.size(), records.data(), records.size(), kZstdLevel);
  if (ZSTD_isError(size) != 0) {
    throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(size));
  }
  stored.resize(size);
  return stored;
}

}  // namespace trigpoint::recording::mcap
