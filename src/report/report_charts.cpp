// SPDX-License-Identifier: GPL-2.0-or-later
#include "report/report_drawings.h"

#include "output/palette.h"
#include "output/svg.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr std::size_t kMostPoints = 400; // of a curve
constexpr double kPanel = 120, kPanelGap = 44, kPanelTop = 26;

double secondsSince(const RunRecord &run, std::int64_t stamp_ns)
{
  return run.trace.frames.empty() ? 0 : 1e-9 * static_cast<double>(stamp_ns - run.trace.frames.front().stamp_ns);
}

double duration(const RunRecord &run)
{
  return run.trace.frames.empty() ? 1 : std::max(1e-3, secondsSince(run, run.trace.frames.back().stamp_ns));
}

/// A curve with a band of one sigma.
struct Curve
{
  std::string name;
  const char *colour;
  SvgPoints points;
  std::vector<double> sigmas; ///< as many as points, or none
};

/// Panels with a time axis, one below the other.
class Panels
{
public:
  Panels(double width, int count, double seconds) : m_drawing(width, kPanelTop + count * (kPanel + kPanelGap))
  {
    m_axes.left = 52;
    m_axes.width = width - m_axes.left - 12;
    m_axes.top = kPanelTop;
    m_axes.height = kPanel;
    m_axes.x_high = seconds;
  }

  /// \p levels: horizontal lines that the curves are to be compared with.
  void add(const std::string &name, const std::vector<Curve> &curves, const std::vector<Curve> &levels = {})
  {
    fit(curves, levels);
    m_axes.draw(m_drawing, "", name, " s");
    double x = m_axes.left + m_axes.width;
    for (const Curve &level : levels)
      m_drawing.line(m_axes.left, m_axes.y(level.points[0].second), x, m_axes.y(level.points[0].second), level.colour,
                     "stroke-dasharray=\"5 3\"");
    for (const Curve &curve : curves) {
      band(curve);
      m_drawing.polyline(m_axes(curve.points), curve.colour, "stroke-width=\"1.5\"");
    }
    std::vector<Curve> named = curves;
    named.insert(named.end(), levels.begin(), levels.end());
    for (auto curve = named.rbegin(); curve != named.rend(); ++curve) {
      m_drawing.text(x, m_axes.top - 6, curve->name,
                     fmt::format("text-anchor=\"end\" style=\"fill:{}\"", curve->colour));
      x -= 7.0 * static_cast<double>(curve->name.size()) + 8;
    }
    m_axes.top += kPanel + kPanelGap;
  }
  std::string finish() const { return m_drawing.finish(); }

private:
  void fit(const std::vector<Curve> &curves, const std::vector<Curve> &levels)
  {
    std::vector<double> lows, highs;
    for (const std::vector<Curve> *group : {&curves, &levels})
      for (const Curve &curve : *group)
        for (std::size_t i = 0; i < curve.points.size(); ++i) {
          const double sigma = curve.sigmas.empty() ? 0 : curve.sigmas[i];
          lows.push_back(curve.points[i].second - sigma);
          highs.push_back(curve.points[i].second + sigma);
        }
    if (lows.empty())
      lows = highs = {0};
    std::sort(lows.begin(), lows.end());
    std::sort(highs.begin(), highs.end());
    const std::size_t skip = lows.size() / 50; // the wildest of a beginning would flatten all the rest
    const double pad = 0.08 * std::max(highs[highs.size() - 1 - skip] - lows[skip], 1e-3);
    m_axes.y_low = lows[skip] - pad;
    m_axes.y_high = highs[highs.size() - 1 - skip] + pad;
  }
  void band(const Curve &curve)
  {
    if (curve.sigmas.empty())
      return;
    SvgPoints outline;
    for (std::size_t i = 0; i < curve.points.size(); ++i)
      outline.emplace_back(curve.points[i].first, curve.points[i].second + curve.sigmas[i]);
    for (std::size_t i = curve.points.size(); i-- > 0;)
      outline.emplace_back(curve.points[i].first, curve.points[i].second - curve.sigmas[i]);
    m_drawing.polygon(m_axes(outline), curve.colour, "fill-opacity=\".2\"");
  }

