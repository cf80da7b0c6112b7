// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// SQLite with C++ ownership; every failure is a std::runtime_error that names the file.
#pragma once

#include <sqlite3.h>

#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>

namespace trigpoint::lio_mapper {

class Database {
 public:
  /// `name` is what SQLite is given, when that is more than the file (a URI).
  Database(const std::string& file, int flags, const std::string& name = "") : file_(file) {
    const int code =
        sqlite3_open_v2((name.empty() ? file : name).c_str(), &handle_, flags, nullptr);
    if (code != SQLITE_OK) {
      const std::string cause = handle_ != nullptr ? sqlite3_errmsg(handle_) : sqlite3_errstr(code);
      sqlite3_close(handle_);
      throw std::runtime_error(file_ + ": cannot be opened as a keyframe store: " + cause);
    }
    constexpr int kBusy_ms = 5000;  // one may read while another writes
    sqlite3_busy_timeout(handle_, kBusy_ms);
  }

  ~Database() { sqlite3_close(handle_); }

  Database(const Database&) = delete;
  Database& operator=(const Database&) = delete;

  void run(const std::string& sql) {
    if (sqlite3_exec(handle_, sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
      fail();
    }
  }

  /// What a killed writer left in the write-ahead log stays there when this is closed, instead of
  /// being moved into the file.
  void leave_log() {
    int leaves = 0;
    if (sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, &leaves) != SQLITE_OK ||
        leaves != 1) {
      fail(
          "this SQLite cannot leave a write-ahead log as it is, so reading would change the store");
    }
  }

  /// For a log that has nothing in it: its empty files go when this is closed. Where it fails, they
  /// stay.
  void remove_log() noexcept {
    sqlite3_db_config(handle_, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0, nullptr);
  }

  [[noreturn]] void fail() const {
    throw std::runtime_error(file_ + ": keyframe store: " + sqlite3_errmsg(handle_));
  }

  [[noreturn]] void fail(const std::string& what) const {
    throw std::runtime_error(file_ + ": keyframe store: " + what);
  }

  sqlite3* handle() const { return handle_; }

 private:
  std::string file_;
  sqlite3* handle_{nullptr};
};

class Statement {
 public:
  Statement(Database& database, const std::string& sql) : database_(database) {
    if (sqlite3_prepare_v2(database.handle(), sql.c_str(), -1, &handle_, nullptr) != SQLITE_OK) {
      database_.fail();
    }
  }

  ~Statement() { sqlite3_finalize(handle_); }

  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;

  void bind(int column, std::int64_t value) { sqlite3_bind_int64(handle_, column, value); }

  void bind_number(int column, double value) { sqlite3_bind_double(handle_, column, value); }

  void bind_text(int column, const std::string& text) {
    sqlite3_bind_text(
        handle_, column, text.data(), static_cast<int>(text.size()), SQLITE_TRANSIENT);
  }

  /// The bytes must live until the statement was stepped.
  void bind_bytes(int column, const void* data, std::size_t size) {
    sqlite3_bind_blob64(handle_, column, size > 0 ? data : "", size, SQLITE_STATIC);
  }

  /// True while there is a row.
  bool step() {
    const int code = sqlite3_step(handle_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) {
      database_.fail();
    }
    return code == SQLITE_ROW;
  }

  void reset() {
    sqlite3_reset(handle_);
    sqlite3_clear_bindings(handle_);
  }

  std::int64_t integer(int column) const { return sqlite3_column_int64(handle_, column); }

  double number(int column) const { return sqlite3_column_double(handle_, column); }

  std::string text(int column) const {
    const auto* bytes = reinterpret_cast<const char*>(sqlite3_column_text(handle_, column));
    return bytes != nullptr ? std::string(bytes, size(column)) : std::string();
  }

  std::size_t size(int column) const {
    return static_cast<std::size_t>(sqlite3_column_bytes(handle_, column));
  }

  const void* blob(int column) const { return sqlite3_column_blob(handle_, column); }

  [[noreturn]] void fail(const std::string& what) const { database_.fail(what); }

  /// Copies a blob that must have exactly `size` bytes.
  void copy(int column, void* to, std::size_t size) const {
    if (this->size(column) != size) {
      database_.fail("column " + std::string(sqlite3_column_name(handle_, column)) + " has " +
                     std::to_string(this->size(column)) + " bytes, " + std::to_string(size) +
                     " expected");
    }
    if (size > 0) {
      std::memcpy(to, blob(column), size);
    }
  }

 private:
  Database& database_;
  sqlite3_stmt* handle_{nullptr};
};

}  // namespace trigpoint::lio_mapper
