// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Text tables: CSV and the blank-separated lines of TUM trajectories, read strictly.

#include "geometry/names.h"
#include "input/regular_file.h"

#include <cstdint>
#include <fmt/format.h>
#include <limits>
#include <string>
#include <string_view>
#include <vector>

namespace bole
{
/// What a table must look like.
struct CsvFormat
{
  std::size_t min_columns = 1; ///< rows with fewer columns are an error
  char separator = ',';        ///< ',' or ' ' (any run of blanks)
  std::string header = {};     ///< the first row must begin with these names; empty: there may be a header or none
};

/// Reads a table row by row. Fields may be quoted as RFC 4180 says (csvField()); rows that start with '#' and empty
/// ones are skipped. A first row of names is the header; every row has as many columns as the first one.
///
/// Errors: every fault throws vpException "file:line: what, must be ...": a missing file, a wrong header, a wrong
/// number of columns, a field that is not a whole or finite number, a stamp that goes back.
///
/// \code
/// CsvReader csv("odom0/data.csv", {8});
/// while (csv.next())
///   use(csv.risingStampNs(0), csv.number(1, "x"));
/// \endcode
class CsvReader
{
public:
  CsvReader(const std::string &path, CsvFormat format);

  /// The next row; false at the end of the file.
  bool next();
  std::size_t columns() const { return m_fields.size(); }
  /// The names of the columns, empty where there is no header.
  const std::vector<std::string> &header() const { return m_header; }

  const std::string &text(std::size_t column) const { return m_fields.at(column); }
  /// A finite number, at most \p most from zero; \p name is used in the error only.
  double number(std::size_t column, std::string_view name, double most = std::numeric_limits<double>::max()) const;
  std::int64_t integer(std::size_t column, std::string_view name) const;
  /// From 0 on: an id, or how many there are.
  int count(std::size_t column, std::string_view name) const;
  /// A value of an enumeration by its name, \p last being the last one.
  template <typename Value>
  Value named(std::size_t column, const char *name, Value last, const char *otherwise = "is not known") const
  {
    if (const auto value = valueNamed(text(column), last))
      return *value;
    fail(fmt::format("{} = \"{}\", {}", name, text(column), otherwise));
  }
  /// Whole nanoseconds, later than those of the row before.
  std::int64_t risingStampNs(std::size_t column);
  /// Seconds with up to nine decimals as nanoseconds (exact), later than those of the row before.
  std::int64_t risingStampFromSeconds(std::size_t column);

  /// Throws vpException "file:line: message" at the current row.
  [[noreturn]] void fail(const std::string &message) const;

private:
  bool readRecord();
  void split();
  void requireColumns() const;
  void requireNear(double stamp_s, const char *hint) const;
  std::int64_t rising(std::int64_t stamp_ns);

  TextLines m_lines;
  CsvFormat m_format;
  std::string m_record;      ///< the row as it stands in the file
  std::size_t m_line = 1;    ///< where it begins
  bool m_is_pending = false; ///< the first row was read by the constructor and is no header
  std::size_t m_rows = 0;
  std::size_t m_columns = 0;
  std::int64_t m_last_stamp_ns = 0;
  std::vector<std::string> m_header, m_fields;
};

/// \p text as a field of a comma separated table: in quotes where RFC 4180 wants them.
std::string csvField(std::string_view text);
} // namespace bole
