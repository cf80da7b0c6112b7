// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
#include "sqlite.hpp"

namespace trigpoint::recording {

namespace {

/// The file of an SQLite URI as a user knows it: "file:NAME?immutable=1" is NAME.
std::string plain_name(const std::string& file) {
  constexpr char kScheme[] = "file:";
  return file.starts_with(kScheme)
             ? file.substr(sizeof(kScheme) - 1, file.rfind('?') - (sizeof(kScheme) - 1))
             : file;
}

}  // namespace

Database::Database(const std::string& file, int flags) : file_(plain_name(file)) {
  sqlite3* handle = nullptr;
  const int result = sqlite3_open_v2(file.c_str(), &handle, flags, nullptr);
  handle_.reset(handle);
  if (result != SQLITE_OK) {
    fail("opening");
  }
}

void Database::run(const std::string& sql) {
  if (sqlite3_exec(handle_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    fail("'" + sql.substr(0, 40) + "'");
  }
}

Statement Database::prepare(const std::string& sql) {
  sqlite3_stmt* handle = nullptr;
  if (sqlite3_prepare_v2(handle_.get(), sql.c_str(), -1, &handle, nullptr) != SQLITE_OK) {
    fail("'" + sql.substr(0, 40) + "'");
  }
  return {*this, handle};
}

void Database::fail(const std::string& doing) const {
  throw LogError(file_ + ": " + doing +
                 " failed: " + (handle_ ? sqlite3_errmsg(handle_.get()) : "out of memory"));
}

Statement& Statement::bind(int index, std::int64_t value) {
  if (sqlite3_bind_int64(handle_.get(), index, value) != SQLITE_OK) {
    database_->fail("binding a value");
  }
  return *this;
}

Statement& Statement::bind(int index, const std::string& value) {
  if (sqlite3_bind_text(
          handle_.get(), index, value.data(), static_cast<int>(value.size()), SQLITE_TRANSIENT) !=
      SQLITE_OK) {
    database_->fail("binding a text");
  }
  return *this;
}

Statement& Statement::bind(int index, std::span<const std::uint8_t> value) {
  if (sqlite3_bind_blob64(handle_.get(), index, value.data(), value.size(), SQLITE_STATIC) !=
      SQLITE_OK) {
    database_->fail("binding " + std::to_string(value.size()) + " bytes");
  }
  return *this;
}

bool Statement::step() {
  const int result = sqlite3_step(handle_.get());
  if (result != SQLITE_ROW && result != SQLITE_DONE) {
    database_->fail("a step");
  }
  return result == SQLITE_ROW;
}

void Statement::reset() {
  sqlite3_reset(handle_.get());
}

std::string Statement::text(int column) const {
  const auto* characters = sqlite3_column_text(handle_.get(), column);
  return characters == nullptr ? "" : reinterpret_cast<const char*>(characters);
}

std::span<const std::uint8_t> Statement::blob(int column) const {
  const auto* bytes = static_cast<const std::uint8_t*>(sqlite3_column_blob(handle_.get(), column));
  return {
      bytes,
      bytes == nullptr ? 0 : static_cast<std::size_t>(sqlite3_column_bytes(handle_.get(), column))};
}

}  // namespace trigpoint::recording
