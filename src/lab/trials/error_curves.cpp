// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/error_curves.h"
#include "input/csv_reader.h"
#include "output/palette.h"
#include "output/svg.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <tuple>

namespace bole
{
namespace
{
constexpr double kLeft = 62, kWidth = 560, kHeight = 130, kGap = 36, kTop = 62;

constexpr const char *kSearching = "#ececec", *kLost = "#f6cfae";

using Points = SvgPoints;

std::vector<std::string> namesIn(const LoopRecord &record)
{
  std::vector<std::string> names;
  const auto take = [&names](const ServoTask::Values &values) {
    for (const auto &value : values)
      if (std::find(names.begin(), names.end(), value.first) == names.end())
        names.push_back(value.first);
  };
  for (const LoopSample &sample : record.samples) {
    take(sample.believed);
    take(sample.real);
  }
  return names;
}

Points pointsOf(const LoopRecord &record, const std::string &name, ServoTask::Values LoopSample::*which)
{
  Points points;
  for (const LoopSample &sample : record.samples)
    for (const auto &[key, value] : sample.*which)
      if (key == name && std::isfinite(value))
        points.emplace_back(sample.time_s, value);
  return points;
}

/// Range that holds all but the wildest of the values.
void fit(SvgAxes &axes, const Points &one, const Points &other)
{
  std::vector<double> values{0};
  for (const Points *points : {&one, &other})
    for (const auto &[t, v] : *points)
      values.push_back(v);
  std::sort(values.begin(), values.end());
  const std::size_t skip = values.size() / 100;
  const double low = values[skip], high = values[values.size() - 1 - skip];
  const double pad = 0.08 * std::max(high - low, 1e-3);
  axes.y_low = low - pad;
  axes.y_high = high + pad;
}

/// Bands behind the curves: searching, hovering in doubt.
void drawBands(SvgDrawing &drawing, const SvgAxes &axes, const LoopRecord &record)
{
  const auto &samples = record.samples;
  for (std::size_t k = 0; k + 1 < samples.size(); ++k)
    if (samples[k].is_lost || samples[k].phase == TaskPhase::searching)
      drawing.box(axes.x(samples[k].time_s), axes.top, axes.x(samples[k + 1].time_s) - axes.x(samples[k].time_s) + 0.3,
                  axes.height, samples[k].is_lost ? kLost : kSearching);
}
} // namespace

std::string errorCurves(const LoopRecord &record, const std::string &title)
{
  const std::vector<std::string> names = namesIn(record);
  SvgDrawing drawing(650, kTop + static_cast<double>(names.size()) * (kHeight + kGap) + 10);
  drawing.text(kLeft, 18, title, "font-size=\"14\"");
  double x = kLeft;
  for (const auto &[colour, height, name] :
       {std::tuple(palette::kVermilion, 3, "true"), std::tuple(palette::kBlue, 1, "believed"),
        std::tuple(kSearching, 10, "searching"), std::tuple(kLost, 10, "hovering in doubt")}) {
    drawing.box(x, 32 - 0.5 * height, 18, height, colour);
    drawing.text(x + 22, 36, name);
    x += 100;
  }
  SvgAxes axes;
  axes.left = kLeft;
  axes.top = kTop;
  axes.width = kWidth;
  axes.height = kHeight;
  axes.x_high = record.samples.empty() ? 1 : std::max(1.0, record.samples.back().time_s);
  for (const std::string &name : names) {
    const Points believed = pointsOf(record, name, &LoopSample::believed),
                 real = pointsOf(record, name, &LoopSample::real);
    fit(axes, believed, real);
    drawBands(drawing, axes, record);
    axes.draw(drawing, "", name, " s");
    drawing.polyline(axes(believed), palette::kBlue, "stroke-width=\"0.8\"");
    drawing.polyline(axes(real), palette::kVermilion, "stroke-width=\"1.8\"");
    axes.top += kHeight + kGap;
  }
  return drawing.finish();
}

std::string samplesCsv(const LoopRecord &record)
{
  const std::vector<std::string> names = namesIn(record);
  std::string text =
      "time [s],phase,lost,hovering,frame,true x [m],true y [m],true z [m],x [m],y [m],z [m],vx [m/s],vy [m/s],"
      "wz [rad/s],speed [m/s],least clearance [m],loop [ms]";
  for (const std::string &name : names)
    text += ",believed " + name + ",true " + name;
  text += ",what it does\n";
  const auto value = [](const ServoTask::Values &values, const std::string &name) {
    for (const auto &[key, number] : values)
      if (key == name)
        return fmt::format("{:.4f}", number);
    return std::string();
  };
  for (const LoopSample &s : record.samples) {
    text += fmt::format(
        "{:.2f},{},{:d},{:d},{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.2f}",
        s.time_s, toString(s.phase), s.is_lost, s.is_hovering, toString(s.frame_status), s.truth.t.x(), s.truth.t.y(),
        s.truth.t.z(), s.estimate.t.x(), s.estimate.t.y(), s.estimate.t.z(), s.command(0), s.command(1), s.command(3),
        s.speed, s.clearance, s.loop_ms);
    for (const std::string &name : names)
      text += "," + value(s.believed, name) + "," + value(s.real, name);
    text += "," + csvField(s.reason) + "\n";
  }
  return text;
}
} // namespace bole
