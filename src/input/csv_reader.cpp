// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/csv_reader.h"

#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "input/frame_check.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <limits>

namespace bole
{
namespace
{
std::string_view trimmed(std::string_view text)
{
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos)
    return {};
  return text.substr(first, text.find_last_not_of(" \t\r") - first + 1);
}

/// "stamp,0,142302,-0,176885": no point anywhere, and every second field is a fraction of at least two digits.
bool hasDecimalCommas(const std::vector<std::string> &fields)
{
  if (fields.size() < 7 || fields.size() % 2 == 0)
    return false;
  for (std::size_t i = 1; i < fields.size(); ++i) {
    const bool is_fraction = i % 2 == 0;
    const std::string digits =
        !is_fraction && !fields[i].empty() && fields[i].front() == '-' ? fields[i].substr(1) : fields[i];
    if (digits.find_first_not_of("0123456789") != std::string::npos || digits.size() < (is_fraction ? 2u : 1u) ||
        (!is_fraction && digits.size() > 4))
      return false;
  }
  return true;
}

bool isDigit(char c) { return c >= '0' && c <= '9'; }

/// A row of names, written without the '#': the first holds no digit, none begins like a number.
bool isHeader(const std::vector<std::string> &fields)
{
  const auto is_value = [](const std::string &field) {
    return field == "nan" || field == "inf" ||
           (!field.empty() && (isDigit(field.front()) || field.find_first_of("+-.") == 0));
  };
  return std::none_of(fields.front().begin(), fields.front().end(), isDigit) &&
         std::none_of(fields.begin(), fields.end(), is_value);
}

/// What a message may quote of a file: its beginning, on one line and without what a terminal would obey.
std::string shownField(std::string_view text)
{
  constexpr std::size_t kLongest = 60;
  std::string shown(text.substr(0, kLongest));
  for (char &c : shown)
    if (static_cast<unsigned char>(c) < ' ' || c == '\x7F')
      c = '?';
  return text.size() > kLongest ? shown + "..." : shown;
}

constexpr std::int64_t kLatest_s = kFarthestStamp_ns / 1'000'000'000; ///< of a stamp from the epoch

/// Seconds in decimal notation as nanoseconds, without a detour through floating point.
std::optional<std::int64_t> parseSeconds(std::string_view text)
{
  const auto point = std::min(text.find('.'), text.size());
  const std::string fraction(text.substr(std::min(point + 1, text.size())));
  const auto seconds = parseNumber<std::int64_t>(text.substr(0, point));
  const auto nanoseconds = parseNumber<std::int64_t>((fraction + "000000000").substr(0, 9));
  if (!seconds || !nanoseconds || *seconds < -kLatest_s || *seconds > kLatest_s ||
      !std::all_of(fraction.begin(), fraction.end(), isDigit))
    return std::nullopt;
  return *seconds * 1'000'000'000 + (text.front() == '-' ? -*nanoseconds : *nanoseconds);
}
} // namespace

CsvReader::CsvReader(const std::string &path, CsvFormat format) : m_lines(path), m_format(std::move(format))
{
  const bool has_row = readRecord();
  if (has_row && (!m_format.header.empty() || isHeader(m_fields)))
    m_header = m_fields;
  m_is_pending = has_row && m_header.empty();
  if (m_format.header.empty())
    return;
  if ((m_record + ',').rfind(m_format.header + ',', 0) != 0)
    fail(fmt::format("the header is \"{}\", must be \"{}\"", shownField(m_record), m_format.header));
  m_columns = m_header.size();
}

void CsvReader::fail(const std::string &message) const { throw ioError("{}:{}: {}", m_lines.name(), m_line, message); }

/// The next row, with the lines in which a quoted field of it goes on; false at the end.
bool CsvReader::readRecord()
{
  constexpr std::size_t kLongest = 1'000'000;
  const auto quotes = [](const std::string &line) { return std::count(line.begin(), line.end(), '"'); };
  do {
    if (!m_lines.next())
      return false;
    m_line = m_lines.number();
    m_record = trimmed(m_lines.line());
    if (m_line == 1 && (m_record.rfind("\xFF\xFE", 0) == 0 || m_record.rfind("\xFE\xFF", 0) == 0))
      fail("is text in UTF-16, must be in UTF-8");
  } while (m_record.empty() || m_record.front() == '#');
  for (auto count = quotes(m_record); count % 2 == 1; count += quotes(m_lines.line())) {
    if (m_record.size() > kLongest || !m_lines.next())
      fail("a quote is never closed");
    m_record += '\n' + m_lines.line();
  }
  split();
  return true;
}

