// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/model_files.h"
#include "geometry/constants.h"
#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "input/atomic_file.h"
#include "input/regular_file.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <map>
#include <optional>
#include <visp3/core/vpException.h>
#include <visp3/core/vpMath.h>

namespace bole
{
namespace
{
/// The lines that say something, without comments, as words.
class CaoLines
{
public:
  explicit CaoLines(const std::string &path) : m_lines(path) {}

  /// False at the end of the file.
  bool next()
  {
    m_words.clear();
    while (m_words.empty() && m_lines.next()) {
      m_text = m_lines.line().substr(0, m_lines.line().find('#'));
      for (std::size_t end = 0, at; (at = m_text.find_first_not_of(" \t", end)) != std::string::npos;) {
        end = std::min(m_text.find_first_of(" \t", at), m_text.size());
        m_words.push_back(m_text.substr(at, end - at));
      }
    }
    return !m_words.empty();
  }

  /// The next line; \p what is missing if there is none.
  void require(const char *what)
  {
    if (!next())
      fail(fmt::format("the file ends, must go on with {}", what));
  }

  [[noreturn]] void fail(const std::string &message) const
  {
    throw badValue("{}:{}: {}", m_lines.name(), m_lines.number(), message);
  }

  const std::string &word(std::size_t i) const { return m_words.at(i); }
  const std::string &text() const { return m_text; }

  /// Word \p i of the line, which must hold \p what.
  template <class Number> Number number(std::size_t i, const char *what) const
  {
    const auto value = i < m_words.size() ? parseNumber<Number>(m_words[i]) : std::nullopt;
    if (!value)
      fail(fmt::format("'{}', must be {}", m_text, what));
    return *value;
  }

