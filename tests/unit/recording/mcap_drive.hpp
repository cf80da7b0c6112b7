// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// The second of a drive that the tests of MCAP write and read, and what they ask of a reader.
#pragma once

#include "trigpoint/recording/rosbag2_writer.hpp"

#include "samples.hpp"
#include "temporary_folder.hpp"

#include <algorithm>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

namespace trigpoint::recording {

inline constexpr int kDriveMessages = 120;

/// What the drive is made of: for every tenth IMU sample there is a fix and a cloud, which arrive
/// 50 ms late.
struct DriveSize {
  int imu_samples{100};
  std::uint32_t points{100};  ///< of a cloud
};

/// With `flush_every` messages a chunk ends.
inline void write_drive(Rosbag2Writer& writer, int flush_every = 0, const DriveSize& size = {}) {
  int count = 0;
  const auto write = [&](const char* topic, Nanoseconds receive_ns, const auto& message) {
    writer.write(topic, receive_ns, message);
    if (flush_every > 0 && ++count % flush_every == 0) {
      writer.flush();
    }
  };
  for (int i = 0; i < size.imu_samples; ++i) {
    const auto imu = sample_imu(i);
    write("imu/data", imu.stamp_ns, imu);
    if (i % 10 == 5) {
      const auto fix = sample_fix(i / 10);
      write("gps/fix", fix.stamp_ns + 50 * kMillisecond_ns, fix);
      const auto cloud = sample_cloud(i / 10, size.points);
      write("/points", cloud.stamp_ns + 50 * kMillisecond_ns, cloud);
    }
  }
}

/// Every value of an entry as text, so that entries can be compared.
inline std::string text_of(const LogEntry& entry) {
  std::ostringstream text;
  text.precision(17);
  text << entry.receive_ns << ' ';
  if (const auto* imu = std::get_if<ImuSample>(&entry.measurement)) {
    text << "imu " << imu->stamp_ns << ' ' << imu->frame_id << ' ' << imu->gyro_radps.transpose()
         << ' ' << imu->accel_mps2.transpose() << ' ';
    if (imu->q_world_base) {
      text << imu->q_world_base->coeffs().transpose();
    }
  } else if (const auto* fix = std::get_if<GnssFix>(&entry.measurement)) {
    text << "fix " << fix->stamp_ns << ' ' << fix->frame_id << ' ' << static_cast<int>(fix->status)
         << ' ' << fix->service << ' ' << fix->latitude_deg << ' ' << fix->longitude_deg << ' '
         << fix->altitude_m << ' ' << fix->covariance_enu_m2.reshaped().transpose() << ' '
         << static_cast<int>(fix->covariance_type);
  } else if (const auto* cloud = std::get_if<PointCloudMessage>(&entry.measurement)) {
    text << "cloud " << cloud->stamp_ns << ' ' << cloud->frame_id << ' ' << cloud->height << ' '
         << cloud->width << ' ' << cloud->point_step << ' ' << cloud->row_step << ' ';
    for (const auto& field : cloud->fields) {
      text << field.name << ' ' << field.offset << ' ' << static_cast<int>(field.datatype) << ' '
           << field.count << ' ';
    }
    text << std::string(cloud->data.begin(), cloud->data.end());
  }
  return text.str();
}

/// The drive as a reader must deliver it.
inline std::vector<std::string> drive_in_order(const DriveSize& size = {}) {
  std::vector<LogEntry> entries;
  for (int i = 0; i < size.imu_samples; ++i) {
    entries.push_back({sample_imu(i).stamp_ns, sample_imu(i), false});
    if (i % 10 == 5) {
      const Nanoseconds late_ns = 50 * kMillisecond_ns;
      const auto fix = sample_fix(i / 10);
      entries.push_back({fix.stamp_ns + late_ns, fix, false});
      const auto cloud = sample_cloud(i / 10, size.points);
      entries.push_back({cloud.stamp_ns + late_ns, cloud, false});
    }
  }
  std::vector<std::string> texts;
  for (const LogEntry& entry : entries) {
    texts.push_back(text_of(entry));
  }
  return texts;
}

/// At one time of arrival the order is the file's.
inline bool is_in_order_of_arrival(const std::vector<std::string>& entries) {
  return std::is_sorted(
      entries.begin(), entries.end(), [](const std::string& a, const std::string& b) {
        return a.substr(0, a.find(' ')) < b.substr(0, b.find(' '));
      });
}

inline std::vector<std::string> without_order(std::vector<std::string> entries) {
  std::sort(entries.begin(), entries.end());
  return entries;
}

/// Everything that a log delivers and says.
struct Heard {
  std::vector<std::string> entries;
  std::vector<std::string> faults;
  std::string error;  ///< why it can't be opened, or ends
  bool undecodable{false};

  bool complains() const { return !faults.empty() || !error.empty() || undecodable; }
};

inline Heard hear(const std::filesystem::path& path) {
  Heard heard;
  try {
    const auto log = open_log(path.string(), RobotConfig{});
    heard.faults = log->summary().faults;
    while (true) {
      try {
        const auto entry = log->next();
        heard.undecodable = !log->undecodable().empty();
        if (!entry) {
          break;
        }
        heard.entries.push_back(text_of(*entry));
      } catch (const LogError& error) {
        heard.error = error.what();
        break;
      }
    }
  } catch (const LogError& error) {
    heard.error = error.what();
  }
  return heard;
}

inline std::string bytes_of(const std::filesystem::path& file) {
  std::ostringstream bytes;
  bytes << std::ifstream(file, std::ios::binary).rdbuf();
  return bytes.str();
}

inline void write_bytes(const std::filesystem::path& file, const std::string& bytes) {
  std::ofstream(file, std::ios::binary) << bytes;
}

}  // namespace trigpoint::recording
