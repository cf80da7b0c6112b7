// SPDX-License-Identifier: Apache-2.0
// Copyright the Trigpoint developers
// Owners of SQLite's handles; every failure becomes a LogError that names the file.
#pragma once

#include "trigpoint/recording/log.hpp"

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace trigpoint::recording {

class Statement;

class Database {
 public:
  Database(const std::string& file, int flags);

  void run(const std::string& sql);
  Statement prepare(const std::string& sql);
  [[noreturn]] void fail(const std::string& doing) const;

  const std::string& file() const { return file_; }

  std::int64_t last_row() const { return sqlite3_last_insert_rowid(handle_.get()); }

  bool in_transaction() const { return sqlite3_get_autocommit(handle_.get()) == 0; }

 private:
  struct Close {
    void operator()(sqlite3* handle) const { sqlite3_close_v2(handle); }
  };

  std::string file_;
  std::unique_ptr<sqlite3, Close> handle_;
};

class Statement {
 public:
  Statement(const Database& database, sqlite3_stmt* handle)
      : database_(&database), handle_(handle) {}

  Statement& bind(int index, std::int64_t value);
  Statement& bind(int index, const std::string& value);
  /// The bytes must outlive the next step.
  Statement& bind(int index, std::span<const std::uint8_t> value);
  /// True when there is a row.
  bool step();
  void reset();

  std::int64_t integer(int column) const { return sqlite3_column_int64(handle_.get(), column); }

  std::string text(int column) const;
  std::span<const std::uint8_t> blob(int column) const;

 private:
  struct Finalize {
    void operator()(sqlite3_stmt* handle) const { sqlite3_finalize(handle); }
  };

  const Database* database_;
  std::unique_ptr<sqlite3_stmt, Finalize> handle_;
};

}  // namespace trigpoint::recording
