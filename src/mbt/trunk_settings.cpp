// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/trunk_settings.h"

#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "input/regular_file.h"

#include <algorithm>
#include <fmt/format.h>
#include <map>
#include <visp3/core/vpException.h>
#include <visp3/core/vpMath.h>

namespace bole
{
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
