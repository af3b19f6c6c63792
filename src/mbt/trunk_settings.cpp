// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/trunk_settings.h"

#include <cmath>
#include <fmt/format.h>
#include <fstream>
#include <functional>
#include <iterator>
#include <visp3/core/vpException.h>
#include <visp3/core/vpMath.h>

namespace bole
{
namespace
{
struct Leaf
{
  std::string text;
  int line = 0;
};

/// The part of XML that settings use: nested elements with text, comments, a declaration.
class XmlText
{
public:
  explicit XmlText(const std::string &path) : m_path(path)
  {
    std::ifstream file(path, std::ios::binary);
    if (!file)
      throw vpException(vpException::ioError, fmt::format("{}: cannot be read", path));
    m_text.assign(std::istreambuf_iterator<char>(file), {});
  }

  /// Text of every innermost element, by its path, e.g. "conf/camera/u0".
  std::multimap<std::string, Leaf> leaves()
  {
    std::multimap<std::string, Leaf> found;
    std::vector<std::string> open;
    std::string text;
    bool innermost = false;
    while (m_at < m_text.size()) {
      if (m_text[m_at] != '<') {
        text += m_text[m_at];
        advance(1);
        continue;
      }
      if (skip("<!--", "-->") || skip("<?", "?>") || skip("<!", ">"))
        continue;
      const std::size_t end = m_text.find('>', m_at);
      if (end == std::string::npos)
        fail(m_line, "'<' without '>'");
      std::string tag = m_text.substr(m_at + 1, end - m_at - 1);
      const bool closed_at_once = !tag.empty() && tag.back() == '/';
      const bool closes = !tag.empty() && tag[0] == '/';
      const std::string name = trimmed(closes ? tag.substr(1) : tag.substr(0, tag.find_first_of(" \t\r\n/")));
      if (!closes) {
        open.push_back(name);
        text.clear();
        innermost = true;
      }
      if (closes && (open.empty() || open.back() != name))
        fail(m_line, fmt::format("</{}> closes what is not open", name));
      if (closes || closed_at_once) {
        if (innermost)
          found.emplace(joined(open), Leaf{trimmed(text), m_line});
        innermost = false;
        open.pop_back();
      }
      advance(end + 1 - m_at);
    }
    if (!open.empty())
      fail(m_line, fmt::format("<{}> is never closed", open.back()));
    return found;
  }

  [[noreturn]] void fail(int line, const std::string &message) const
  {
    throw vpException(vpException::badValue, fmt::format("{}:{}: {}", m_path, line, message));
  }

private:
  void advance(std::size_t n)
  {
    for (std::size_t i = 0; i < n && m_at < m_text.size(); ++i, ++m_at)
      m_line += m_text[m_at] == '\n' ? 1 : 0;
  }
  bool skip(const std::string &from, const std::string &to)
  {
    if (m_text.compare(m_at, from.size(), from) != 0)
      return false;
    const std::size_t end = m_text.find(to, m_at + from.size());
    if (end == std::string::npos)
      fail(m_line, fmt::format("'{}' without '{}'", from, to));
    advance(end + to.size() - m_at);
    return true;
  }
  static std::string trimmed(const std::string &s)
  {
    const std::size_t a = s.find_first_not_of(" \t\r\n"), b = s.find_last_not_of(" \t\r\n");
    return a == std::string::npos ? "" : s.substr(a, b - a + 1);
  }
  static std::string joined(const std::vector<std::string> &names)
  {
    std::string path;
    for (const std::string &name : names)
      path += (path.empty() ? "" : "/") + name;
    return path;
  }

