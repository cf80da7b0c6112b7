// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// MCAP files that are cut off, overwritten or lie: never a crash, never a loss that nobody tells.
#include "mcap_chunk.hpp"
#include "mcap_drive.hpp"
#include "mcap_format.hpp"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <lz4frame.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

namespace trigpoint::recording {
namespace {

namespace fs = std::filesystem;
using mcap::Bytes;
using mcap::RecordWriter;
using testing::AllOf;
using testing::HasSubstr;

/// Few enough bytes to change each of them.
constexpr DriveSize kShort{10, 4};
constexpr std::size_t kShortMessages = 12;

std::string drive_bytes(const fs::path& scratch, int flush_every, const DriveSize& size = {}) {
  {
    Rosbag2Writer writer(scratch.string());
    write_drive(writer, flush_every, size);
  }
  return bytes_of(scratch);
}

/// Whether what was heard is the drive, or a part of it in its order.
bool is_part_of(const std::vector<std::string>& drive, const std::vector<std::string>& entries) {
  auto at = drive.begin();
  for (const std::string& entry : entries) {
    at = std::find(at, drive.end(), entry);
    if (at == drive.end()) {
      return false;
    }
    ++at;
  }
  return true;
}

TEST(McapDamage, cut_off_anywhere_it_delivers_all_whole_chunks_and_says_so) {
  TemporaryFolder folder;
  const fs::path file = folder / "a.mcap";
  const std::size_t whole_bytes = drive_bytes(file, 4, kShort).size();
  const std::vector<std::string> drive = drive_in_order(kShort);
  std::size_t most = kShortMessages;
  for (std::size_t size = whole_bytes; size-- > 0;) {
    fs::resize_file(file, size);
    const Heard heard = hear(file);
    ASSERT_TRUE(heard.complains()) << size;
    ASSERT_TRUE(is_part_of(drive, heard.entries)) << size;
    ASSERT_LE(heard.entries.size(), most) << size << ": more than with a byte more";
    ASSERT_EQ(0U, heard.entries.size() % 4) << size << ": a part of a chunk";
    if (size == whole_bytes - 1) {
      EXPECT_EQ(kShortMessages, heard.entries.size()) << "the summary alone is missing";
    }
    most = heard.entries.size();
  }
  EXPECT_EQ(0U, most);
}

TEST(McapDamage, cut_off_within_a_chunk_it_says_where) {
  TemporaryFolder folder;
  const std::string whole = drive_bytes(folder / "a.mcap", 30);
  write_bytes(folder / "a.mcap", whole.substr(0, whole.size() / 3));
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_GT(heard.entries.size(), 0U);
  EXPECT_THAT(heard.error,
              AllOf(HasSubstr("a.mcap: the file breaks off at byte "),
                    HasSubstr(" of " + std::to_string(whole.size() / 3)),
                    HasSubstr("recorder was killed")));
  ASSERT_EQ(1U, heard.faults.size());
  EXPECT_THAT(heard.faults[0], HasSubstr("breaks off"));
}

TEST(McapDamage, an_end_of_zeros_as_power_failures_leave_it_is_told) {
  TemporaryFolder folder;
  const std::string whole = drive_bytes(folder / "a.mcap", 30);
  write_bytes(folder / "a.mcap", whole.substr(0, whole.size() / 3) + std::string(100'000, '\0'));
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_GT(heard.entries.size(), 0U);
  EXPECT_TRUE(is_part_of(drive_in_order(), heard.entries));
  EXPECT_NE("", heard.error);
}

/// Our files have a CRC over every byte, so every change must be seen.
TEST(McapDamage, a_byte_changed_anywhere_is_told_and_changes_no_message) {
  TemporaryFolder folder;
  const fs::path file = folder / "a.mcap";
  const std::string whole = drive_bytes(file, 4, kShort);
  const std::vector<std::string> drive = drive_in_order(kShort);
  std::fstream stream(file, std::ios::binary | std::ios::in | std::ios::out);
  const auto put = [&](std::size_t at, char byte) {
    stream.seekp(static_cast<std::streamoff>(at));
    stream.put(byte);
    stream.flush();
  };
  for (std::size_t at = 0; at < whole.size(); ++at) {
    put(at, static_cast<char>(whole[at] ^ (1 << (at % 8))));
    const Heard heard = hear(file);
    put(at, whole[at]);
    ASSERT_TRUE(is_part_of(drive, heard.entries)) << at;
    ASSERT_TRUE(heard.complains()) << "byte " << at << " of " << whole.size();
  }
  EXPECT_FALSE(hear(file).complains());
}

TEST(McapDamage, a_chunk_that_was_overwritten_is_left_out_and_named_and_the_others_are_read) {
  TemporaryFolder folder;
  const std::string whole = drive_bytes(folder / "a.mcap", 30);
  std::string bytes = whole;
  const std::size_t frame = whole.find("\x28\xB5\x2F\xFD", whole.find("\x28\xB5\x2F\xFD") + 1);
  bytes.replace(frame + 200, 20, 20, '\x55');
  write_bytes(folder / "a.mcap", bytes);
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_EQ(90U, heard.entries.size());
  EXPECT_TRUE(is_part_of(drive_in_order(), heard.entries));
  EXPECT_THAT(heard.error,
              AllOf(HasSubstr("a.mcap: the chunk at byte "),
                    HasSubstr("left out"),
                    HasSubstr("90 of the 120 messages that its summary counts")));
}

TEST(McapDamage, what_follows_a_broken_record_is_found_again_by_the_summary) {
  TemporaryFolder folder;
  std::string bytes = drive_bytes(folder / "a.mcap", 30);
  const std::size_t frame = bytes.find("\x28\xB5\x2F\xFD");
  const std::size_t chunk = frame - 8 - 4 - 4 - 4 - 24 - 9;
  ASSERT_EQ('\x06', bytes[chunk]) << "the first chunk's record";
  bytes[chunk + 6] = '\x7F';  // in its length
  write_bytes(folder / "a.mcap", bytes);
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_EQ(90U, heard.entries.size());
  EXPECT_THAT(heard.error, HasSubstr("it is read again from byte"));
}

TEST(McapDamage, a_chunk_that_lies_about_its_beginning_comes_late_but_is_not_lost) {
  TemporaryFolder folder;
  RecordWriter file;
  file.bytes(mcap::kMagic);
  file.header({"ros2", "test"});
  file.schema({1, "sensor_msgs/msg/Imu", "ros2msg", ""});
  file.channel({1, 1, "/imu/data", "cdr", {}});
  for (int part = 0; part < 2; ++part) {
    RecordWriter records;
    for (int i = 0; i < 10; ++i) {
      const std::vector<std::uint8_t> data(10, 1);
      const Nanoseconds time_ns = sample_imu(2 * i + part).stamp_ns;
      records.message({1, 0, time_ns, time_ns}, data);
    }
    const Nanoseconds first_ns = sample_imu(part == 0 ? 0 : 15).stamp_ns;
    file.chunk({first_ns, first_ns + kNanosecondsPerSecond, records.content().size(), 0, "", 0},
               records.content());
  }
  mcap::Statistics statistics;
  statistics.messages = 20;
  statistics.channels = 1;
  statistics.channel_messages[1] = 20;
  statistics.first_ns = kStart_ns;
  statistics.last_ns = kStart_ns + kNanosecondsPerSecond;
  file.data_end(0);
  const auto summary = file.content().size();
  file.schema({1, "sensor_msgs/msg/Imu", "ros2msg", ""});
  file.channel({1, 1, "/imu/data", "cdr", {}});
  file.statistics(statistics);
  file.footer({summary, 0, 0});
  file.bytes(mcap::kMagic);
  write_bytes(folder / "a.mcap", {file.content().begin(), file.content().end()});

  LogOptions imu_alone;
  imu_alone.require_points = imu_alone.require_fix = false;
  const auto log = open_log((folder / "a.mcap").string(), RobotConfig{}, imu_alone);
  const auto told = message_of<LogError>([&] { log->next(); });
  EXPECT_THAT(told, HasSubstr("begins before it says so"));
  ASSERT_EQ(1U, log->undecodable().size());
  EXPECT_EQ(20U, log->undecodable()[0].count) << "all were delivered to the decoder";
}

TEST(McapDamage, a_summary_whose_crc_does_not_fit_is_not_believed_and_all_is_read_without_it) {
  TemporaryFolder folder;
  std::string bytes = drive_bytes(folder / "a.mcap", 30);
  const auto footer =
      mcap::parse_footer(Bytes(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size())
                             .last(mcap::kFooterBytes + mcap::kMagic.size()));
  bytes[footer->summary_begin + 20] ^= 1;
  write_bytes(folder / "a.mcap", bytes);
  const Heard heard = hear(folder / "a.mcap");
  EXPECT_TRUE(heard.entries == drive_in_order());
  EXPECT_EQ("", heard.error);
  EXPECT_THAT(heard.faults,
              testing::ElementsAre(AllOf(
                  HasSubstr("a.mcap: the summary at byte " + std::to_string(footer->summary_begin)),
                  HasSubstr("CRC does not fit"))));
}

TEST(McapDamage, statistics_that_end_too_early_hide_no_message) {
  TemporaryFolder folder;
  std::string bytes = drive_bytes(folder / "a.mcap", 30);
  const Bytes view(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size());
  const auto footer = mcap::parse_footer(view.last(mcap::kFooterBytes + mcap::kMagic.size()));
  Bytes rest = view.subspan(footer->summary_begin);
  auto record = mcap::take_record(rest);
  while (record->first.op != mcap::Op::kStatistics) {
    record = mcap::take_record(rest);
  }
  constexpr std::size_t kLastTime = 8 + 2 + 4 * 4 + 8;  // after the counts and the first time
  const auto at = static_cast<std::size_t>(record->second.data() - view.data()) + kLastTime;
  bytes.replace(at, 8, bytes.substr(at - 8, 8));                      // ends when it begins
  bytes.replace(bytes.size() - mcap::kMagic.size() - 4, 4, 4, '\0');  // no CRC
  write_bytes(folder / "a.mcap", bytes);
  EXPECT_TRUE(hear(folder / "a.mcap").entries == drive_in_order());
}

/// More than what reading a small file needs, far less than what the lies below ask for.
constexpr long kMemory_kb = 100'000;

/// What is said of the file, by a process of its own that tells how much memory it took.
std::string heard_with_little_memory(const fs::path& file) {
  const pid_t child = fork();
  if (child == 0) {
    rusage before{};
    getrusage(RUSAGE_SELF, &before);
    const std::string error = hear(file).error;
    rusage after{};
    getrusage(RUSAGE_SELF, &after);
    const bool little = after.ru_maxrss - before.ru_maxrss < kMemory_kb;
    write_bytes(file.string() + ".told", little ? error : "took too much memory");
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? bytes_of(file.string() + ".told") : "crashed";
}

TEST(McapDamage, lengths_beyond_reason_are_refused_before_anything_is_allocated) {
  TemporaryFolder folder;
  const std::vector<std::uint8_t> few(40, 0);
  const std::vector<std::pair<std::string, std::uint64_t>> lies{
      {"zstd", 1ULL << 30U}, {"lz4", 1ULL << 62U}, {"", 1ULL << 40U}, {"zstd", ~0ULL}};
  for (const auto& [compression, size] : lies) {
    RecordWriter file;
    file.bytes(mcap::kMagic);
    file.header({"ros2", "test"});
    file.chunk({kStart_ns, kStart_ns, size, 0, compression, 0}, few);
    write_bytes(folder / "a.mcap", {file.content().begin(), file.content().end()});
    EXPECT_THAT(heard_with_little_memory(folder / "a.mcap"),
                HasSubstr("40 bytes become " + std::to_string(size)))
        << compression;
  }
  RecordWriter file;
  file.bytes(mcap::kMagic);
  file.header({"ros2", "test"});
  std::string bytes(file.content().begin(), file.content().end());
  for (const char op : {'\x03', '\x04', '\x05', '\x06', '\x09', '\x0F'}) {
    write_bytes(folder / "a.mcap",
                bytes + op + std::string("\xFF\xFF\xFF\xFF\xFF\xFF\xFF\x7F", 8) + "rest");
    EXPECT_THAT(heard_with_little_memory(folder / "a.mcap"), HasSubstr("breaks off"))
        << static_cast<int>(op);
  }
}

/// MCAP's CRC is that of zlib (CRC-32/ISO-HDLC), of which this is the published check value.
TEST(McapCrc, has_the_check_value_of_its_kind_in_one_piece_and_in_two) {
  const std::string digits = "123456789";
  const std::vector<std::uint8_t> bytes(digits.begin(), digits.end());
  constexpr std::uint32_t kCheck = 0xcbf43926;
  EXPECT_EQ(mcap::crc32_of(bytes), kCheck);
  EXPECT_EQ(mcap::crc32_of(Bytes(bytes).subspan(4), mcap::crc32_of(Bytes(bytes).first(4))), kCheck);
}

TEST(McapDamage, lz4_and_zstd_that_end_elsewhere_than_their_chunk_says_are_refused) {
  const std::vector<std::uint8_t> content(1000, 42);
  std::vector<std::uint8_t> lz4(LZ4F_compressFrameBound(content.size(), nullptr));
  lz4.resize(LZ4F_compressFrame(lz4.data(), lz4.size(), content.data(), content.size(), nullptr));
  const auto zstd = mcap::compressed(content);
  const auto unpack = [](const std::string& compression,
                         const std::vector<std::uint8_t>& stored,
                         std::uint64_t size,
                         std::uint32_t crc = 0) {
    RecordWriter record;
    record.chunk({0, 0, size, crc, compression, 0}, stored);
    return mcap::unpack_chunk(Bytes(record.content()).subspan(mcap::kHeadBytes));
  };
  for (const auto& [name, stored] : {std::pair("lz4", lz4), std::pair("zstd", zstd)}) {
    EXPECT_EQ("", unpack(name, stored, 1000).problem);
    EXPECT_EQ(content, unpack(name, stored, 1000).records);
    EXPECT_EQ("", unpack(name, stored, 1000, mcap::crc32_of(content)).problem);
    EXPECT_THAT(unpack(name, stored, 1000, 1).problem, HasSubstr("CRC"));
    EXPECT_THAT(unpack(name, stored, 999).problem, HasSubstr(name));
    EXPECT_THAT(unpack(name, stored, 1001).problem, HasSubstr(name));
    const std::vector<std::uint8_t> cut(stored.begin(), stored.end() - 3);
    EXPECT_THAT(unpack(name, cut, 1000).problem, HasSubstr(name));
  }
  EXPECT_EQ("", unpack("", {}, 0).problem);
  EXPECT_EQ("", unpack("zstd", {}, 0).problem);
}

}  // namespace
}  // namespace trigpoint::recording
