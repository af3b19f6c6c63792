// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"
#include "support/text.h"

#include <algorithm>
#include <cmath>
#include <fmt/ranges.h>
#include <set>
#include <type_traits>
#include <visp3/core/vpException.h>
#include <yaml-cpp/yaml.h>

namespace bole
{
namespace
{
YAML::Node loadYaml(const std::string &path)
{
  try {
    return YAML::LoadFile(path);
  }
  catch (const YAML::BadFile &) {
    throw ioError("{}: no such file", path);
  }
  catch (const YAML::Exception &error) {
    throw ioError("{}:{}: {}", path, std::max(error.mark.line, 0) + 1, error.msg);
  }
}

/// Names every field of a scene to \p visit(section, key, field), a number with its range behind it: for reading,
/// writing and checking alike.
template <class Scene, class Visit> void visitFields(Scene &scene, Visit &&visit)
{
  auto &forest = scene.forest;
  visit("forest", "seed", forest.seed);
  visit("forest", "density", forest.density, 0, 0.3);
  visit("forest", "light", forest.light);
  visit("forest", "bark", forest.bark);
  visit("forest", "radius_median", forest.radius_median, 0.02, 1);
  visit("forest", "radius_spread", forest.radius_spread, 0, 1);
  visit("forest", "lean_deg", forest.lean_deg, 0, 20);
  visit("forest", "bow", forest.bow, 0, 0.5);
  visit("forest", "flare", forest.flare, 0, 2);
  visit("forest", "crown_leaves", forest.crown_leaves, 0, 2000);
  visit("forest", "undergrowth", forest.undergrowth, 0, 1);
  visit("forest", "saplings", forest.saplings, 0, 1);
  visit("forest", "ground_amplitude", forest.ground_amplitude, 0, 1);
  visit("forest", "margin", forest.margin, 5, 40);
  visit("forest", "clearance", forest.clearance, 0, 3);
  auto &flight = scene.flight;
  visit("flight", "path", flight.kind);
  visit("flight", "seed", flight.seed);
  visit("flight", "speed", flight.speed, 0.05, 10);
  visit("flight", "laps", flight.laps, 0.1, 1000);
  visit("flight", "height", flight.height, 0.3, 10);
  visit("flight", "wobble_deg", flight.wobble_deg, 0, 20);
  auto &renderer = scene.renderer;
  visit("camera", "width", renderer.camera.pinhole.width);
  visit("camera", "height", renderer.camera.pinhole.height);
  visit("camera", "fx", renderer.camera.pinhole.fx);
  visit("camera", "fy", renderer.camera.pinhole.fy);
  visit("camera", "cx", renderer.camera.pinhole.cx);
  visit("camera", "cy", renderer.camera.pinhole.cy);
  visit("camera", "distortion", renderer.camera.distortion);
  visit("camera", "coefficients", renderer.camera.coefficients);
  visit("camera", "rate_hz", scene.rate_hz, 1, 120);
  visit("camera", "exposure_ms", scene.exposure_ms, 0, 100);
  visit("camera", "samples_per_pixel", renderer.samples_per_pixel);
  visit("camera", "exposure_target", renderer.exposure_target);
  visit("camera", "exposure_lag_frames", renderer.exposure_lag_frames);
  visit("camera", "gain_step", renderer.gain_step);
  visit("camera", "read_noise", renderer.read_noise);
  visit("camera", "shot_noise", renderer.shot_noise);
  visit("camera", "noise_seed", renderer.noise_seed);
  visit("camera", "h264_kbps", scene.h264_kbps, 0, 20000);
  auto &sensors = scene.sensors;
  visit("sensors", "seed", sensors.seed);
  visit("sensors", "gyro_noise", sensors.gyro_noise, 0, 1);
  visit("sensors", "gyro_bias", sensors.gyro_bias, 0, 1);
  visit("sensors", "accelerometer_noise", sensors.accelerometer_noise, 0, 10);
  visit("sensors", "accelerometer_bias", sensors.accelerometer_bias, 0, 10);
  visit("sensors", "odometry_step_noise", sensors.odometry_step_noise, 0, 1);
  visit("sensors", "odometry_scale", sensors.odometry_scale, 0, 0.5);
  visit("sensors", "height_noise", sensors.height_noise, 0, 1);
  visit("sensors", "attitude_noise", sensors.attitude_noise, 0, 0.5);
  visit("sensors", "yaw_walk", sensors.yaw_walk, 0, 0.5);
}

template <class Trunk, class Visit> void visitTrunk(Trunk &trunk, Visit &&visit)
{
  visit("trunks", "x", trunk.foot.x());
  visit("trunks", "y", trunk.foot.y());
  visit("trunks", "radius", trunk.radius);
  visit("trunks", "lean_x", trunk.lean.x());
  visit("trunks", "lean_y", trunk.lean.y());
  visit("trunks", "bow_x", trunk.bow.x());
  visit("trunks", "bow_y", trunk.bow.y());
  visit("trunks", "taper", trunk.taper);
  visit("trunks", "flare", trunk.flare);
  visit("trunks", "height", trunk.height);
  visit("trunks", "crown_base", trunk.crown_base);
  visit("trunks", "crown_radius", trunk.crown_radius);
  visit("trunks", "shade", trunk.shade);
  visit("trunks", "bright", trunk.bright);
}

/// Reads one mapping; every key that nobody asked for is an error.
class Section
{
public:
  Section(const std::string &file, const YAML::Node &node, const std::string &name)
      : m_file(file), m_node(node), m_name(name)
  {
    if (node && !node.IsMap())
      fail(node, name, "a mapping of keys to values");
  }
  template <class T> void read(const char *key, T &field)
  {
    m_known.insert(key);
    const YAML::Node node = m_node ? m_node[key] : YAML::Node(YAML::NodeType::Undefined);
    if (node)
      assign(node, key, field);
  }
  void finish() const
  {
    std::set<std::string> seen;
    for (const auto &entry : m_node) {
      const std::string key = entry.first.as<std::string>();
      if (!m_known.count(key))
        fail(entry.first, key, fmt::format("a key of the section {}", m_name));
      if (!seen.insert(key).second)
        fail(entry.first, key, "given once");
    }
  }
  [[noreturn]] void fail(const YAML::Node &node, const std::string &key, const std::string &wanted) const
  {
    const std::string value = node.IsScalar() && node.Scalar() != key ? " = " + node.Scalar() : "";
    throw badValue("{}:{}: {}{}, must be {}", m_file, node.Mark().line + 1, key, value, wanted);
  }

private:
  template <class T> void assign(const YAML::Node &node, const char *key, T &field) const
  {
    constexpr const char *kWanted = std::is_same_v<T, double> ? "a number"
                                    : std::is_same_v<T, bool> ? "true or false"
                                    : std::is_unsigned_v<T>   ? "a whole number, 0 or more"
                                                              : "a whole number";
    if constexpr (std::is_enum_v<T>)
      assignWord(node, key, field);
    else if (T value{}; node.IsScalar() && YAML::convert<T>::decode(node, value))
      field = value;
    else
      fail(node, key, kWanted);
    if constexpr (std::is_same_v<T, double>)
      if (!std::isfinite(field))
        fail(node, key, "a finite number");
  }
  void assign(const YAML::Node &node, const char *key, std::array<double, 4> &field) const
  {
    if (!node.IsSequence() || node.size() != 4)
      fail(node, key, "a list of four numbers");
    for (std::size_t k = 0; k < 4; ++k)
      assign(node[k], key, field[k]);
  }
  template <class T> void assignWord(const YAML::Node &node, const char *key, T &field) const
  {
    std::string wanted;
    for (const auto &[word, value] : wordsOf(field)) {
      if (node.IsScalar() && node.Scalar() == word) {
        field = value;
        return;
      }
      wanted += (wanted.empty() ? "" : ", ") + word;
    }
    fail(node, key, "one of " + wanted);
  }