  SvgDrawing m_drawing;
  SvgAxes m_axes;
};

Curve level(const std::string &name, double value, const char *colour) { return {name, colour, {{0, value}}, {}}; }

const char *colourOf(FrameStatus status)
{
  switch (status) {
  case FrameStatus::ok:
    return palette::kSkyBlue;
  case FrameStatus::stale:
    return palette::kYellow;
  case FrameStatus::corrupt:
    return palette::kVermilion;
  case FrameStatus::missing:
    return palette::kBlack;
  case FrameStatus::resized:
    return palette::kPurple;
  case FrameStatus::doubtful:
    return palette::kOrange;
  }
  return palette::kGrey;
}
} // namespace

std::string trunkCharts(const RunRecord &run, const TrunkRecord &trunk, const TruthTrunk *truth)
{
  Curve range{"", palette::kBlue, {}, {}}, radius{"", palette::kBlue, {}, {}}, x{"x", palette::kBlue, {}, {}},
      y{"y", palette::kVermilion, {}, {}};
  std::vector<const TrunkTrace *> views;
  for (const TrunkTrace &view : run.trace.views)
    if (view.id == trunk.id)
      views.push_back(&view);
  const auto add = [](Curve &curve, double t, double value, double sigma) {
    curve.points.emplace_back(t, value);
    curve.sigmas.push_back(sigma);
  };
  for (std::size_t i = 0; i < views.size(); i += views.size() / kMostPoints + 1) {
    const TrunkTrace &view = *views[i];
    const double t = secondsSince(run, view.stamp_ns);
    add(range, t, view.range, view.range_sigma);
    add(radius, t, 100 * view.radius, 100 * view.radius_sigma);
    add(x, t, 100 * (view.xy.x() - trunk.xy.x()), 100 * view.xy_sigma.x());
    add(y, t, 100 * (view.xy.y() - trunk.xy.y()), 100 * view.xy_sigma.y());
  }
  Panels panels(344, 3, duration(run));
  panels.add("range [m], one sigma", {range});
  std::vector<Curve> radii = {level("final", 100 * trunk.radius, palette::kBlack)};
  if (truth != nullptr && truth->radius > 0)
    radii.push_back(level("truth", 100 * truth->radius, palette::kGreen));
  panels.add("radius [cm], one sigma", {radius}, radii);
  panels.add("place - final place [cm], one sigma", {x, y});
  return panels.finish();
}