  /// How many of \p what follow; the rest of the line says nothing.
  int count(const char *what) const
  {
    const int n = number<int>(0, fmt::format("the number of {}", what).c_str());
    if (n < 0 || n > 100000)
      fail(fmt::format("{} = {}, must be 0 .. 100000", what, n));
    return n;
  }

private:
  TextLines m_lines;
  std::string m_text;
  std::vector<std::string> m_words;
};

/// `name=oak` or `name="old oak"` among the words behind a radius.
std::string nameIn(const std::string &line)
{
  const std::string key = "name=";
  const std::size_t at = line.find(key);
  if (at == std::string::npos)
    return "";
  const std::string name = line.substr(at + key.size());
  return name[0] == '"' ? name.substr(1, name.find('"', 1) - 1) : name.substr(0, name.find_first_of(" \t"));
}

Cylinder readCylinder(const CaoLines &file, const std::vector<Eigen::Vector3d> &points)
{
  constexpr double kWidest_m = 5, kFarthest_m = 10000;
  constexpr const char *kWhat = "two points and a radius";
  Cylinder cylinder;
  Eigen::Vector3d *const ends[] = {&cylinder.foot, &cylinder.top};
  for (std::size_t i = 0; i < 2; ++i) {
    const int index = file.number<int>(i, kWhat);
    if (index < 0 || index >= int(points.size()))
      file.fail(fmt::format("point = {}, must be 0 .. {}", index, int(points.size()) - 1));
    *ends[i] = points[std::size_t(index)];
    if (!(ends[i]->norm() <= kFarthest_m))
      file.fail(fmt::format("point {} is {:g} m from the origin, must be at most {:g} m (millimetres?)", index,
                            ends[i]->norm(), kFarthest_m));
  }
  cylinder.radius = file.number<double>(2, kWhat);
  if (!(cylinder.radius > 0 && cylinder.radius <= kWidest_m))
    file.fail(fmt::format("radius = {:g}, must be above 0 and at most {:g} m{}", cylinder.radius, kWidest_m,
                          cylinder.radius > 0 ? " (millimetres?)" : ""));
  if (!((cylinder.top - cylinder.foot).norm() > 1e-6))
    file.fail("the two points of the axis must differ");
  cylinder.name = nameIn(file.text());
  return cylinder;
}
} // namespace

std::vector<Cylinder> readCao(const std::string &path)
{
  CaoLines file(path);
  file.require("V1");
  if (file.word(0) != "V0" && file.word(0) != "V1" && file.word(0) != "V2")
    file.fail(fmt::format("version = {}, must be V1", file.word(0)));
  file.require("the number of points");
  if (file.word(0).rfind("load", 0) == 0)
    file.fail(fmt::format("'{}': models inside models are not read", file.text()));
  std::vector<Eigen::Vector3d> points;
  for (int left = file.count("points"); left > 0; --left) {
    file.require("a point");
    Eigen::Vector3d p;
    for (int c = 0; c < 3; ++c)
      p(c) = file.number<double>(std::size_t(c), "three numbers");
    points.push_back(p);
  }
  for (const char *part : {"lines", "faces from lines", "faces from points"}) {
    file.require(part);
    for (int left = file.count(part); left > 0; --left)
      file.require(part);
  }
  std::vector<Cylinder> cylinders;
  for (int left = file.next() ? file.count("cylinders") : 0; left > 0; --left) {
    file.require("a cylinder");
    cylinders.push_back(readCylinder(file, points));
  }
  if (cylinders.empty())
    throw badValue("{}: no cylinder in it, must have one a trunk", path);
  return cylinders;
}

std::vector<Cylinder> readTrunkModel(const std::string &path)
{
  constexpr double kLargestLean = 45;
  std::vector<Cylinder> trunks = readCao(path);
  for (const Cylinder &trunk : trunks)
    if (const double lean = std::acos(std::min(1.0, std::abs(trunk.axis().z()))) / kDegree; lean > kLargestLean)
      throw badValue("{}: cylinder {}{} lies: its axis is {:.0f} degrees off z, which is up, must be at most {:g}",
                     path, &trunk - trunks.data() + 1, trunk.name.empty() ? "" : " (" + trunk.name + ")", lean,
                     kLargestLean);
  return trunks;
}

void writeCao(const std::string &path, const std::vector<Cylinder> &cylinders, const std::string &comment)
{
  std::string text = comment.empty() ? "V1\n" : fmt::format("V1\n# {}\n", comment);
  text += fmt::format("{} # points\n", 2 * cylinders.size());
  for (const Cylinder &c : cylinders)
    for (const Eigen::Vector3d &p : {c.foot, c.top})
      text += fmt::format("{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
  text += fmt::format("0 # lines\n0 # faces from lines\n0 # faces from points\n{} # cylinders\n", cylinders.size());
  for (std::size_t k = 0; k < cylinders.size(); ++k)
    text += fmt::format("{} {} {:.6f}{}\n", 2 * k, 2 * k + 1, cylinders[k].radius,
                        cylinders[k].name.empty() ? "" : fmt::format(" name=\"{}\"", cylinders[k].name));
  writeAtomically(path, text + "0 # circles\n");
}

namespace
{
using Leaves = std::multimap<std::string, XmlElement>;

[[noreturn]] void fail(const std::string &path, int line, const std::string &message)
{
  throw badValue("{}:{}: {}", path, line, message);
}

double number(const std::string &path, const std::string &key, const XmlElement &leaf)
{
  if (const auto value = parseNumber<double>(leaf.text))
    return *value;
  fail(path, leaf.line, fmt::format("{} = {}, must be a number", key, leaf.text));
}

using Options = vpMbTrunkTracker::Options;

/// An option of `trunk`: its key and its range.
struct OptionKey
{
  const char *name;
  double Options::*member;
  double low, high;
};

constexpr OptionKey kOptions[] = {
    {"border_sigma_px", &Options::border_sigma_px, 0.1, 20}, {"lean_sigma_rad", &Options::lean_sigma_rad, 1e-4, 0.5},
    {"radius_sigma", &Options::radius_sigma, 1e-3, 1},       {"min_length_px", &Options::min_length_px, 4, 1000},
    {"min_width_px", &Options::min_width_px, 1, 100},        {"min_contrast", &Options::min_contrast, 0, 50},
    {"scan_max_px", &Options::scan_max_px, 8, 100},          {"step_sigma_m", &Options::step_sigma_m, 1e-3, 10},
    {"turn_sigma_rad", &Options::turn_sigma_rad, 1e-4, 1},   {"min_support", &Options::min_support, 0.05, 1},
    {"max_sigma_m", &Options::max_sigma_m, 1e-3, 100},       {"max_sigma_rad", &Options::max_sigma_rad, 1e-3, 3.2},
    {"unobserved_m", &Options::unobserved_m, 0.01, 10},      {"lever_m", &Options::lever_m, 0.1, 100},
    {"detect_frozen", &Options::detect_frozen, 0, 1},
};

void readTrunkSection(const std::string &path, const Leaves &leaves, TrunkSettings &settings)
{
  const std::string section = "conf/trunk/";
  for (auto it = leaves.lower_bound(section); it != leaves.end() && it->first.compare(0, section.size(), section) == 0;
       ++it) {
    const std::string key = it->first.substr(section.size());
    const auto option = std::find_if(std::begin(kOptions), std::end(kOptions),
                                     [&](const OptionKey &known) { return key == known.name; });
    if (option == std::end(kOptions))
      fail(path, it->second.line, fmt::format("trunk/{}: no such key", key));
    if (leaves.count(it->first) > 1)
      fail(path, it->second.line, fmt::format("trunk/{}: given twice", key));
    settings.options.*option->member = number(path, key, it->second);
    try {
      settings.options.validate();
    }
    catch (const vpException &error) {
      fail(path, it->second.line, error.getStringMessage());
    }
  }
}
} // namespace

TrunkSettings readTrunkSettings(const std::string &path, const vpMbTrunkTracker::Options &options, bool verbose)
{
  Leaves leaves;
  for (const XmlElement &element : readXml(path))
    leaves.emplace(element.path, element);
  TrunkSettings settings;
  settings.options = options;
  const auto get = [&](const std::string &key) -> std::optional<double> {
    const auto it = leaves.find("conf/" + key);
    return it == leaves.end() ? std::nullopt : std::optional<double>(number(path, key, it->second));
  };
  const auto u0 = get("camera/u0"), v0 = get("camera/v0"), px = get("camera/px"), py = get("camera/py");
  const int given = int(u0.has_value()) + int(v0.has_value()) + int(px.has_value()) + int(py.has_value());
  if (given != 0 && given != 4)
    fail(path, 1, "camera: must hold u0, v0, px and py");
  if (given == 4) {
    if (!(*px > 0 && *py > 0))
      fail(path, 1, fmt::format("camera: px = {}, py = {}, must be above 0", *px, *py));
    settings.has_camera = true;
    settings.camera.initPersProjWithoutDistortion(*px, *py, *u0, *v0);
  }
  settings.near_clipping = get("face/near_clipping");
  settings.far_clipping = get("face/far_clipping");
  settings.fov_clipping = get("face/fov_clipping").value_or(0) != 0;
  if (const auto angle = get("face/angle_appear"))
    settings.angle_appear = vpMath::rad(*angle);
  if (const auto angle = get("face/angle_disappear"))
    settings.angle_disappear = vpMath::rad(*angle);
  readTrunkSection(path, leaves, settings);
  if (verbose)
    fmt::print("{}: read\n", path);
  return settings;
}
} // namespace bole

void vpMbTrunkTracker::Options::validate() const
{
  for (const bole::OptionKey &option : bole::kOptions)
    bole::requireRange(option.name, this->*option.member, option.low, option.high);
}
