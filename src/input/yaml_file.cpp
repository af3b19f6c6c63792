// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/yaml_file.h"

#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "geometry/so3.h"
#include "input/regular_file.h"

#include <algorithm>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr int kDeepest = 32;
constexpr int kMostNodes = 100000;

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

namespace
{
[[noreturn]] void failAt(const std::string &path, const YAML::Mark &mark, const std::string &message)
{
  throw ioError("{}: {}", placeOf(path, mark), message);
}

/// On one line and not too long.
std::string dumped(const YAML::Node &node)
{
  YAML::Emitter emitter;
  emitter << YAML::Flow << node;
  std::string text;
  for (const char *c = emitter.c_str(); *c != '\0'; ++c)
    if (*c != '\n' && (*c != ' ' || text.empty() || text.back() != ' '))
      text += *c;
    else if (*c == '\n' && !text.empty() && text.back() != ' ')
      text += ' ';
  return text.size() > 80 ? text.substr(0, 77) + "..." : text;
}

/// False where one is none.
bool appendNumbers(const YAML::Node &node, std::vector<double> &numbers)
{
  if (node.IsMap() && node["data"]) { // a matrix as OpenCV and ROS write it
    const auto side = [&](const char *key) { return parseNumber<double>(node[key].as<std::string>("")).value_or(0); };
    const std::size_t before = numbers.size();
    const bool are_numbers = appendNumbers(node["data"], numbers);
    return are_numbers &&
           (!node["rows"] || side("rows") * side("cols") == static_cast<double>(numbers.size() - before));
  }
  if (node.IsSequence())
    return std::all_of(node.begin(), node.end(), [&](const auto &entry) { return appendNumbers(entry, numbers); });
  const auto value = node.IsScalar() ? parseNumber<double>(node.Scalar()) : std::nullopt;
  numbers.push_back(value.value_or(0));
  return value.has_value();
}
} // namespace

SensorYaml::SensorYaml(const std::string &path, const std::set<std::string> &known_keys)
    : SensorYaml(path, loadYaml(path), known_keys)
{
}

SensorYaml::SensorYaml(std::string path, YAML::Node root, const std::set<std::string> &known_keys)
    : m_path(std::move(path)), m_root(std::move(root))
{
  if (!m_root.IsMap())
    failAt(m_path, m_root.Mark(), "the file must be a map of keys");
  std::set<std::string> seen;
  for (const auto &entry : m_root) {
    const auto key = entry.first.as<std::string>();
    if (!known_keys.empty() && known_keys.count(key) == 0)
      failAt(m_path, entry.first.Mark(), fmt::format("unknown key \"{}\"", key));
    if (!seen.insert(key).second)
      failAt(m_path, entry.first.Mark(), fmt::format("repeated key \"{}\"", key));
  }
}

YAML::Node SensorYaml::node(const std::string &key) const
{
  const YAML::Node found = m_root[key];
  if (!found)
    throw ioError("{}: the key \"{}\" is missing", m_path, key);
  return found;
}

void SensorYaml::fail(const std::string &key, const std::string &must_be) const
{
  const YAML::Node found = node(key);
  failAt(m_path, found.Mark(), fmt::format("{} = {}, must be {}", key, dumped(found), must_be));
}

void SensorYaml::refuse(const std::string &key, const std::string &message) const
{
  if (!has(key))
    throw ioError("{}: {}", m_path, message);
  failAt(m_path, m_root[key].Mark(), fmt::format("{}: {}", key, message));
}

std::string SensorYaml::text(const std::string &key) const
{
  const YAML::Node found = node(key);
  if (!found.IsScalar())
    fail(key, "one word");
  return found.Scalar();
}

std::vector<double> SensorYaml::numbers(const std::string &key) const
{
  std::vector<double> values;
  if (!appendNumbers(node(key), values))
    fail(key, "finite numbers, of a matrix rows times cols");
  return values;
}

Pose SensorYaml::rigidMotion(const std::string &key) const
{
  const std::vector<double> values = numbers(key);
  if (values.size() != 16)
    fail(key, "16 numbers");
  const Eigen::Matrix4d T = Eigen::Map<const Eigen::Matrix<double, 4, 4, Eigen::RowMajor>>(values.data());
  const Eigen::Matrix3d R = T.topLeftCorner<3, 3>();
  const bool is_rigid = isRotation(R) && (T.row(3) - Eigen::RowVector4d(0, 0, 0, 1)).norm() < 1e-9;
  if (!is_rigid)
    fail(key, "a rigid motion");
  return Pose(R, T.topRightCorner<3, 1>());
}
} // namespace bole
