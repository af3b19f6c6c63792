// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/option_table.h"

#include "geometry/parse_number.h"

#include <fmt/format.h>

namespace bole
{
namespace
{
template <typename T> bool parse(const std::string &text, T &value)
{
  const auto read = parseNumber<T>(text);
  value = read.value_or(value);
  return read.has_value();
}

std::string named(const OptionBound &bound)
{
  return bound.key != nullptr ? fmt::format("{} = {}", bound.key, bound.value) : fmt::format("{}", bound.value);
}

std::string nameOr(const OptionBound &bound)
{
  return bound.key != nullptr ? bound.key : fmt::format("{}", bound.value);
}
} // namespace

std::string OptionEntry::text() const
{
  if (isNumber())
    return std::visit([](const auto *v) { return fmt::format("{}", static_cast<double>(*v)); }, value);
  return *std::get<bool *>(value) ? "true" : "false";
}

std::string OptionEntry::allowed() const
{
  if (!isNumber())
    return "true or false";
  return fmt::format("a {}number in [{}, {}]", std::holds_alternative<int *>(value) ? "whole " : "", named(low),
                     named(high));
}

std::string OptionEntry::range() const
{
  return isNumber() ? fmt::format("{} to {}", nameOr(low), nameOr(high)) : "true, false";
}

bool OptionEntry::isInRange() const
{
  if (!isNumber())
    return true;
  const double number = std::holds_alternative<int *>(value) ? *std::get<int *>(value) : *std::get<double *>(value);
  return number >= low.value && number <= high.value;
}

bool OptionEntry::assign(const std::string &value_text)
{
  if (!isNumber()) {
    if (value_text != "true" && value_text != "false")
      return false;
    *std::get<bool *>(value) = value_text == "true";
    return true;
  }
  if (auto *const *whole = std::get_if<int *>(&value))
    return parse(value_text, **whole);
  return parse(value_text, *std::get<double *>(value));
}

std::vector<OptionEntry> optionTable(Options &o)
{
  return {
      {"camera.height", &o.camera.height, 0, 100, "m",
       "mean height over the ground, 0 unknown: the scale of a video without odometry"},
      {"camera.focal_sigma", &o.camera.focal_sigma, 0, 1, "",
       "standard deviation of the log focal length; 0: calibrated"},
      {"camera.rate", &o.camera.rate, 0, 100, "1/s", "frames a second, for the choice of pairs of frames; 0: measured"},
      {"camera.compressed", &o.camera.compressed, 0, 1, "",
       "the pictures went through a lossy codec: points are believed less"},

      {"stages.points", &o.stages.points, 0, 1, "", "relative poses from point features"},
      {"stages.saliency", &o.stages.saliency, 0, 1, "", "motion saliency; off: what is far may be taken for a trunk"},
      {"stages.calibration", &o.stages.calibration, 0, 1, "",
       "constant errors of gyro, odometry and clocks are found in the first seconds of a recording and taken out "
       "(`bole track`)"},
      {"stages.final_pass", &o.stages.final_pass, 0, 1, "",
       "every hypothesis is judged by all frames at the end; off: the map as known in flight"},
      {"stages.servoing", &o.stages.servoing, 0, 1, "",
       "the trunks steer the camera: it may rest before one or circle it"},

      {"trunks.radius", &o.trunks.radius, 0.001, 10, "m", "median radius of the trunks"},
      {"trunks.radius_sigma", &o.trunks.radius_sigma, 0.01, 3, "", "standard deviation of its logarithm"},
      {"trunks.radius_min", &o.trunks.radius_min, 0.005, OptionBound(o.trunks.radius_max, "trunks.radius_max"), "m",
       "thinner trunks are not looked for"},
      {"trunks.radius_max", &o.trunks.radius_max, OptionBound(o.trunks.radius_min, "trunks.radius_min"), 5, "m",
       "thicker trunks are not looked for"},
      {"trunks.lean", &o.trunks.lean, 1e-5, 0.5, "rad", "standard deviation of the lean; 0.0001: upright"},
      {"trunks.low", &o.trunks.low, 0, OptionBound(o.trunks.high, "trunks.high"), "m",
       "lower end of the part that is tracked, over the ground"},
      {"trunks.high", &o.trunks.high, OptionBound(o.trunks.low, "trunks.low"), 20, "m", "upper end of it"},

      {"range.track", &o.range.track, 1, 100, "m", "known trunks beyond it are not tracked"},
      {"range.detect_min", &o.range.detect_min, 0.3, OptionBound(o.range.detect_max, "range.detect_max"), "m",
       "nearest new trunk"},
      {"range.detect_max", &o.range.detect_max, OptionBound(o.range.detect_min, "range.detect_min"), 50, "m",
       "farthest new trunk; farther costs precision"},
      {"range.through", &o.range.through, 0, 100, "m", "nearer points seen through a trunk count against it; 0: never"},

      {"detection.window", &o.detection.window, 4, 100, "frames", "looked at together for new trunks"},
      {"detection.elevation_low", &o.detection.elevation_low, -5,
       OptionBound(o.detection.elevation_high, "detection.elevation_high"), "tan",
       "lower end of the part that is looked for"},
      {"detection.elevation_high", &o.detection.elevation_high,
       OptionBound(o.detection.elevation_low, "detection.elevation_low"), 5, "tan", "upper end of it"},

      {"map.confirm_probability", &o.map.confirm_probability, 1e-6, 1 - 1e-6, "",
       "probability of a trunk at which a candidate is confirmed; higher: fewer trunks, fewer false ones"},
      {"map.confirm_sigma", &o.map.confirm_sigma, 0, 10, "m",
       "trunks whose place, from where they were seen, has a larger standard deviation are left out; 0: none"},
      {"map.merge_distance", &o.map.merge_distance, 0, 5, "m", "trunks with less between their bark are one"},
      {"map.candidate_memory", &o.map.candidate_memory, 0.1, 1e6, "s", "a candidate not seen for longer is dropped"},
      {"map.lag", &o.map.lag, 0, 1e5, "s", "older poses are fixed and forgotten; 0: never"},

      {"odometry.step", &o.odometry.step, 1e-4, 1, "m", "horizontal walk of the pose filter in 0.1 s"},
      {"odometry.step_vertical", &o.odometry.step_vertical, 1e-4, 1, "m",
       "noise of the difference of two of its heights"},
      {"odometry.scale", &o.odometry.scale, 0, 1, "", "its error in proportion to the way"},
      {"odometry.height", &o.odometry.height, 1e-3, 10, "m", "noise of its height about the truth"},
      {"odometry.tilt", &o.odometry.tilt, 1e-4, 1, "rad", "noise of its roll and pitch about the truth"},
      {"odometry.turn", &o.odometry.turn, 1e-5, 1, "rad",
       "noise of its rotation between two frames, where there is no gyro"},

      {"gyro.noise", &o.gyro.noise, 1e-7, 1, "rad/s/sqrt(Hz)", "white noise of the rate"},
      {"gyro.bias", &o.gyro.bias, 0, 1, "rad/s", "standard deviation of the bias at the start"},
  };
}
} // namespace bole
