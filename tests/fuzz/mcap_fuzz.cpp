// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP files that were whole before bytes of them were changed, cut, doubled and moved. Whatever
// comes: the reader ends, with LogError or without, delivers in order of time, and takes no more
// memory than a file of that size can need.
// With clang a libFuzzer target (preset "fuzz"), whose input is the file. Else a program of its own
// that draws changes:
//   mcap_fuzz [FILES] [SEED] [FIRST]
// Each is drawn from the seed and its number alone.
#include "trigpoint/recording/log.hpp"

#include "mcap_chunk.hpp"
#include "mcap_file.hpp"
#include "mcap_format.hpp"
#include <lz4frame.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using namespace trigpoint;
using namespace trigpoint::recording;
using Content = std::vector<std::uint8_t>;

constexpr Nanoseconds kStart_ns = 1'700'000'000LL * kNanosecondsPerSecond;
/// The most that a process may take: 4 KiB can claim to become some 170 MB of zstd.
constexpr long kMemory_kb = 700'000;

/// What the files have reached: a fuzz that the first check turns away would show nothing.
struct Reached {
  std::uint64_t files{0};
  std::uint64_t opened{0};
  std::uint64_t messages{0};
  std::uint64_t ended_well{0};
};

Reached& reached() {
  static Reached total;
  return total;
}

struct TemporaryFile {
  std::filesystem::path path{std::filesystem::temp_directory_path() /
                             ("trigpoint_fuzz_" + std::to_string(::getpid()) + ".mcap")};

  ~TemporaryFile() {
    std::error_code ignored;
    std::filesystem::remove(path, ignored);
  }
};

void read(BagFile& file) {
  std::set<std::string> topics;
  for (const TopicSummary& topic : file.topics()) {
    topics.insert(topic.topic);
  }
  file.ros1_topics();
  file.select(topics);
  Nanoseconds before_ns = 0;
  while (const auto raw = file.next()) {
    if (raw->receive_ns < before_ns) {
      throw std::runtime_error("a message comes before its time");
    }
    before_ns = raw->receive_ns;
    ++reached().messages;
  }
}

void add_definitions(mcap::RecordWriter& file) {
  file.schema({1, "sensor_msgs/msg/Imu", "ros2msg", "float64 x\n"});
  for (std::uint16_t id = 1; id <= 2; ++id) {
    file.channel(
        {id, 1, "/topic" + std::to_string(id), "cdr", {{"offered_qos_profiles", "- history: 1"}}});
  }
}

void add_messages(mcap::RecordWriter& file, int first) {
  for (int i = first; i < first + 5; ++i) {
    const Content data(20, static_cast<std::uint8_t>(i));
    const Nanoseconds time_ns = kStart_ns + (i ^ 2) * kNanosecondsPerSecond;
    file.message({static_cast<std::uint16_t>(1 + i % 2), 0, time_ns, time_ns}, data);
  }
}

Content lz4(const Content& records) {
  Content stored(LZ4F_compressFrameBound(records.size(), nullptr));
  stored.resize(
      LZ4F_compressFrame(stored.data(), stored.size(), records.data(), records.size(), nullptr));
  return stored;
}

/// `compression` "-": without chunks.
Content whole_file(const std::string& compression, bool with_summary, bool with_crc) {
  mcap::RecordWriter file;
  file.bytes(mcap::kMagic);
  file.header({"ros2", "fuzz"});
  std::vector<mcap::ChunkIndex> chunks;
  for (int first = 0; first < 15; first += 5) {
    mcap::RecordWriter records;
    if (first == 0) {
      add_definitions(records);
    }
    add_messages(records, first);
    if (compression == "-") {
      file.bytes(records.content());
      continue;
    }
    mcap::ChunkHead head{kStart_ns + first * kNanosecondsPerSecond,
                         kStart_ns + (first + 7) * kNanosecondsPerSecond,
                         records.content().size(),
                         with_crc ? mcap::crc32_of(records.content()) : 0,
                         compression,
                         0};
    const auto begin = file.content().size();
    const Content stored = compression == "zstd"  ? mcap::compressed(records.content())
                           : compression == "lz4" ? lz4(records.content())
                                                  : records.content();
    file.chunk(head, stored);
    const auto length = file.content().size() - begin;
    file.message_index(1, {{kStart_ns, 0}});
    chunks.push_back({head.first_ns,
                      head.last_ns,
                      begin,
                      length,
                      {},
                      0,
                      compression,
                      stored.size(),
                      records.content().size()});
  }
  file.data_end(with_crc ? mcap::crc32_of(file.content()) : 0);
  const auto summary = file.content().size();
  if (with_summary) {
    add_definitions(file);
    mcap::Statistics statistics;
    statistics.messages = 15;
    statistics.channels = 2;
    statistics.channel_messages = {{1, 8}, {2, 7}};
    statistics.first_ns = kStart_ns;
    statistics.last_ns = kStart_ns + 15 * kNanosecondsPerSecond;
    file.statistics(statistics);
    for (const auto& chunk : chunks) {
      file.chunk_index(chunk);
    }
  }
  file.footer({with_summary ? summary : 0, 0, 0});
  file.bytes(mcap::kMagic);
  return file.content();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const TemporaryFile file;
  std::ofstream(file.path, std::ios::binary)
      .write(reinterpret_cast<const char*>(data), static_cast<std::streamsize>(size));
  ++reached().files;
  try {
    const auto bag = open_mcap_file(file.path, 500);
    ++reached().opened;
    read(*bag);
    ++reached().ended_well;
  } catch (const LogError&) {
    // Said so.
  }
  return 0;
}