  std::string m_path, m_text;
  std::size_t m_at = 0;
  int m_line = 1;
};

double number(const XmlText &xml, const std::string &key, const Leaf &leaf)
{
  std::size_t used = 0;
  double value = NAN;
  try {
    value = std::stod(leaf.text, &used);
  }
  catch (const std::exception &) {
    used = std::string::npos;
  }
  if (used != leaf.text.size() || !std::isfinite(value))
    xml.fail(leaf.line, fmt::format("{} = {}, must be a number", key, leaf.text));
  return value;
}

using Setter = std::function<void(vpMbTrunkTracker::Options &, double)>;

const std::map<std::string, Setter> &trunkKeys()
{
  using O = vpMbTrunkTracker::Options;
  static const std::map<std::string, Setter> keys = {
      {"pieces", [](O &o, double v) { o.trunk.pieces = int(v); }},
      {"samples", [](O &o, double v) { o.trunk.samples = int(v); }},
      {"margin_px", [](O &o, double v) { o.trunk.margin_px = v; }},
      {"min_length_px", [](O &o, double v) { o.trunk.min_length_px = v; }},
      {"min_width_px", [](O &o, double v) { o.trunk.min_width_px = v; }},
      {"min_contrast", [](O &o, double v) { o.trunk.min_contrast = v; }},
      {"border_sigma_px", [](O &o, double v) { o.border_sigma_px = v; }},
      {"lean_sigma_rad", [](O &o, double v) { o.lean_sigma_rad = v; }},
      {"radius_sigma", [](O &o, double v) { o.radius_sigma = v; }},
      {"scan_min_px", [](O &o, double v) { o.scan_min_px = v; }},
      {"scan_max_px", [](O &o, double v) { o.scan_max_px = v; }},
      {"refine_px", [](O &o, double v) { o.refine_px = v; }},
      {"refinements", [](O &o, double v) { o.refinements = int(v); }},
      {"step_sigma_m", [](O &o, double v) { o.step_sigma_m = v; }},
      {"climb_sigma_m", [](O &o, double v) { o.climb_sigma_m = v; }},
      {"turn_sigma_rad", [](O &o, double v) { o.turn_sigma_rad = v; }},
      {"accel_sigma_m", [](O &o, double v) { o.accel_sigma_m = v; }},
      {"memory_rate", [](O &o, double v) { o.memory_rate = v; }},
      {"min_support", [](O &o, double v) { o.min_support = v; }},
      {"min_agreement", [](O &o, double v) { o.min_agreement = v; }},
      {"max_jump", [](O &o, double v) { o.max_jump = v; }},
      {"max_sigma_m", [](O &o, double v) { o.max_sigma_m = v; }},
      {"max_sigma_rad", [](O &o, double v) { o.max_sigma_rad = v; }},
      {"unobserved_m", [](O &o, double v) { o.unobserved_m = v; }},
      {"lever_m", [](O &o, double v) { o.lever_m = v; }},
      {"detect_frozen", [](O &o, double v) { o.health.detect_frozen = v != 0; }},
  };
  return keys;
}

void readTrunkSection(const XmlText &xml, const std::multimap<std::string, Leaf> &leaves, TrunkSettings &settings)
{
  const std::string section = "conf/trunk/";
  for (auto it = leaves.lower_bound(section); it != leaves.end() && it->first.compare(0, section.size(), section) == 0;
       ++it) {
    const std::string key = it->first.substr(section.size());
    const auto setter = trunkKeys().find(key);
    if (setter == trunkKeys().end())
      xml.fail(it->second.line, fmt::format("trunk/{}: no such key", key));
    if (leaves.count(it->first) > 1)
      xml.fail(it->second.line, fmt::format("trunk/{}: given twice", key));
    setter->second(settings.options, number(xml, key, it->second));
    try {
      settings.options.validate();
    }
    catch (const vpException &error) {
      xml.fail(it->second.line, error.getStringMessage());
    }
  }
}
} // namespace

TrunkSettings readTrunkSettings(const std::string &path, const vpMbTrunkTracker::Options &options, bool verbose)
{
  XmlText xml(path);
  const std::multimap<std::string, Leaf> leaves = xml.leaves();
  TrunkSettings settings;
  settings.options = options;
  const auto get = [&](const std::string &key) -> std::optional<double> {
    const auto it = leaves.find("conf/" + key);
    return it == leaves.end() ? std::nullopt : std::optional<double>(number(xml, key, it->second));
  };
  const auto u0 = get("camera/u0"), v0 = get("camera/v0"), px = get("camera/px"), py = get("camera/py");
  const int given = int(u0.has_value()) + int(v0.has_value()) + int(px.has_value()) + int(py.has_value());
  if (given != 0 && given != 4)
    xml.fail(1, "camera: must hold u0, v0, px and py");
  if (given == 4) {
    if (!(*px > 0 && *py > 0))
      xml.fail(1, fmt::format("camera: px = {}, py = {}, must be above 0", *px, *py));
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
  readTrunkSection(xml, leaves, settings);
  if (verbose)
    fmt::print("{}: {} settings\n", path, leaves.size());
  return settings;
}
} // namespace bole