  std::string m_file;
  YAML::Node m_node;
  std::string m_name;
  std::set<std::string> m_known;
};

template <class T> std::string text(const T &value)
{
  if constexpr (std::is_enum_v<T>)
    return toString(value);
  else
    return fmt::format("{}", value);
}

void readTrunks(const std::string &path, const YAML::Node &node, std::vector<SimulatedTrunk> &trunks)
{
  if (node && !node.IsSequence())
    Section(path, {}, "trunks").fail(node, "trunks", "a list");
  for (const YAML::Node &entry : node) {
    Section section(path, entry, "trunks");
    SimulatedTrunk trunk;
    visitTrunk(trunk, [&](const char *, const char *key, auto &field) { section.read(key, field); });
    section.finish();
    if (!(trunk.radius >= 0.01 && trunk.radius <= 2) || !(trunk.height >= 1 && trunk.height <= 100))
      section.fail(entry, "trunk", "of a radius of 0.01 to 2 and a height of 1 to 100");
    trunks.push_back(trunk);
  }
}
} // namespace

void SceneOptions::validate() const
{
  visitFields(*this, [](const char *, const char *key, const auto &field, auto... range) {
    if constexpr (sizeof...(range) == 2)
      requireRange(key, static_cast<double>(field), range...);
  });
  renderer.validate();
}

SceneOptions readScene(const std::string &path)
{
  const YAML::Node root = loadYaml(path);
  SceneOptions scene;
  if (!root.IsMap())
    throw badValue("{}:1: a scene must be a mapping of sections", path);
  const char *names[] = {"forest", "flight", "camera", "sensors"};
  Section top(path, root, "scene");
  YAML::Node trunks;
  for (const auto &entry : root) {
    const std::string name = entry.first.as<std::string>();
    if (name == "trunks") {
      readTrunks(path, entry.second, scene.trunks);
      continue;
    }
    if (std::find(std::begin(names), std::end(names), name) == std::end(names))
      top.fail(entry.first, name, "one of the sections forest, flight, camera, sensors, trunks");
    Section section(path, entry.second, name);
    visitFields(scene, [&](const char *of, const char *key, auto &field, auto...) {
      if (name == of)
        section.read(key, field);
    });
    section.finish();
  }
  try {
    scene.validate();
  }
  catch (const vpException &error) {
    throw badValue("{}: {}", path, error.getStringMessage());
  }
  return scene;
}

std::string sceneText(const SceneOptions &scene)
{
  std::string out = "# A scene of `bole simulate --scene`. Lengths in metres.\n", current;
  visitFields(scene, [&](const char *section, const char *key, const auto &field, auto...) {
    if (current != section) {
      out += fmt::format("{}:\n", section);
      current = section;
    }
    out += fmt::format("  {}: {}\n", key, text(field));
  });
  if (!scene.trunks.empty())
    out += "trunks:\n";
  for (const SimulatedTrunk &trunk : scene.trunks) {
    std::string line;
    visitTrunk(trunk, [&](const char *, const char *key, const auto &field) {
      line += fmt::format("{}{}: {}", line.empty() ? "" : ", ", key, text(field));
    });
    out += fmt::format("  - {{{}}}\n", line);
  }
  return out;
}
} // namespace bole