#ifndef TRIGPOINT_LIBFUZZER
namespace {

void change(Content& bytes, std::mt19937_64& random) {
  const auto at = [&] { return static_cast<std::ptrdiff_t>(random() % (bytes.size() + 1)); };
  const auto stretch = [&] {
    const auto begin = at();
    return std::pair(
        begin,
        std::min<std::ptrdiff_t>(begin + static_cast<std::ptrdiff_t>(1 + random() % 64),
                                 static_cast<std::ptrdiff_t>(bytes.size())));
  };
  switch (random() % 6) {
    case 0:
      bytes.resize(static_cast<std::size_t>(at()));
      break;
    case 1: {
      const auto [begin, end] = stretch();
      bytes.erase(bytes.begin() + begin, bytes.begin() + end);
      break;
    }
    case 2: {
      const auto [begin, end] = stretch();
      const Content copy(bytes.begin() + begin, bytes.begin() + end);
      bytes.insert(bytes.begin() + at(), copy.begin(), copy.end());
      break;
    }
    case 3: {  // a length or an offset
      const std::uint64_t number = ~0ULL >> (random() % 64);
      const auto begin = static_cast<std::size_t>(at());
      for (std::size_t i = 0; i < 8 && begin + i < bytes.size(); ++i) {
        bytes[begin + i] = static_cast<std::uint8_t>(number >> (8 * i));
      }
      break;
    }
    default:
      if (!bytes.empty()) {
        bytes[random() % bytes.size()] ^= static_cast<std::uint8_t>(1U << (random() % 8));
      }
  }
}

Content draw(std::uint64_t seed, std::uint64_t number) {
  static const std::array<Content, 10> kWhole{whole_file("zstd", true, true),
                                              whole_file("zstd", true, false),
                                              whole_file("zstd", false, false),
                                              whole_file("lz4", true, false),
                                              whole_file("lz4", false, true),
                                              whole_file("", true, false),
                                              whole_file("", false, false),
                                              whole_file("-", true, false),
                                              whole_file("-", true, true),
                                              whole_file("-", false, false)};
  std::seed_seq both{seed, number};
  std::mt19937_64 random(both);
  Content bytes = kWhole[number % kWhole.size()];
  for (auto changes = number < kWhole.size() ? 0 : 1 + random() % 4; changes > 0; --changes) {
    change(bytes, random);
  }
  return bytes;
}

std::uint64_t argument(int argc, char** argv, int index, std::uint64_t otherwise) {
  return argc > index ? std::strtoull(argv[index], nullptr, 10) : otherwise;
}

}  // namespace

int main(int argc, char** argv) {
  const std::uint64_t files = argument(argc, argv, 1, 1000);
  const std::uint64_t seed = argument(argc, argv, 2, 1);
  const std::uint64_t first = argument(argc, argv, 3, 0);
  std::uint64_t violations = 0;
  for (std::uint64_t number = first; number < first + files; ++number) {
    const Content bytes = draw(seed, number);
    try {
      LLVMFuzzerTestOneInput(bytes.data(), bytes.size());
    } catch (const std::exception& error) {
      ++violations;
      std::fprintf(
          stderr, "file %llu: %s\n", static_cast<unsigned long long>(number), error.what());
    }
  }
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  std::printf(
      "files %llu, opened %llu, messages %llu, read to the end without complaint %llu, "
      "violations %llu, memory %ld kB\n",
      static_cast<unsigned long long>(reached().files),
      static_cast<unsigned long long>(reached().opened),
      static_cast<unsigned long long>(reached().messages),
      static_cast<unsigned long long>(reached().ended_well),
      static_cast<unsigned long long>(violations),
      usage.ru_maxrss);
  return violations == 0 && usage.ru_maxrss < kMemory_kb ? 0 : 1;
}
#endif
