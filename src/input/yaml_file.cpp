// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/yaml_file.h"
#include "geometry/failure.h"
#include "input/regular_file.h"

#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr int kDeepest = 32;
constexpr int kMostNodes = 100000;
constexpr std::size_t kMostBytes = 1000000; ///< of a file that people write

/// The encoding, and brackets that the parser would follow into the depth.
void checkText(const std::string &path, std::string &text)
{
  if (text.rfind("\xEF\xBB\xBF", 0) == 0) // of UTF-8: harmless
    text.erase(0, 3);
  int line = 1, depth = 0;
  for (const char c : text) {
    line += c == '\n' ? 1 : 0;
    depth += c == '[' || c == '{' ? 1 : 0;
    depth -= (c == ']' || c == '}') && depth > 0 ? 1 : 0;
    if (c == '\0' || c == '\xFE' || c == '\xFF')
      throw ioError("{}:{}: is no text in UTF-8", path, line);
    if (depth > kDeepest)
      throw ioError("{}:{}: is nested deeper than {}", path, line, kDeepest);
  }
}

/// Walks the document as its readers do: an alias is a node again wherever it stands.
class Walk
{
public:
  explicit Walk(const std::string &path) : m_path(path) {}

  void into(const YAML::Node &node, int depth)
  {
    if (node.Mark().line > m_line)
      m_line = node.Mark().line;
    if (depth > kDeepest)
      throw ioError("{}:{}: is nested deeper than {}, or holds itself by an alias", m_path, node.Mark().line + 1,
                    kDeepest);
    if (++m_nodes > kMostNodes)
      throw ioError("{}:{}: aliases make more than {} entries of it", m_path, m_line + 1, kMostNodes);
    if (!node.IsMap() && !node.IsSequence())
      return;
    for (const auto &child : node) {
      if (node.IsSequence()) {
        into(child, depth + 1);
        continue;
      }
      if (!child.first.IsScalar())
        throw ioError("{}: a key must be one word", placeOf(m_path, child.first.Mark()));
      into(child.second, depth + 1);
    }
  }

private:
  std::string m_path;
  int m_nodes = 0, m_line = 0;
};
} // namespace

std::string readSmallFile(const std::string &path) { return readWholeFile(path, kMostBytes); }

std::string placeOf(const std::string &path, const YAML::Mark &mark)
{
  return mark.line < 0 ? path + ":1" : fmt::format("{}:{}", path, mark.line + 1);
}

YAML::Node loadYaml(const std::string &path)
{
  std::string text = readSmallFile(path);
  checkText(path, text);
  try {
    const YAML::Node root = YAML::Load(text);
    Walk(path).into(root, 0);
    return root;
  }
  catch (const YAML::Exception &error) {
    throw ioError("{}: {}", placeOf(path, error.mark), error.msg);
  }
}
} // namespace bole
