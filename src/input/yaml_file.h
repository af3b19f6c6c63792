// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The one place where YAML is read: no file makes a reader crash, hang or eat the memory.

#include <bole/pose.h>

#include <optional>
#include <set>
#include <string>
#include <vector>
#include <yaml-cpp/yaml.h>

namespace bole
{
/// The document in \p path, which may be walked without care: aliases are expanded in at most 100,000 nodes, nothing is
/// nested deeper than 32, and no alias holds itself.
/// \throw vpException(ioError) "path:line: ...".
YAML::Node loadYaml(const std::string &path);

/// "path:line" of \p mark.
std::string placeOf(const std::string &path, const YAML::Mark &mark);

/// A YAML map of which every key is known (any key where none is given). Errors are "file:line: key = value, must be
/// ...".
class SensorYaml
{
public:
  SensorYaml(const std::string &path, const std::set<std::string> &known_keys);

  bool has(const std::string &key) const { return static_cast<bool>(m_root[key]); }
  std::string text(const std::string &key) const;
  /// A number, a list of any depth, or a matrix as {cols, rows, data: [...]}, row by row.
  std::vector<double> numbers(const std::string &key) const;
  /// The map under \p key, of any keys.
  SensorYaml at(const std::string &key) const { return SensorYaml(m_path, node(key), {}); }
  /// 4x4 rigid motion under \p key, as {cols, rows, data: [16 numbers]} or a list of four rows.
  Pose rigidMotion(const std::string &key) const;
  [[noreturn]] void fail(const std::string &key, const std::string &must_be) const;
  /// "file:line: key: message", without the line where the key is absent.
  [[noreturn]] void refuse(const std::string &key, const std::string &message) const;

private:
  SensorYaml(std::string path, YAML::Node root, const std::set<std::string> &known_keys);
  YAML::Node node(const std::string &key) const;

  std::string m_path;
  YAML::Node m_root;
};

/// `T_BS` of an EuRoC `sensor.yaml` of any sensor; identity when the file is absent or has no such key.
Pose readSensorPose(const std::string &path);
/// `rate_hz` of a camera file (readCamera()), where it tells one.
std::optional<double> readFrameRate(const std::string &path);
} // namespace bole
