// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/regular_file.h"
#include "geometry/failure.h"

#include <cerrno>
#include <cstring>
#include <filesystem>
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
} // namespace bole
