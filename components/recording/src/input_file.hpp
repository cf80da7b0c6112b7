// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// A file that is read here and there.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace trigpoint::recording {

class InputFile {
 public:
  /// Throws LogError when it can't be opened.
  explicit InputFile(const std::string& name);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  const std::string& name() const { return name_; }

  /// When it was opened, byte.
  std::uint64_t size() const { return size_; }

  /// nullopt beyond the end or when the disk refuses; nothing is allocated for a size that the file
  /// has not.
  std::optional<std::vector<std::uint8_t>> read(std::uint64_t begin, std::uint64_t size) const;

  /// At most a page, as much as there is of `size`; valid until the next call.
  std::span<const std::uint8_t> peek(std::uint64_t begin, std::size_t size);

 private:
  bool read_into(std::uint64_t begin, std::span<std::uint8_t> bytes) const;

  std::string name_;
  int file_;
  std::uint64_t size_{0};
  std::uint64_t page_begin_{0};
  std::vector<std::uint8_t> page_;
};

}  // namespace trigpoint::recording
