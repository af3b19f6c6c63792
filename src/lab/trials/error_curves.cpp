// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/error_curves.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
namespace
{
constexpr double kLeft = 62, kWidth = 560, kHeight = 130, kGap = 34, kTop = 40;

using Points = std::vector<std::pair<double, double>>;

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

/// 1, 2 or 5 times a power of ten, about a fifth of \p span.
double tickStep(double span)
{
  const double raw = std::max(span, 1e-9) / 5, base = std::pow(10, std::floor(std::log10(raw)));
  return base * (raw / base < 1.5 ? 1 : raw / base < 3.5 ? 2 : raw / base < 7.5 ? 5 : 10);
}

struct Panel
{
  double t_max, low, high, y0;
  double x(double t) const { return kLeft + kWidth * t / t_max; }
  double y(double v) const { return y0 + kHeight * (1 - (std::clamp(v, low, high) - low) / (high - low)); }
};

/// Range that holds all but the wildest of the values.
void fit(Panel &panel, const Points &one, const Points &other)
{
  std::vector<double> values{0};
  for (const Points *points : {&one, &other})
    for (const auto &[t, v] : *points)
      values.push_back(v);
  std::sort(values.begin(), values.end());
  const std::size_t skip = values.size() / 100;
  panel.low = values[skip];
  panel.high = values[values.size() - 1 - skip];
  const double pad = 0.08 * std::max(panel.high - panel.low, 1e-3);
  panel.low -= pad;
  panel.high += pad;
}

std::string line(const Panel &panel, const Points &points, const char *style)
{
  std::string text = fmt::format("<polyline fill=\"none\" {} points=\"", style);
  for (const auto &[t, v] : points)
    text += fmt::format("{:.1f},{:.1f} ", panel.x(t), panel.y(v));
  return text + "\"/>\n";
}

/// Bands behind the curves: searching, hovering in doubt.
std::string bands(const Panel &panel, const LoopRecord &record)
{
  std::string text;
  const auto &samples = record.samples;
  for (std::size_t k = 0; k + 1 < samples.size(); ++k) {
    const bool is_search = samples[k].phase == TaskPhase::searching;
    if (!is_search && !samples[k].is_lost)
      continue;
    text += fmt::format("<rect x=\"{:.1f}\" y=\"{:.0f}\" width=\"{:.2f}\" height=\"{:.0f}\" fill=\"{}\"/>\n",
                        panel.x(samples[k].time_s), panel.y0,
                        kWidth * (samples[k + 1].time_s - samples[k].time_s) / panel.t_max + 0.3, kHeight,
                        samples[k].is_lost ? "#f3b6b0" : "#ececec");
  }
  return text;
}

std::string axes(const Panel &panel, const std::string &name)
{
  std::string text;
  const double step = tickStep(panel.high - panel.low);
  for (double v = std::ceil(panel.low / step) * step; v <= panel.high; v += step)
    text += fmt::format("<line x1=\"{0}\" x2=\"{1}\" y1=\"{2:.1f}\" y2=\"{2:.1f}\" stroke=\"{3}\"/>"
                        "<text x=\"{4}\" y=\"{5:.1f}\" text-anchor=\"end\">{6:g}</text>\n",
                        kLeft, kLeft + kWidth, panel.y(v), std::abs(v) < 1e-9 ? "#888" : "#ddd", kLeft - 6,
                        panel.y(v) + 4, std::abs(v) < 1e-9 ? 0 : v);
  const double step_s = tickStep(panel.t_max);
  for (double t = 0; t <= panel.t_max; t += step_s)
    text += fmt::format("<text x=\"{:.1f}\" y=\"{:.0f}\" text-anchor=\"middle\" fill=\"#555\">{:g} s</text>\n",
                        panel.x(t), panel.y0 + kHeight + 15, t);
  return text + fmt::format("<text x=\"{}\" y=\"{:.0f}\" font-weight=\"bold\">{}</text>\n", kLeft, panel.y0 - 5, name);
}
} // namespace

std::string errorCurves(const LoopRecord &record, const std::string &title)
{
  const std::vector<std::string> names = namesIn(record);
  const double height = kTop + static_cast<double>(names.size()) * (kHeight + kGap) + 10;
  std::string svg = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"650\" height=\"{:.0f}\" "
                                "font-family=\"sans-serif\" font-size=\"11\"><rect width=\"100%\" height=\"100%\" "
                                "fill=\"white\"/>\n<text x=\"{}\" y=\"18\" font-size=\"14\">{}</text>\n",
                                height, kLeft, title);
  Panel panel{record.samples.empty() ? 1 : std::max(1.0, record.samples.back().time_s), 0, 1, kTop};
  for (const std::string &name : names) {
    const Points believed = pointsOf(record, name, &LoopSample::believed),
                 real = pointsOf(record, name, &LoopSample::real);
    fit(panel, believed, real);
    svg += bands(panel, record) + axes(panel, name);
    svg += line(panel, believed, "stroke=\"#4a7ab5\" stroke-width=\"0.8\"");
    svg += line(panel, real, "stroke=\"#b5462a\" stroke-width=\"1.8\"");
    panel.y0 += kHeight + kGap;
  }
  return svg + "</svg>\n";
}

std::string samplesCsv(const LoopRecord &record)
{
  const std::vector<std::string> names = namesIn(record);
  std::string text =
      "time [s],phase,lost,hovering,frame,true x [m],true y [m],true z [m],x [m],y [m],z [m],vx [m/s],vy [m/s],"
      "wz [rad/s],speed [m/s],least clearance [m],loop [ms]";
  for (const std::string &name : names)
    text += ",believed " + name + ",true " + name;
  text += "\n";
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
    text += "\n";
  }
  return text;
}
} // namespace bole
