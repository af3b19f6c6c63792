// SPDX-License-Identifier: GPL-2.0-or-later
#include "report/report_page.h"

#include "output/atomic_file.h"
#include "output/figure.h"
#include "output/page.h"
#include "output/palette.h"
#include "output/svg.h"
#include "report/report_drawings.h"
#include "report/report_script.h"

#include <cmath>
#include <fmt/format.h>
#include <fmt/ranges.h>

namespace bole
{
namespace
{
std::string list(const std::vector<std::string> &lines)
{
  std::string html = "<ul>";
  for (const std::string &line : lines)
    html += "<li>" + escaped(line) + "</li>";
  return html + "</ul>";
}

std::string banner(const RunRecord &run)
{
  const bool is_good = run.is_trusted && run.doubts.empty();
  const char *colour = is_good ? palette::kGreen : run.is_trusted ? palette::kOrange : palette::kVermilion;
  const char *title = is_good ? "Done" : run.is_trusted ? "Done, with doubts" : "Not to be trusted";
  return fmt::format("<div class=\"banner\" style=\"border-color:{}\"><b>{}</b>{}{}</div>\n", colour, title,
                     run.doubts.empty() ? "" : list(run.doubts), list(run.facts));
}

const TrunkMatch *matchOf(const RunRecord &run, int id)
{
  if (!run.evaluation || !run.evaluation->trunks)
    return nullptr;
  for (const TrunkMatch &match : run.evaluation->trunks->matches)
    if (match.estimate.id == id)
      return &match;
  return nullptr;
}

const TruthTrunk *truthOf(const RunRecord &run, int id)
{
  const TrunkMatch *match = matchOf(run, id);
  for (const TruthTrunk &truth : run.truth_trunks)
    if (match != nullptr && truth.id == match->truth_id)
      return &truth;
  return nullptr;
}

std::string errorText(const RunRecord &run, int id)
{
  const TrunkMatch *match = matchOf(run, id);
  return match == nullptr ? "-" : withUnit(100 * match->error[indexOf(run.evaluation->trunks->matching)], 1, "cm");
}

std::string panel(const RunRecord &run, const TrunkRecord &trunk)
{
  std::string html = fmt::format("<div class=\"panel\" data-id=\"{}\"><h3>Trunk {}</h3>\n", trunk.id, trunk.id);
  const auto view = run.views_jpeg.find(trunk.id);
  if (view != run.views_jpeg.end())
    html += "<div class=\"view\">" +
            htmlImage(view->second, "jpeg", fmt::format("trunk {} where it is seen best", trunk.id)) + "</div>";
  html += fmt::format(
      "<p>at ({:.2f}, {:.2f}) m, &sigma; {:.1f} cm<br>radius {:.1f} cm, &sigma; {:.1f} cm<br>leans {:.1f}&deg;<br>"
      "{} views from {:.1f} to {:.1f} s<br>probability {}</p>\n",
      trunk.xy.x(), trunk.xy.y(), 100 * trunk.positionSigma(), 100 * trunk.radius, 100 * trunk.radiusSigma(),
      std::atan(trunk.lean.norm()) * 180 / M_PI, trunk.observations, trunk.first_seen_s, trunk.last_seen_s,
      percent(trunk.probability));
  if (const TrunkMatch *match = matchOf(run, trunk.id))
    html += fmt::format("<p>truth: trunk {}, {} away; radius {:+.1f} cm</p>\n", match->truth_id,
                        errorText(run, trunk.id), 100 * match->radius_error);
  return html + chartBox(trunkCharts(run, trunk, truthOf(run, trunk.id))) + "</div>\n";
}

std::vector<TrunkRecord> confirmedOf(const RunRecord &run)
{
  std::vector<TrunkRecord> trunks;
  for (const TrunkRecord &trunk : run.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      trunks.push_back(trunk);
  return trunks;
}

std::string trunkTable(const RunRecord &run)
{
  std::string html = "<div class=\"wide\"><table>\n<tr><th>trunk</th><th>x [m]</th><th>y [m]</th><th>&sigma; [cm]</th>"
                     "<th>radius [cm]</th><th>&sigma; [cm]</th><th>views</th><th>probability</th>";
  html += run.evaluation ? "<th>from the truth</th></tr>\n" : "</tr>\n";
  for (const TrunkRecord &trunk : confirmedOf(run)) {
    html +=
        fmt::format("<tr data-id=\"{0}\" tabindex=\"0\"><td>{0}</td><td>{1:.2f}</td><td>{2:.2f}</td><td>{3:.1f}</td>"
                    "<td>{4:.1f}</td><td>{5:.1f}</td><td>{6}</td><td>{7}</td>",
                    trunk.id, trunk.xy.x(), trunk.xy.y(), 100 * trunk.positionSigma(), 100 * trunk.radius,
                    100 * trunk.radiusSigma(), trunk.observations, percent(trunk.probability));
    html += run.evaluation ? "<td>" + errorText(run, trunk.id) + "</td></tr>\n" : "</tr>\n";
  }
  return html + "</table></div>\n";
}

std::string truthHtml(const Evaluation &evaluation)
{
  std::vector<std::vector<std::string>> rows;
  const auto ate = [](const TrajectoryReport &report) {
    return withUnit(100 * report.absolute[indexOf(Alignment::xy_yaw)].ate, 1, "cm");
  };
  rows.push_back({"trajectory, smoothed: ATE after x, y, yaw", ate(evaluation.smoothed)});
  if (evaluation.online)
    rows.push_back({"trajectory, online", ate(*evaluation.online)});
  if (evaluation.odometry)
    rows.push_back({"pose filter", ate(*evaluation.odometry)});
  if (const auto &trunks = evaluation.trunks) {
    rows.push_back(
        {"recall", fmt::format("{} ({} of {})", percent(trunks->recall), trunks->all.found, trunks->all.expected)});
    rows.push_back({"precision", fmt::format("{} ({} of {})", percent(trunks->precision), trunks->matches.size(),
                                             trunks->confirmed)});
    rows.push_back(
        {"error of the place, median", withUnit(100 * trunks->all.median[indexOf(trunks->matching)], 1, "cm")});
    rows.push_back({"error of the radius, RMSE", withUnit(100 * trunks->all.radius_rmse, 1, "cm")});
    rows.push_back({"NEES / 2 of the places (1: honest)", figure(trunks->all.nees_half, 0, 2)});
  }
  return "<h2>Against the truth</h2>\n" + htmlTable({"", ""}, rows);
}

std::string timingHtml(const RunRecord &run)
{
  const TimingTable &timing = run.timing;
  std::vector<std::vector<std::string>> rows;
  for (std::size_t i = 0; i < timing.stages.size(); ++i)
    rows.push_back({escaped(timing.stages[i]), fmt::format("{:.2f}", timing.medianStage_ms(i))});
  rows.push_back({"<b>total</b>", fmt::format("<b>{:.2f}</b>", timing.medianTotal_ms())});
  rows.push_back({"total, 95 % of the frames below", fmt::format("{:.2f}", timing.percentile95_ms())});
  return "<h2>Cost</h2>\n" + chartBox(timingChart(run)) + htmlTable({"stage", "median of a frame [ms]"}, rows);
}

std::string nextHtml(const RunRecord &run)
{
  std::vector<std::string> next;
  for (const std::string &doubt : run.doubts)
    if (doubt.find("--") != std::string::npos)
      next.push_back(escaped(doubt));
  const std::string folder = escaped(run.folder);
  if (!run.evaluation)
    next.push_back("With a ground truth: <code>bole report " + folder + " SEQUENCE</code>, <code>bole evaluate " +
                   folder + " SEQUENCE</code>.");
  if (run.has_ranges) {
    next.push_back("Localise in this map: <code>bole export " + folder +
                   " cao</code>, then "
                   "<code>vpMbTrunkTracker::loadModel()</code>.");
    next.push_back("To a geographic information system: <code>bole export " + folder +
                   " geojson --origin LATITUDE,LONGITUDE,HEADING</code>; to CAD: <code>dxf</code>; to a point cloud: "
                   "<code>ply</code>.");
  }
  next.push_back("Repeat it and compare the bytes: <code>bole track --again " + folder + "</code>.");
  std::string html = "<h2>What to do next</h2>\n<ul>";
  for (const std::string &step : next)
    html += "<li>" + step + "</li>";
  return html + "</ul>\n";
}

std::string originHtml(const RunRecord &run)
{
  std::vector<std::vector<std::string>> rows = {{"input", escaped(run.input)}};
  if (!run.note.empty())
    rows.push_back({"note", escaped(run.note)});
  if (!run.sha256.empty())
    rows.push_back({"SHA-256 of the input", "<code>" + run.sha256 + "</code>"});
  rows.push_back({"command", "<code>" + escaped(fmt::format("{}", fmt::join(run.command, " "))) + "</code>"});
  rows.push_back({"in", escaped(run.working_folder)});
  for (const auto &[name, version] : run.versions)
    rows.push_back({escaped(name), escaped(version)});
  return "<h2>How it was made</h2>\n" + htmlTable({"", ""}, rows);
}
} // namespace

std::string reportHtml(const RunRecord &run)
{
  std::string body = kReportStyle + banner(run);
  const std::vector<TrunkRecord> trunks = run.has_ranges ? confirmedOf(run) : std::vector<TrunkRecord>();
  if (run.has_ranges) {
    body += "<div id=\"board\"><div>" + mapHtml(run) + "</div>\n<div id=\"panels\">";
    for (const TrunkRecord &trunk : trunks)
      body += panel(run, trunk);
    body += "</div></div>\n<h2>Trunks</h2>\n" + trunkTable(run);
  }
  else
    body += "<h2>Bearings</h2>\n" + chartBox(run.map_svg);
  if (run.evaluation)
    body += truthHtml(*run.evaluation);
  body += "<h2>Time line</h2>\n" + chartBox(timeLine(run));
  if (run.has_ranges)
    body += "<h2>Trajectory</h2>\n" + chartBox(trajectoryCharts(run));
  if (run.has_video)
    body += "<h2>Video</h2>\n<video controls preload=\"none\" src=\"overlay.mp4\"></video><p>Beside this page: <a "
            "href=\"overlay.mp4\">overlay.mp4</a>, <a href=\"saliency.mp4\">saliency.mp4</a></p>\n";
  body += timingHtml(run) + nextHtml(run) + originHtml(run);
  return htmlPage("bole: " + run.input, body, kReportScript);
}

void writeReport(const std::string &run, const std::string &sequence)
{
  writeAtomically(run + "/report.html", reportHtml(readRun(run, sequence)));
}
} // namespace bole
