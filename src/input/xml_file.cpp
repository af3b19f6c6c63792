// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "input/regular_file.h"
#include "input/yaml_file.h"

#include <algorithm>
#include <fmt/ranges.h>

namespace bole
{
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
