// SPDX-License-Identifier: GPL-2.0-or-later
// The comparison as one HTML page: tables, and plots as inline SVG.
#include "lab/baseline/comparison_report.h"
#include "output/figure.h"
#include "output/page.h"
#include "output/palette.h"
#include "output/svg.h"

#include <algorithm>
#include <array>
#include <fmt/format.h>

namespace bole
{
namespace
{
/// A plot with its legend on the right: twelve lines that a colour-blind reader tells apart, by colour and dashes.
class Plot
{
public:
  explicit Plot(const SvgAxes &axes) : m_axes(axes), m_drawing(1000, 370) {}

  void line(const SvgPoints &points, const std::string &name, std::size_t index)
  {
    constexpr std::array<const char *, 3> kDashes = {"", "stroke-dasharray=\"6 3\"", "stroke-dasharray=\"2 2\""};
    const char *colour = palette::kLines[index % palette::kLines.size()];
    const std::string style =
        fmt::format("stroke-width=\"1.6\" {}", kDashes[index / palette::kLines.size() % kDashes.size()]);
    m_drawing.polyline(m_axes(points), colour, style);
    const double y = 40 + 18 * m_lines++;
    m_drawing.line(670, y - 4, 694, y - 4, colour, style);
    m_drawing.text(700, y, name);
  }
  std::string finish(const std::string &x_name, const std::string &y_name)
  {
    m_axes.draw(m_drawing, x_name, y_name);
    return m_drawing.finish();
  }

private:
  SvgAxes m_axes;
  SvgDrawing m_drawing;
  int m_lines = 0;
};

std::string errorPlot(const ComparisonReport &report)
{
  SvgAxes axes;
  axes.x_high = std::max(1, report.frames - 1);
  axes.y_low = 0.005;
  axes.y_high = 10;
  axes.is_log = true;
  Plot plot(axes);
  for (std::size_t i = 0; i < report.scores.size(); ++i) {
    SvgPoints points;
    for (std::size_t k = 0; k < report.scores[i].errors.size(); ++k)
      points.emplace_back(double(k + 1), report.scores[i].errors[k].position_m);
    plot.line(points, report.scores[i].name, i);
  }
  return plot.finish("frame", "position error [m], all frames, whatever the tracker said");
}

std::string basinPlot(const std::vector<BasinRow> &rows)
{
  SvgAxes axes;
  axes.x_high = rows[0].steps_px.back();
  axes.y_high = 100;
  Plot plot(axes);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    SvgPoints points;
    for (std::size_t s = 0; s < rows[i].steps_px.size(); ++s)
      points.emplace_back(rows[i].steps_px[s], 100 * rows[i].success[s]);
    plot.line(points, rows[i].name + (rows[i].has_clutter ? ", forest" : ", plain"), i);
  }
  return plot.finish("yaw between two frames [px]", "right answers [%]");
}

void addBasin(std::string &html, const std::vector<BasinRow> &rows)
{
  std::vector<std::string> head = {"tracker, help: share of right answers (silent failures) after a yaw step of"};
  for (const double step : rows[0].steps_px)
    head.push_back(fmt::format("{:g} px", step));
  head.insert(head.end(), {"pairs", "settings"});
  std::vector<std::vector<std::string>> cells;
  for (const BasinRow &row : rows) {
    cells.push_back({fmt::format("{}, {}", escaped(row.name), row.has_clutter ? "forest" : "plain")});
    for (std::size_t s = 0; s < row.success.size(); ++s)
      cells.back().push_back(fmt::format("{} ({})", row.pairs > 0 ? percent(row.success[s], 0) : "-",
                                         row.pairs > 0 ? percent(row.silent[s], 0) : "-"));
    cells.back().insert(cells.back().end(), {std::to_string(row.pairs), escaped(row.settings)});
  }
  html += "<h2>Basin</h2>\n" + htmlTable(head, cells) + chartBox(basinPlot(rows));
}

void addScores(std::string &html, const std::vector<Score> &scores)
{
  std::vector<std::vector<std::string>> cells;
  for (const Score &s : scores)
    cells.push_back({escaped(s.name), fmt::format("{} of {}", s.until_loss, s.frames), std::to_string(s.tracked),
                     figure(s.position_rmse_m, 0, 3), figure(s.rotation_rmse_deg, 0, 2),
                     figure(s.all_position_rmse_m, 0, 3), figure(s.all_rotation_rmse_deg, 0, 2),
                     std::to_string(s.silent_failures), std::to_string(s.reinitialisations), figure(s.median_ms, 0, 2),
                     figure(s.p95_ms, 0, 2), escaped(s.settings)});
  html += htmlTable({"tracker, help", "frames until loss", "frames right", "position RMSE until loss [m]",
                     "rotation [deg]", "position RMSE, all frames [m]", "rotation [deg]", "silent failures",
                     "started again", "ms median", "ms p95", "settings"},
                    cells);
}

void addFaults(std::string &html, const std::vector<FaultRow> &rows)
{
  std::vector<std::vector<std::string>> cells;
  for (const FaultRow &row : rows)
    cells.push_back({escaped(row.name), row.fault.text(), fmt::format("{} of {}", row.noticed, row.fault_frames),
                     std::to_string(row.silent_failures), fmt::format("{} of {}", row.recovered, row.runs),
                     row.recovered > 0 ? std::to_string(row.slowest) : "-"});
  html += "<h2>Faults</h2>\n" +
          htmlTable({"tracker, help", "fault", "noticed", "silent failures", "recovered", "slowest [frames]"}, cells);
}

void addSweeps(std::string &html, const std::vector<SweepResult> &sweeps)
{
  html += "<h2>Settings tried</h2>\n";
  for (const SweepResult &sweep : sweeps) {
    std::vector<std::vector<std::string>> cells;
    for (const auto &[settings, score] : sweep.tried)
      cells.push_back({settings.text(), std::to_string(score.tracked), figure(score.all_position_rmse_m, 0, 3)});
    html += fmt::format("<details><summary>{}, {}: best of {} is {}</summary>\n{}</details>\n", toString(sweep.kind),
                        toString(sweep.help), sweep.tried.size(), sweep.best.text(),
                        htmlTable({"settings", "frames right", "position RMSE, all frames [m]"}, cells));
  }
}
} // namespace

std::string toSvg(const ComparisonReport &report) { return errorPlot(report); }

std::string toHtml(const ComparisonReport &report)
{
  std::string html = fmt::format("<p>{} frames, {} trunks in the model; wrong is more than {:g} m or {:g} degrees. "
                                 "<code>{}</code></p>\n",
                                 report.frames, report.trunks, report.limits.position_m, report.limits.rotation_deg,
                                 escaped(report.command));
  addScores(html, report.scores);
  html += chartBox(errorPlot(report));
  if (!report.timing.empty()) {
    html += "<h2>Cost on the same trunks, at the true pose</h2>\n";
    addScores(html, report.timing);
  }
  if (!report.basin.empty())
    addBasin(html, report.basin);
  if (!report.faults.empty())
    addFaults(html, report.faults);
  if (!report.sweeps.empty())
    addSweeps(html, report.sweeps);
  return htmlPage(report.sequence, html);
}
} // namespace bole
