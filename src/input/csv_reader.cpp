// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/csv_reader.h"
#include "geometry/failure.h"

#include <charconv>
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

constexpr std::string_view kUtf16Marks[] = {"\xFF\xFE", "\xFE\xFF"};

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

/// A first line of names, written without the '#': it begins with a letter and is no number.
bool isHeader(std::string_view line)
{
  const char first = line.front();
  const bool is_word = (first >= 'a' && first <= 'z') || (first >= 'A' && first <= 'Z') || first == '"' || first == '_';
  return is_word && line.substr(0, 3) != "nan" && line.substr(0, 3) != "inf";
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

constexpr std::int64_t kFarthest_s = 4'000'000'000; ///< of a stamp from the epoch: in ns differences fit as well
constexpr std::int64_t kFarthest_ns = kFarthest_s * 1'000'000'000;

/// Seconds in decimal notation as nanoseconds, without a detour through floating point.
bool parseSeconds(std::string_view text, std::int64_t &stamp_ns)
{
  const auto point = text.find('.');
  const std::string_view whole = text.substr(0, point);
  std::string fraction(point == std::string_view::npos ? "" : text.substr(point + 1));
  if (whole.empty() || fraction.find_first_not_of("0123456789") != std::string::npos)
    return false;
  fraction = (fraction + "000000000").substr(0, 9);
  std::int64_t seconds = 0, nanoseconds = 0;
  const auto end = whole.data() + whole.size();
  if (std::from_chars(whole.data(), end, seconds).ptr != end || seconds < -kFarthest_s || seconds > kFarthest_s)
    return false;
  std::from_chars(fraction.data(), fraction.data() + fraction.size(), nanoseconds);
  stamp_ns = seconds * 1'000'000'000 + (whole.front() == '-' ? -nanoseconds : nanoseconds);
  return true;
}
} // namespace

CsvReader::CsvReader(const std::string &path, CsvFormat format) : m_lines(path), m_format(std::move(format))
{
  if (m_format.header.empty())
    return;
  m_lines.next();
  if (trimmed(m_lines.line()) != m_format.header)
    fail(fmt::format("the header is \"{}\", must be \"{}\"", shownField(trimmed(m_lines.line())), m_format.header));
}

void CsvReader::fail(const std::string &message) const
{
  throw ioError("{}:{}: {}", m_lines.name(), m_lines.number(), message);
}

void CsvReader::split(const std::string &line)
{
  m_fields.clear();
  std::size_t begin = 0;
  while (begin <= line.size()) {
    if (m_format.separator == ' ') {
      begin = line.find_first_not_of(" \t", begin);
      if (begin == std::string::npos)
        break;
    }
    const std::size_t end =
        std::min(m_format.separator == ' ' ? line.find_first_of(" \t", begin) : line.find(m_format.separator, begin),
                 line.size());
    m_fields.emplace_back(trimmed(std::string_view(line).substr(begin, end - begin)));
    begin = end + 1;
  }
}

bool CsvReader::next()
{
  while (m_lines.next()) {
    const std::string_view content = trimmed(m_lines.line());
    if (m_lines.number() == 1 && (content.substr(0, 2) == kUtf16Marks[0] || content.substr(0, 2) == kUtf16Marks[1]))
      fail("is text in UTF-16, must be in UTF-8");
    if (content.empty() || content.front() == '#' || (m_rows == 0 && isHeader(content)))
      continue;
    split(std::string(content));
    if (m_format.separator == ',' && content.find(';') != std::string_view::npos)
      fail("the columns are separated by semicolons, must be by commas (and decimals written with a point)");
    if (m_fields.size() < m_format.min_columns)
      fail(fmt::format("{} columns, must be {}", m_fields.size(), m_format.min_columns));
    if (m_format.separator == ',' && hasDecimalCommas(m_fields))
      fail("the decimals look as if written with a comma, must have a point");
    if (m_rows > 0 && m_fields.size() != m_columns)
      fail(fmt::format("{} columns, must be {} as in the rows before", m_fields.size(), m_columns));
    m_columns = m_fields.size();
    ++m_rows;
    return true;
  }
  return false;
}

double CsvReader::number(std::size_t column, std::string_view name) const
{
  const std::string &field = m_fields.at(column);
  const char *begin = field.data() + (!field.empty() && field.front() == '+' ? 1 : 0);
  const char *end = field.data() + field.size();
  double value = 0;
  const auto result = std::from_chars(begin, end, value);
  if (begin == end || result.ec != std::errc() || result.ptr != end || !std::isfinite(value))
    fail(fmt::format("{} = \"{}\", must be a finite number", name, shownField(field)));
  return value;
}

double CsvReader::number(std::size_t column, std::string_view name, double most) const
{
  const double value = number(column, name);
  if (std::abs(value) > most)
    fail(fmt::format("{} = {:g}, must be at most {:g} from zero", name, value, most));
  return value;
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
  const std::string &field = m_fields.at(column);
  std::int64_t value = 0;
  const auto result = std::from_chars(field.data(), field.data() + field.size(), value);
  if (field.empty() || result.ec != std::errc() || result.ptr != field.data() + field.size())
    fail(fmt::format("{} = \"{}\", must be a whole number", name, shownField(field)));
  return value;
}

std::int64_t CsvReader::rising(std::int64_t stamp_ns)
{
  if (stamp_ns < -kFarthest_ns || stamp_ns > kFarthest_ns)
    fail(fmt::format("timestamp = {:.3g} s, must be at most {:g} s from the epoch", 1e-9 * double(stamp_ns),
                     double(kFarthest_s)));
  if (m_rows > 1 && stamp_ns <= m_last_stamp_ns)
    fail(fmt::format("timestamp = {} ns, must be later than the {} ns of the row before", stamp_ns, m_last_stamp_ns));
  m_last_stamp_ns = stamp_ns;
  return stamp_ns;
}

std::int64_t CsvReader::risingStampNs(std::size_t column) { return rising(integer(column, "timestamp")); }

std::int64_t CsvReader::risingStampFromSeconds(std::size_t column)
{
  std::int64_t stamp_ns = 0;
  if (!parseSeconds(m_fields.at(column), stamp_ns))
    // Scientific notation, as numpy.savetxt writes it: exact enough after rounding for stamps below 2^53 ns.
    stamp_ns = std::llround(number(column, "timestamp") * 1e9);
  return rising(stamp_ns);
}

std::string oneField(std::string text)
{
  for (char &c : text)
    if (c == ',' || c == '\n' || c == '\r')
      c = c == ',' ? ';' : ' ';
  return text;
}
} // namespace bole
