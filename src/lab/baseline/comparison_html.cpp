// SPDX-License-Identifier: GPL-2.0-or-later
// The comparison as one HTML page: tables, and plots as inline SVG.
#include "lab/baseline/comparison_report.h"
#include "output/figure.h"
#include "output/palette.h"
#include "output/svg.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

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
  html += "<h2>Basin</h2><table><tr><th>tracker, help: share of right answers (silent failures) after a yaw step of";
  for (const double step : rows[0].steps_px)
    html += fmt::format("<th>{:g} px", step);
  html += "<th>pairs<th>settings</tr>\n";
  for (const BasinRow &row : rows) {
    html += fmt::format("<tr><td>{}, {}", escaped(row.name), row.has_clutter ? "forest" : "plain");
    for (std::size_t s = 0; s < row.success.size(); ++s)
      html += fmt::format("<td>{} ({})", row.pairs > 0 ? percent(row.success[s], 0) : "-",
                          row.pairs > 0 ? percent(row.silent[s], 0) : "-");
    html += fmt::format("<td>{}<td>{}</tr>\n", row.pairs, escaped(row.settings));
  }
  html += "</table>\n" + basinPlot(rows);
}

void addScores(std::string &html, const std::vector<Score> &scores)
{
  html += "<table><tr><th>tracker, help<th>frames until loss<th>frames right<th>position RMSE until loss "
          "[m]<th>rotation [deg]"
          "<th>position RMSE, all frames [m]<th>rotation [deg]<th>silent failures<th>started again<th>ms median<th>ms "
          "p95<th>settings</tr>\n";
  for (const Score &s : scores)
    html += fmt::format("<tr><td>{}<td>{} of "
                        "{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}<td>{}</tr>\n",
                        escaped(s.name), s.until_loss, s.frames, s.tracked, figure(s.position_rmse_m, 0, 3),
                        figure(s.rotation_rmse_deg, 0, 2), figure(s.all_position_rmse_m, 0, 3),
                        figure(s.all_rotation_rmse_deg, 0, 2), s.silent_failures, s.reinitialisations,
                        figure(s.median_ms, 0, 2), figure(s.p95_ms, 0, 2), escaped(s.settings));
  html += "</table>\n";
}

void addFaults(std::string &html, const std::vector<FaultRow> &rows)
{
  html += "<h2>Faults</h2><table><tr><th>tracker, help<th>fault<th>noticed<th>silent failures<th>recovered<th>slowest "
          "[frames]</tr>\n";
  for (const FaultRow &row : rows)
    html += fmt::format("<tr><td>{}<td>{}<td>{} of {}<td>{}<td>{} of {}<td>{}</tr>\n", escaped(row.name),
                        row.fault.text(), row.noticed, row.fault_frames, row.silent_failures, row.recovered, row.runs,
                        row.recovered > 0 ? std::to_string(row.slowest) : "-");
  html += "</table>\n";
}

void addSweeps(std::string &html, const std::vector<SweepResult> &sweeps)
{
  html += "<h2>Settings tried</h2>\n";
  for (const SweepResult &sweep : sweeps) {
    html += fmt::format(
        "<details><summary>{}, {}: best of {} is {}</summary><table><tr><th>settings<th>frames right<th>position RMSE, "
        "all frames [m]</tr>\n",
        toString(sweep.kind), toString(sweep.help), sweep.tried.size(), sweep.best.text());
    for (const auto &[settings, score] : sweep.tried)
      html +=
          fmt::format("<tr><td>{}<td>{}<td>{:.3f}</tr>\n", settings.text(), score.tracked, score.all_position_rmse_m);
    html += "</table></details>\n";
  }
}
} // namespace

std::string toSvg(const ComparisonReport &report) { return errorPlot(report); }

std::string toHtml(const ComparisonReport &report)
{
  std::string html =
      "<!DOCTYPE html><html lang=\"en\"><meta charset=\"utf-8\"><style>body{font-family:sans-serif;margin:2em}"
      "td,th{padding:2px 8px;text-align:right}td:first-child,th:first-child{text-align:left}"
      "tr:nth-child(even){background:#f4f4f4}</style>\n";
  html += fmt::format(
      "<title>{0}</title><h1>{0}</h1><p>{1} frames, {2} trunks in the model; wrong is more than {3:g} m or {4:g} "
      "degrees. <code>{5}</code></p>\n",
      escaped(report.sequence), report.frames, report.trunks, report.limits.position_m, report.limits.rotation_deg,
      escaped(report.command));
  addScores(html, report.scores);
  html += errorPlot(report);
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
  return html + "</html>\n";
}
} // namespace bole