std::string timeLine(const RunRecord &run)
{
  constexpr double kRow = 18, kLabels = 90;
  std::vector<const TrunkRecord *> trunks;
  for (const TrunkRecord &trunk : run.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      trunks.push_back(&trunk);
  SvgAxes axes;
  axes.left = kLabels;
  axes.top = 24;
  axes.width = 1000 - kLabels - 30;
  axes.x_high = duration(run);
  axes.y_low = 0, axes.y_high = 1;
  axes.height = kRow * static_cast<double>(1 + run.sensors.size() + trunks.size());
  SvgDrawing drawing(1000, axes.top + axes.height + 40);
  for (const double t : ticksBetween(0, axes.x_high)) {
    drawing.line(axes.x(t), axes.top, axes.x(t), axes.top + axes.height, "#dddddd");
    drawing.text(axes.x(t), axes.top + axes.height + 15, fmt::format("{:.6g} s", t), "text-anchor=\"middle\"");
  }
  double row = axes.top;
  const auto label = [&](const std::string &text) { drawing.text(kLabels - 6, row + 13, text, "text-anchor=\"end\""); };
  const auto &frames = run.trace.frames;
  // runs of frames that are alike become one box
  const auto boxes = [&](const auto &kindOf, const auto &colourOfKind) {
    for (std::size_t i = 0, end = 0; i < frames.size(); i = end) {
      for (end = i + 1; end < frames.size() && kindOf(end) == kindOf(i);)
        ++end;
      const char *colour = colourOfKind(kindOf(i));
      const double from = secondsSince(run, frames[i].stamp_ns);
      const double to = end < frames.size() ? secondsSince(run, frames[end].stamp_ns) : axes.x_high;
      if (colour != nullptr)
        drawing.box(axes.x(from), row + 3, std::max(1.0, axes.x(to) - axes.x(from)), kRow - 5, colour);
    }
    row += kRow;
  };
  label("frames");
  boxes([&](std::size_t i) { return frames[i].status; }, [](FrameStatus status) { return colourOf(status); });
  double x = kLabels;
  for (int i = 0; i <= static_cast<int>(FrameStatus::doubtful); ++i) {
    const auto status = static_cast<FrameStatus>(i);
    if (std::none_of(frames.begin(), frames.end(), [&](const FrameTrace &frame) { return frame.status == status; }))
      continue;
    drawing.box(x, 6, 12, 10, colourOf(status));
    drawing.text(x + 16, 15, toString(status));
    x += 90;
  }
  for (const SensorVerdict &sensor : run.sensors) {
    label(sensor.sensor);
    const double since = std::max(0.0, secondsSince(run, std::llround(1e9 * sensor.since_s)));
    drawing.box(axes.x(std::min(since, axes.x_high)), row + 3,
                axes.x(axes.x_high) - axes.x(std::min(since, axes.x_high)), kRow - 5, palette::kVermilion);
    row += kRow;
  }
  for (const TrunkRecord *trunk : trunks) {
    label(fmt::format("trunk {}", trunk->id));
    std::vector<std::size_t> measured;
    for (const TrunkTrace &view : run.trace.views)
      if (view.id == trunk->id)
        measured.push_back(view.frame);
    boxes([&](std::size_t i) { return std::binary_search(measured.begin(), measured.end(), frames[i].index); },
          [](bool is_measured) { return is_measured ? palette::kBlue : nullptr; });
  }
  return drawing.finish();
}

std::string trajectoryCharts(const RunRecord &run)
{
  Curve sx{"x", palette::kBlue, {}, {}}, sy{"y", palette::kVermilion, {}, {}}, height{"", palette::kBlue, {}, {}};
  const auto &frames = run.trace.frames;
  for (std::size_t i = 0; i < frames.size(); i += frames.size() / kMostPoints + 1) {
    const double t = secondsSince(run, frames[i].stamp_ns);
    sx.points.emplace_back(t, 100 * std::sqrt(std::max(0.0, frames[i].covariance_xy(0, 0))));
    sy.points.emplace_back(t, 100 * std::sqrt(std::max(0.0, frames[i].covariance_xy(1, 1))));
    height.points.emplace_back(t, frames[i].place.z());
  }
  Curve error{"", palette::kBlue, {}, {}};
  for (std::size_t i = 0, k = 0; i < run.truth.size(); i += run.truth.size() / kMostPoints + 1) {
    while (k < run.smoothed.size() && run.smoothed[k].stamp_ns < run.truth[i].stamp_ns)
      ++k;
    if (k < run.smoothed.size())
      error.points.emplace_back(secondsSince(run, run.truth[i].stamp_ns),
                                100 * (run.smoothed[k].wMb.t - run.truth[i].wMb.t).head<2>().norm());
  }
  Panels panels(640, run.truth.empty() ? 2 : 3, duration(run));
  panels.add("sigma of the online place [cm]", {sx, sy});
  panels.add("height of the online place [m]", {height});
  if (!run.truth.empty())
    panels.add("horizontal error of the smoothed place, aligned [cm]", {error});
  return panels.finish();
}

std::string timingChart(const RunRecord &run)
{
  Curve total{"", palette::kBlue, {}, {}};
  const auto &frames = run.timing.frames;
  for (std::size_t i = 0; i < frames.size(); i += frames.size() / kMostPoints + 1)
    total.points.emplace_back(i < run.trace.frames.size() ? secondsSince(run, run.trace.frames[i].stamp_ns) : double(i),
                              frames[i].total_ms);
  Panels panels(640, 1, duration(run));
  panels.add("time of a frame [ms]", {total});
  return panels.finish();
}
} // namespace bole
