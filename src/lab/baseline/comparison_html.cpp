// SPDX-License-Identifier: GPL-2.0-or-later
// The comparison as one HTML page: tables, and plots as inline SVG.
#include "lab/baseline/comparison_report.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
namespace
{
const std::array<const char *, 12> kColours = {"#1f77b4", "#aec7e8", "#17becf", "#d62728", "#ff9896", "#e377c2",
                                               "#ff7f0e", "#ffbb78", "#bcbd22", "#2ca02c", "#006400", "#7f7f7f"};

template <typename... Arguments> void add(std::string &text, const char *format, const Arguments &...arguments)
{
  fmt::format_to(std::back_inserter(text), fmt::runtime(format), arguments...);
}

std::string escaped(const std::string &raw)
{
  std::string text;
  for (const char c : raw)
    text += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : std::string(1, c);
  return text;
}

/// A plot of 620 x 300 px with room for a legend on the right.
class Plot
{
public:
  Plot(double x_most, double y_least, double y_most, bool log_y)
      : m_x_most(x_most), m_y0(y_least), m_y1(y_most), m_log(log_y)
  {
    m_svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1000\" height=\"360\" font-family=\"sans-serif\" "
            "font-size=\"12\">"
            "<rect width=\"1000\" height=\"360\" fill=\"white\"/>\n";
  }
  double x(double v) const { return 60 + 600 * v / m_x_most; }
  double y(double v) const
  {
    const double c = std::clamp(v, m_y0, m_y1);
    return 320 - 290 * (m_log ? std::log(c / m_y0) / std::log(m_y1 / m_y0) : (c - m_y0) / (m_y1 - m_y0));
  }
  void xTick(double v)
  {
    add(m_svg,
        "<path d=\"M{0:.1f} 30V320\" stroke=\"#ddd\"/><text x=\"{0:.1f}\" y=\"336\" "
        "text-anchor=\"middle\">{1:g}</text>\n",
        x(v), v);
  }
  void yTick(double v)
  {
    add(m_svg,
        "<path d=\"M60 {0:.1f}H660\" stroke=\"#ddd\"/><text x=\"54\" y=\"{1:.1f}\" text-anchor=\"end\">{2:g}</text>\n",
        y(v), y(v) + 4, v);
  }
  void names(const std::string &x_name, const std::string &y_name)
  {
    add(m_svg, "<text x=\"360\" y=\"354\" text-anchor=\"middle\">{}</text><text x=\"60\" y=\"20\">{}</text>\n", x_name,
        y_name);
  }
  void line(const std::vector<std::pair<double, double>> &points, const std::string &name, std::size_t index,
            bool dashed)
  {
    const char *colour = kColours[index % kColours.size()];
    add(m_svg, "<polyline fill=\"none\" stroke-width=\"1.6\" stroke=\"{}\"{} points=\"", colour,
        dashed ? " stroke-dasharray=\"5 3\"" : "");
    for (const auto &[u, v] : points)
      add(m_svg, "{:.1f},{:.1f} ", x(u), y(v));
    add(m_svg, "\"/><text x=\"670\" y=\"{}\" fill=\"{}\">{}{}</text>\n", 40 + 18 * m_lines++, colour, escaped(name),
        dashed ? " (dashed)" : "");
  }
  std::string text() const { return m_svg + "</svg>\n"; }

private:
  double m_x_most, m_y0, m_y1;
  bool m_log;
  int m_lines = 0;
  std::string m_svg;
};

std::string errorPlot(const ComparisonReport &report)
{
  Plot plot(std::max(1, report.frames - 1), 0.005, 10, true);
  for (const double v : {0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0})
    plot.yTick(v);
  for (int k = 0; k < report.frames; k += std::max(1, report.frames / 60) * 10)
    plot.xTick(k);
  plot.names("frame", "position error [m], all frames, whatever the tracker said");
  for (std::size_t i = 0; i < report.scores.size(); ++i) {
    std::vector<std::pair<double, double>> points;
    for (std::size_t k = 0; k < report.scores[i].errors.size(); ++k)
      points.emplace_back(double(k + 1), report.scores[i].errors[k].position_m);
    plot.line(points, report.scores[i].name, i, false);
  }
  return plot.text();
}

std::string basinPlot(const std::vector<BasinRow> &rows)
{
  Plot plot(rows[0].steps_px.back(), 0, 1, false);
  for (const double v : {0.0, 0.25, 0.5, 0.75, 1.0})
    plot.yTick(v);
  for (const double step : rows[0].steps_px)
    plot.xTick(step);
  plot.names("yaw between two frames [px]", "share of right answers");
  for (std::size_t i = 0; i < rows.size(); ++i) {
    std::vector<std::pair<double, double>> points;
    for (std::size_t s = 0; s < rows[i].steps_px.size(); ++s)
      points.emplace_back(rows[i].steps_px[s], rows[i].success[s]);
    const auto same =
        std::find_if(rows.begin(), rows.end(), [&](const BasinRow &row) { return row.name == rows[i].name; });
    plot.line(points, rows[i].name + (rows[i].has_clutter ? ", forest" : ", plain"),
              3 * std::size_t(same - rows.begin()) + 1,
              !rows[i].has_clutter); // every third colour: a hue a tracker
  }
  return plot.text();
}

void addBasin(std::string &html, const std::vector<BasinRow> &rows)
{
  html += "<h2>Basin</h2><table><tr><th>tracker, help: share of right answers (silent failures) after a yaw step of";
  for (const double step : rows[0].steps_px)
    add(html, "<th>{:g} px", step);
  html += "<th>pairs<th>settings</tr>\n";
  for (const BasinRow &row : rows) {
    add(html, "<tr><td>{}, {}", escaped(row.name), row.has_clutter ? "forest" : "plain");
    for (std::size_t s = 0; s < row.success.size(); ++s)
      add(html, "<td>{:.2f} ({:.2f})", row.success[s], row.silent[s]);
    add(html, "<td>{}<td>{}</tr>\n", row.pairs, escaped(row.settings));
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
    add(html,
        "<tr><td>{}<td>{} of "
        "{}<td>{}<td>{:.3f}<td>{:.2f}<td>{:.3f}<td>{:.2f}<td>{}<td>{}<td>{:.2f}<td>{:.2f}<td>{}</tr>\n",
        escaped(s.name), s.until_loss, s.frames, s.tracked, s.position_rmse_m, s.rotation_rmse_deg,
        s.all_position_rmse_m, s.all_rotation_rmse_deg, s.silent_failures, s.reinitialisations, s.median_ms, s.p95_ms,
        escaped(s.settings));
  html += "</table>\n";
}

void addFaults(std::string &html, const std::vector<FaultRow> &rows)
{
  html += "<h2>Faults</h2><table><tr><th>tracker, help<th>fault<th>noticed<th>silent failures<th>recovered<th>slowest "
          "[frames]</tr>\n";
  for (const FaultRow &row : rows)
    add(html, "<tr><td>{}<td>{}<td>{} of {}<td>{}<td>{} of {}<td>{}</tr>\n", escaped(row.name), row.fault.text(),
        row.noticed, row.fault_frames, row.silent_failures, row.recovered, row.runs, row.slowest);
  html += "</table>\n";
}

void addSweeps(std::string &html, const std::vector<SweepResult> &sweeps)
{
  html += "<h2>Settings tried</h2>\n";
  for (const SweepResult &sweep : sweeps) {
    add(html,
        "<details><summary>{}, {}: best of {} is {}</summary><table><tr><th>settings<th>frames right<th>position RMSE, "
        "all frames [m]</tr>\n",
        toString(sweep.kind), toString(sweep.help), sweep.tried.size(), sweep.best.text());
    for (const auto &[settings, score] : sweep.tried)
      add(html, "<tr><td>{}<td>{}<td>{:.3f}</tr>\n", settings.text(), score.tracked, score.all_position_rmse_m);
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
  add(html,
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
