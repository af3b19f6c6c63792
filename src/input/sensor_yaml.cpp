// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/sensor_yaml.h"

#include "geometry/failure.h"
#include "geometry/rotation.h"
#include "input/yaml_file.h"

#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
[[noreturn]] void failAt(const std::string &path, const YAML::Mark &mark, const std::string &message)
{
  throw ioError("{}: {}", placeOf(path, mark), message);
}

std::string dumped(const YAML::Node &node)
{
  YAML::Emitter emitter;
  emitter << YAML::Flow << node;
  const std::string text = emitter.c_str();
  return text.size() > 80 ? text.substr(0, 77) + "..." : text;
}

void appendNumbers(const YAML::Node &node, std::vector<double> &numbers)
{
  if (node.IsSequence()) {
    for (const auto &entry : node)
      appendNumbers(entry, numbers);
    return;
  }
  const double value = node.as<double>();
  if (!std::isfinite(value))
    throw YAML::BadConversion(node.Mark());
  numbers.push_back(value);
}
} // namespace

SensorYaml::SensorYaml(const std::string &path, const std::set<std::string> &known_keys) : m_path(path)
{
  m_root = loadYaml(path);
  if (!m_root.IsMap())
    failAt(path, m_root.Mark(), "the file must be a map of keys");
  std::set<std::string> seen;
  for (const auto &entry : m_root) {
    const auto key = entry.first.as<std::string>();
    if (!known_keys.empty() && known_keys.count(key) == 0)
      failAt(path, entry.first.Mark(), fmt::format("unknown key \"{}\"", key));
    if (!seen.insert(key).second)
      failAt(path, entry.first.Mark(), fmt::format("repeated key \"{}\"", key));
  }
}

YAML::Node SensorYaml::at(const std::string &key) const
{
  const YAML::Node node = m_root[key];
  if (!node)
    throw ioError("{}: the key \"{}\" is missing", m_path, key);
  return node;
}

void SensorYaml::fail(const std::string &key, const std::string &must_be) const
{
  const YAML::Node node = at(key);
  failAt(m_path, node.Mark(), fmt::format("{} = {}, must be {}", key, dumped(node), must_be));
}

void SensorYaml::refuse(const std::string &key, const std::string &message) const
{
  if (!has(key))
    throw ioError("{}: {}", m_path, message);
  failAt(m_path, m_root[key].Mark(), fmt::format("{}: {}", key, message));
}

std::string SensorYaml::text(const std::string &key) const
{
  const YAML::Node node = at(key);
  if (!node.IsScalar())
    fail(key, "one word");
  return node.as<std::string>();
}

std::vector<double> SensorYaml::numbers(const std::string &key) const
{
  std::vector<double> values;
  const YAML::Node node = at(key);
  try {
    appendNumbers(node, values);
  }
  catch (const YAML::Exception &) {
    fail(key, "finite numbers");
  }
  return values;
}

std::vector<double> SensorYaml::matrix(const std::string &key) const
{
  std::vector<double> values;
  const YAML::Node node = at(key);
  try {
    appendNumbers(node.IsMap() && node["data"] ? node["data"] : node, values);
  }
  catch (const YAML::Exception &) {
    fail(key, "finite numbers");
  }
  return values;
}

Pose SensorYaml::rigidMotion(const std::string &key) const
{
  const std::vector<double> values = matrix(key);
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
