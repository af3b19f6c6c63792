// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/comparison.h"
#include "support/text.h"

#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bole
{
namespace
{
using Json = nlohmann::ordered_json;

/// Frames until it was right again, of the slowest; NaN where it never was.
double slowestOf(const FaultRow &row) { return row.recovered > 0 ? row.slowest : NAN; }

void addScoreLines(std::string &text, const std::vector<Score> &scores)
{
  text += fmt::format("{:<42} {:>6} {:>6} {:>8} {:>7} {:>8} {:>7} {:>6} {:>7} {:>6} {:>6}\n", "", "until", "", "RMSE",
                      "", "RMSE", "", "", "re-", "ms", "ms");
  text += fmt::format("{:<42} {:>6} {:>6} {:>8} {:>7} {:>8} {:>7} {:>6} {:>7} {:>6} {:>6}\n", "tracker, help", "loss",
                      "right", "held [m]", "[deg]", "all [m]", "[deg]", "silent", "started", "median", "p95");
  for (const Score &s : scores)
    text += fmt::format("{:<42} {:>6} {:>6} {} {} {} {} {:>6} {:>7} {} {}\n", s.name, s.until_loss, s.tracked,
                        figure(s.position_rmse_m, 8, 3), figure(s.rotation_rmse_deg, 7, 2),
                        figure(s.all_position_rmse_m, 8, 3), figure(s.all_rotation_rmse_deg, 7, 2), s.silent_failures,
                        s.reinitialisations, figure(s.median_ms, 6, 2), figure(s.p95_ms, 6, 2));
}

void addBasinLines(std::string &text, const std::vector<BasinRow> &rows)
{
  if (rows.empty())
    return;
  text += fmt::format(
      "\nBasin: right answers [%] one frame after a yaw step [px]; silent failures [%] at the widest\n{:<42}", "");
  for (const double step : rows[0].steps_px)
    text += fmt::format(" {:>5g}", step);
  text += fmt::format(" {:>6} {:>6}\n", "silent", "pairs");
  for (const BasinRow &row : rows) {
    text += fmt::format("{:<42}", row.name + (row.has_clutter ? ", forest" : ", plain"));
    for (const double share : row.success)
      text += fmt::format(" {}", figure(row.pairs > 0 ? 100 * share : NAN, 5, 0));
    text += fmt::format(" {} {:>6}\n", figure(row.pairs > 0 ? 100 * row.silent.back() : NAN, 6, 0), row.pairs);
  }
}

void addFaultLines(std::string &text, const std::vector<FaultRow> &rows)
{
  if (rows.empty())
    return;
  text += fmt::format("\nFaults\n{:<42} {:<14} {:>9} {:>7} {:>11} {:>8}\n", "", "fault", "noticed", "silent",
                      "recovered", "slowest");
  for (const FaultRow &row : rows)
    text += fmt::format("{:<42} {:<14} {:>4} of {:<3} {:>5} {:>6} of {:<3} {:>7}\n", row.name, row.fault.text(),
                        row.noticed, row.fault_frames, row.silent_failures, row.recovered, row.runs,
                        figure(slowestOf(row), 7, 0));
}

Json scoreJson(const Score &s, bool has_errors)
{
  Json json = {{"tracker", toString(s.kind)},
               {"help", toString(s.help)},
               {"settings", s.settings},
               {"frames", s.frames},
               {"frames_until_loss", s.until_loss},
               {"frames_right", s.tracked},
               {"silent_failures", s.silent_failures},
               {"reinitialisations", s.reinitialisations},
               {"position_rmse_while_tracked_m", s.position_rmse_m},
               {"rotation_rmse_while_tracked_deg", s.rotation_rmse_deg},
               {"position_rmse_all_frames_m", s.all_position_rmse_m},
               {"rotation_rmse_all_frames_deg", s.all_rotation_rmse_deg},
               {"median_ms", s.median_ms},
               {"p95_ms", s.p95_ms}};
  if (!has_errors)
    return json;
  Json &errors = json["errors"] = Json::array();
  for (const FrameError &e : s.errors)
    errors.push_back(
        {{"position_m", e.position_m}, {"rotation_deg", e.rotation_deg}, {"complained", e.complained}, {"ms", e.ms}});
  return json;
}
} // namespace

std::string toTable(const ComparisonReport &report)
{
  std::string text;
  text +=
      fmt::format("{}: {} frames, {} trunks in the model; wrong is more than {:g} m or {:g} degrees\n\n",
                  report.sequence, report.frames, report.trunks, report.limits.position_m, report.limits.rotation_deg);
  addScoreLines(text, report.scores);
  text += fmt::format("\nSettings\n");
  for (const Score &score : report.scores)
    text += fmt::format("{:<42} {}\n", score.name, score.settings);
  if (!report.timing.empty()) {
    text += fmt::format("\nCost on the same trunks, at the true pose [ms a frame]\n");
    for (const Score &s : report.timing)
      text += fmt::format("{:<42} median {}, p95 {}\n", toString(s.kind), figure(s.median_ms, 0, 2),
                          figure(s.p95_ms, 0, 2));
  }
  addBasinLines(text, report.basin);
  addFaultLines(text, report.faults);
  return text;
}

std::string toJson(const ComparisonReport &report)
{
  Json json = {{"complete", true},
               {"sequence", report.sequence},
               {"command", report.command},
               {"frames", report.frames},
               {"trunks", report.trunks},
               {"limits", {{"position_m", report.limits.position_m}, {"rotation_deg", report.limits.rotation_deg}}}};
  const auto addAll = [&](const char *key, const std::vector<Score> &scores, bool has_errors) {
    Json &list = json[key] = Json::array();
    for (const Score &score : scores)
      list.push_back(scoreJson(score, has_errors));
  };
  addAll("trackers", report.scores, true);
  addAll("cost_on_the_same_trunks", report.timing, false);
  Json &sweeps = json["sweeps"] = Json::array();
  for (const SweepResult &sweep : report.sweeps) {
    Json tried = Json::array();
    for (const auto &[settings, score] : sweep.tried)
      tried.push_back({{"settings", settings.text()},
                       {"frames_right", score.tracked},
                       {"position_rmse_all_frames_m", score.all_position_rmse_m}});
    sweeps.push_back({{"tracker", toString(sweep.kind)},
                      {"help", toString(sweep.help)},
                      {"best", sweep.best.text()},
                      {"tried", tried}});
  }
  Json &basin = json["basin"] = Json::array();
  for (const BasinRow &row : report.basin)
    basin.push_back({{"tracker", row.name},
                     {"settings", row.settings},
                     {"clutter", row.has_clutter},
                     {"pairs", row.pairs},
                     {"steps_px", row.steps_px},
                     {"success", row.success},
                     {"silent", row.silent}});
  Json &faults = json["faults"] = Json::array();
  for (const FaultRow &row : report.faults)
    faults.push_back({{"tracker", row.name},
                      {"fault", row.fault.text()},
                      {"runs", row.runs},
                      {"fault_frames", row.fault_frames},
                      {"noticed", row.noticed},
                      {"silent_failures", row.silent_failures},
                      {"recovered", row.recovered},
                      {"slowest_recovery_frames", slowestOf(row)}});
  return json.dump(1) + "\n";
}
} // namespace bole
