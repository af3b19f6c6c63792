// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/trunk_settings.h"

#include "geometry/require_range.h"
#include "input/yaml_file.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
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
  explicit XmlText(const std::string &path) : m_path(path), m_text(readSmallFile(path)) {}

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

void readTrunkSection(const XmlText &xml, const std::multimap<std::string, Leaf> &leaves, TrunkSettings &settings)
{
  const std::string section = "conf/trunk/";
  for (auto it = leaves.lower_bound(section); it != leaves.end() && it->first.compare(0, section.size(), section) == 0;
       ++it) {
    const std::string key = it->first.substr(section.size());
    const auto option = std::find_if(std::begin(kOptions), std::end(kOptions),
                                     [&](const OptionKey &known) { return key == known.name; });
    if (option == std::end(kOptions))
      xml.fail(it->second.line, fmt::format("trunk/{}: no such key", key));
    if (leaves.count(it->first) > 1)
      xml.fail(it->second.line, fmt::format("trunk/{}: given twice", key));
    settings.options.*option->member = number(xml, key, it->second);
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

void vpMbTrunkTracker::Options::validate() const
{
  for (const bole::OptionKey &option : bole::kOptions)
    bole::requireRange(option.name, this->*option.member, option.low, option.high);
}
