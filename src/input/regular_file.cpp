// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/regular_file.h"

#include "geometry/failure.h"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fmt/ranges.h>
#include <string_view>

namespace bole
{
namespace fs = std::filesystem;
namespace
{
constexpr std::size_t kLongestLine = 100'000; // characters
constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
} // namespace

std::ifstream openRegularFile(const std::string &path)
{
  std::error_code error;
  const fs::file_status status = fs::status(path, error);
  if (!fs::exists(status))
    throw ioError("{}: no such file", path);
  if (!fs::is_regular_file(status))
    throw ioError("{}: is a {}, must be a file", path, fs::is_directory(status) ? "folder" : "pipe, socket or device");
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw ioError("{}: cannot be read: {}", path, std::strerror(errno));
  return file;
}

std::string readWholeFile(const std::string &path, std::size_t most_bytes)
{
  std::ifstream file = openRegularFile(path);
  const std::uintmax_t size = fs::file_size(path);
  if (size > most_bytes)
    throw ioError("{}: {} bytes, must be at most {}", path, size, most_bytes);
  std::string text(static_cast<std::size_t>(size), '\0');
  file.read(text.data(), static_cast<std::streamsize>(size));
  if (file.bad())
    throw ioError("{}: cannot be read", path);
  text.resize(static_cast<std::size_t>(file.gcount()));
  return text;
}

std::string readSmallFile(const std::string &path)
{
  constexpr std::size_t kMostBytes = 1000000; // of a file that people write
  return readWholeFile(path, kMostBytes);
}

TextLines::TextLines(const std::string &path) : m_file(openRegularFile(path)), m_in(m_file), m_name(path) {}

bool TextLines::next()
{
  m_line.clear();
  ++m_number;
  constexpr int kEnd = std::char_traits<char>::eof();
  int byte = m_in.get();
  const bool is_end = byte == kEnd;
  for (; byte != kEnd && byte != '\n'; byte = m_in.get()) {
    if (m_line.size() == kLongestLine)
      throw ioError("{}:{}: more than {} characters in a line", m_name, m_number, kLongestLine);
    m_line += static_cast<char>(byte);
  }
  if (m_in.bad())
    throw ioError("{}:{}: cannot be read", m_name, m_number);
  if (!m_line.empty() && m_line.back() == '\r')
    m_line.pop_back();
  if (m_number == 1 && m_line.compare(0, kByteOrderMark.size(), kByteOrderMark) == 0)
    m_line.erase(0, kByteOrderMark.size());
  return !is_end;
}

namespace
{
std::string trimmed(const std::string &s)
{
  const std::size_t a = s.find_first_not_of(" \t\r\n"), b = s.find_last_not_of(" \t\r\n");
  return a == std::string::npos ? "" : s.substr(a, b - a + 1);
}

class XmlReader
{
public:
  explicit XmlReader(const std::string &path) : m_path(path), m_text(readSmallFile(path)) {}

  std::vector<XmlElement> read()
  {
    while (m_at < m_text.size())
      if (m_text[m_at] != '<')
        m_inner += take(1);
      else if (!skip("<!--", "-->") && !skip("<?", "?>") && !skip("<!", ">"))
        readTag();
    if (!m_open.empty())
      fail(fmt::format("<{}> is never closed", m_open.back()));
    return std::move(m_elements);
  }

private:
  [[noreturn]] void fail(const std::string &message) const { throw badValue("{}:{}: {}", m_path, m_line, message); }

  std::string take(std::size_t size)
  {
    std::string taken = m_text.substr(m_at, size);
    m_at += taken.size();
    m_line += static_cast<int>(std::count(taken.begin(), taken.end(), '\n'));
    return taken;
  }

  bool skip(const std::string &from, const std::string &to)
  {
    if (m_text.compare(m_at, from.size(), from) != 0)
      return false;
    const std::size_t end = m_text.find(to, m_at + from.size());
    if (end == std::string::npos)
      fail(fmt::format("'{}' without '{}'", from, to));
    take(end + to.size() - m_at);
    return true;
  }

  void readTag()
  {
    constexpr std::size_t kDeepest = 32;
    const std::size_t end = m_text.find('>', m_at);
    if (end == std::string::npos)
      fail("'<' without '>'");
    const std::string tag = take(end + 1 - m_at);
    const bool closes = tag[1] == '/', closed_at_once = tag[tag.size() - 2] == '/';
    const std::string words = tag.substr(closes ? 2 : 1);
    const std::string name = words.substr(0, words.find_first_of(" \t\r\n/>"));
    if (!closes) {
      m_open.push_back(name);
      m_inner.clear();
      m_is_innermost = true;
      if (m_open.size() > kDeepest)
        fail(fmt::format("is nested deeper than {}", kDeepest));
    }
    else if (m_open.empty() || m_open.back() != name)
      fail(fmt::format("</{}> closes what is not open", name));
    if (!closes && !closed_at_once)
      return;
    m_elements.push_back(
        {fmt::format("{}", fmt::join(m_open, "/")), m_is_innermost ? trimmed(m_inner) : std::string(), m_line});
    m_is_innermost = false;
    m_open.pop_back();
  }

  std::string m_path, m_text;
  std::size_t m_at = 0;
  int m_line = 1;
  std::vector<std::string> m_open;
  std::string m_inner; ///< since the last tag that opened
  bool m_is_innermost = false;
  std::vector<XmlElement> m_elements;
};
} // namespace

std::vector<XmlElement> readXml(const std::string &path) { return XmlReader(path).read(); }
} // namespace bole