void CsvReader::split()
{
  const auto is_separator = [this](char c) {
    return c == m_format.separator || (m_format.separator == ' ' && c == '\t');
  };
  m_fields.clear();
  for (std::size_t begin = 0, end = 0; begin <= m_record.size(); begin = end + 1) {
    bool is_quoted = false;
    for (end = begin; end < m_record.size() && (is_quoted || !is_separator(m_record[end])); ++end)
      is_quoted = is_quoted != (m_record[end] == '"');
    std::string field(trimmed(std::string_view(m_record).substr(begin, end - begin)));
    if (m_format.separator == ' ' && field.empty())
      continue; // in a run of blanks
    if (field.size() > 1 && field.front() == '"' && field.back() == '"') {
      field = field.substr(1, field.size() - 2);
      for (std::size_t at = 0; (at = field.find("\"\"", at)) != std::string::npos; ++at)
        field.erase(at, 1);
    }
    m_fields.push_back(std::move(field));
  }
}

void CsvReader::requireColumns() const
{
  const bool has_commas = m_format.separator == ',', is_one = m_fields.size() == 1;
  const auto has = [this](char separator) { return m_record.find(separator) != std::string::npos; };
  if (m_fields.size() < m_format.min_columns) {
    const char *other = has(';')                            ? "semicolons"
                        : !has_commas && has(',')           ? "commas"
                        : has_commas && is_one && has('\t') ? "tabs"
                        : has_commas && is_one && has(' ')  ? "blanks"
                                                            : nullptr;
    if (other != nullptr)
      fail(fmt::format("the columns are separated by {}, must be by {} (and decimals written with a point)", other,
                       has_commas ? "commas" : "blanks"));
    fail(fmt::format("{} columns, must be {}", m_fields.size(), m_format.min_columns));
  }
  if (has_commas && hasDecimalCommas(m_fields))
    fail("the decimals look as if written with a comma, must have a point");
  if (m_columns > 0 && m_fields.size() != m_columns)
    fail(fmt::format("{} columns, must be {} as in the rows before", m_fields.size(), m_columns));
}

bool CsvReader::next()
{
  if (!m_is_pending && !readRecord())
    return false;
  m_is_pending = false;
  requireColumns();
  m_columns = m_fields.size();
  ++m_rows;
  return true;
}

double CsvReader::number(std::size_t column, std::string_view name, double most) const
{
  const std::string &field = m_fields.at(column);
  const auto value = parseNumber<double>(field);
  if (!value)
    fail(fmt::format(
        "{} = \"{}\", must be a finite number{}", name, shownField(field),
        field.find_first_of(",;") == std::string::npos ? "" : " with a point, columns parted by commas or blanks"));
  if (std::abs(*value) > most)
    fail(fmt::format("{} = {:g}, must be at most {:g} from zero", name, *value, most));
  return *value;
}

int CsvReader::count(std::size_t column, std::string_view name) const
{
  const std::int64_t value = integer(column, name);
  if (value < 0 || value > std::numeric_limits<int>::max())
    fail(fmt::format("{} = {}, must be 0 .. {}", name, value, std::numeric_limits<int>::max()));
  return static_cast<int>(value);
}

std::int64_t CsvReader::integer(std::size_t column, std::string_view name) const
{
  if (const auto value = parseNumber<std::int64_t>(m_fields.at(column)))
    return *value;
  fail(fmt::format("{} = \"{}\", must be a whole number", name, shownField(m_fields.at(column))));
}

void CsvReader::requireNear(double stamp_s, const char *hint) const
{
  if (!(std::abs(stamp_s) <= double(kLatest_s)))
    fail(
        fmt::format("timestamp = {:.3g} s, must be at most {:g} s from the epoch{}", stamp_s, double(kLatest_s), hint));
}

std::int64_t CsvReader::rising(std::int64_t stamp_ns)
{
  if (m_rows > 1 && stamp_ns <= m_last_stamp_ns)
    fail(fmt::format("timestamp = {} ns, must be later than the {} ns of the row before", stamp_ns, m_last_stamp_ns));
  m_last_stamp_ns = stamp_ns;
  return stamp_ns;
}

std::int64_t CsvReader::risingStampNs(std::size_t column)
{
  const std::int64_t stamp_ns = integer(column, "timestamp");
  requireNear(1e-9 * static_cast<double>(stamp_ns), "");
  if (m_rows == 3 && stamp_ns >= 2 && stamp_ns <= 3 && m_last_stamp_ns == stamp_ns - 1)
    fail(fmt::format("timestamp = {} ns: looks like an index of the rows, which must be left out", stamp_ns));
  return rising(stamp_ns);
}

std::int64_t CsvReader::risingStampFromSeconds(std::size_t column)
{
  if (const auto stamp_ns = parseSeconds(m_fields.at(column)))
    return rising(*stamp_ns);
  // Scientific notation, as numpy.savetxt writes it: exact enough after rounding for stamps below 2^53 ns.
  const double stamp_s = number(column, "timestamp");
  requireNear(stamp_s, " (nanoseconds?)");
  return rising(std::llround(stamp_s * 1e9));
}

std::string csvField(std::string_view text)
{
  if (text.find_first_of(",;\"\r\n") == std::string_view::npos && trimmed(text) == text && text.substr(0, 1) != "#")
    return std::string(text);
  std::string field = "\"";
  for (const char c : text)
    field.append(c == '"' ? 2 : 1, c);
  return field + '"';
}
} // namespace bole
