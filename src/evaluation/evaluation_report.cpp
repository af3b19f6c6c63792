// SPDX-License-Identifier: GPL-2.0-or-later
#include "evaluation/trunk_metrics.h"
#include "output/figure.h"
#include <bole/evaluation.h>

#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <nlohmann/json.hpp>

namespace bole
{
namespace
{
using Json = nlohmann::ordered_json;
constexpr std::array<Alignment, 4> kAlignments = {Alignment::none, Alignment::first_pose, Alignment::xy_yaw,
                                                  Alignment::xy_yaw_scale};

template <typename... Arguments> void add(std::string &text, const char *format, const Arguments &...arguments)
{
  fmt::format_to(std::back_inserter(text), fmt::runtime(format), arguments...);
}

void addTrajectory(std::string &text, const char *name, const TrajectoryReport &report)
{
  const auto ate = [&](Alignment alignment) { return report.absolute[indexOf(alignment)].ate; };
  add(text, "  {:<10}{}{}{}{}{}{}{}\n", name, figure(ate(Alignment::none), 9, 3), figure(ate(Alignment::xy_yaw), 11, 3),
      figure(ate(Alignment::xy_yaw_scale), 11, 3), figure(report.scale, 9, 3),
      figure(report.absolute[indexOf(Alignment::xy_yaw)].rotation_deg, 11, 2),
      figure(report.over_second.translation, 9, 3), figure(report.over_second.rotation_deg, 11, 2));
}

void addErrors(std::string &text, const std::string &name, const TrunkErrors &errors)
{
  constexpr std::size_t kAligned = static_cast<std::size_t>(Alignment::xy_yaw);
  add(text, "  {:<20} {:>3} of {:<3} {:7}{}{}{}{}{}{}\n", name, errors.found, errors.expected, errors.matches,
      figure(errors.median[kAligned], 11, 3), figure(errors.rmse[kAligned], 9, 3),
      figure(errors.predicted_sigma, 10, 3), figure(errors.nees_half, 7, 2), figure(errors.radius_rmse, 11, 3),
      signedFigure(errors.radius_bias, 11, 3));
}

void addBins(std::string &text, const TrunkMetrics &trunks)
{
  add(text, "  predicted sigma {}, NEES/2 {} (first pose as gauge; 1 when honest)\n",
      withUnit(trunks.all.predicted_sigma, 3, "m"), figure(trunks.all.nees_half, 0, 2));
  add(text, "\n  {:<20} {:<10} {:>7} {:>10} {:>8} {:>9} {:>6} {:>10} {:>10}\n", "", "found", "matched", "median [m]",
      "RMSE [m]", "sigma [m]", "NEES/2", "r RMSE [m]", "r bias [m]");
  addErrors(text, "all", trunks.all);
  add(text, "  by nearest range\n");
  for (const TrunkBin &bin : trunks.by_range)
    addErrors(text, "  " + bin.name, bin.errors);
  add(text, "  by change of bearing\n");
  for (const TrunkBin &bin : trunks.by_parallax)
    addErrors(text, "  " + bin.name, bin.errors);
}

/// \p is_against_run: the errors have no bins of visibility, and no truth to be honest about.
void addTrunks(std::string &text, const TrunkMetrics &trunks, bool is_against_run)
{
  add(text, "\nTrunks: {} of the map, {} matched one to one under {} m after alignment in x, y, yaw{}\n",
      trunks.confirmed, trunks.matches.size(), kMatchGate,
      trunks.matching == Alignment::xy_yaw_scale ? " and scale" : "");
  add(text, "  recall {} ({} of {})   precision {} ({} of {})   F1 {}   duplicates {}\n\n", percent(trunks.recall),
      trunks.all.found, trunks.all.expected, percent(trunks.precision), trunks.matches.size(), trunks.confirmed,
      percent(trunks.f1), percent(trunks.duplicates));
  add(text, "  Position error           median [m]  RMSE [m]\n");
  for (const auto &[alignment, name] :
       {std::pair(Alignment::none, "unaligned"), std::pair(Alignment::xy_yaw, "aligned x, y, yaw"),
        std::pair(Alignment::xy_yaw_scale, "and scale")})
    add(text, "  {:<20} {} {}\n", name, figure(trunks.all.median[indexOf(alignment)], 14, 3),
        figure(trunks.all.rmse[indexOf(alignment)], 9, 3));
  if (is_against_run)
    add(text, "  radius difference {} RMSE\n", withUnit(trunks.all.radius_rmse, 3, "m"));
  else
    addBins(text, trunks);
}

std::string seen(const TrunkVisibility &visibility)
{
  if (visibility.frames == 0)
    return "never in view";
  return fmt::format("seen {:3} frames from {:4.1f} m over {:5.1f} degrees", visibility.frames, visibility.min_range,
                     visibility.bearing_change);
}

void addVerbose(std::string &text, const TrunkMetrics &trunks)
{
  add(text, "\nMatches (truth <- map): position error unaligned / aligned, predicted sigma, NEES/2, radius error\n");
  for (const TrunkMatch &match : trunks.matches)
    add(text, "  {:>5} <- {:<5} {:6.3f} / {:.3f} m  sigma {:.3f} m  NEES/2 {}  r {} m {} m  {}, {} observations{}\n",
        match.truth_id, match.estimate.id, match.error[indexOf(Alignment::none)],
        match.error[indexOf(Alignment::xy_yaw)], match.predicted_sigma, figure(match.nees_half, 6, 2),
        figure(match.truth_radius, 0, 3), signedFigure(match.radius_error, 0, 3), seen(match.visibility),
        match.estimate.observations, match.visibility.is_expected ? "" : " (not expected)");
  add(text, "Missed trunks of the truth\n");
  for (const Unmatched &miss : trunks.misses) {
    add(text, "  {:>5} {}; ", miss.id, seen(miss.visibility));
    if (miss.nearest_id < 0)
      add(text, "the map is empty\n");
    else
      add(text, "nearest of the map: {} ({}, {} observations) at {:.2f} m\n", miss.nearest_id,
          toString(miss.estimate.status), miss.estimate.observations, miss.nearest_distance);
  }
  add(text, "False positives\n");
  for (const Unmatched &extra : trunks.false_positives) {
    add(text, "  {:>5} at ({:.2f}, {:.2f}) m, r {:.3f} m, sigma {:.2f} m, {} observations, {:.1f} to {:.1f} s",
        extra.id, extra.estimate.xy.x(), extra.estimate.xy.y(), extra.estimate.radius, extra.estimate.positionSigma(),
        extra.estimate.observations, extra.estimate.first_seen_s, extra.estimate.last_seen_s);
    if (extra.nearest_id >= 0)
      add(text, ": {} {} at {:.2f} m", extra.is_duplicate ? "duplicate of" : "nearest is", extra.nearest_id,
          extra.nearest_distance);
    add(text, "\n");
  }
}

Json toJson(const TrajectoryReport &report)
{
  Json json;
  for (const Alignment alignment : kAlignments) {
    const TrajectoryErrors &errors = report.absolute[indexOf(alignment)];
    json["ate"][toString(alignment)] = {
        {"rmse_m", errors.ate}, {"rmse_xy_m", errors.ate_xy}, {"rotation_rmse_deg", errors.rotation_deg}};
  }
  json["poses"] = report.absolute[0].poses;
  json["scale"] = report.scale;
  const auto relative = [](const RelativeErrors &errors) {
    return Json{{"intervals", errors.intervals},
                {"translation_rmse_m", errors.translation},
                {"rotation_rmse_deg", errors.rotation_deg}};
  };
  json["rpe_frame"] = relative(report.over_frame);
  json["rpe_1s"] = relative(report.over_second);
  return json;
}

Json toJson(const TrunkErrors &errors)
{
  Json json = {
      {"expected", errors.expected}, {"found", errors.found}, {"recall", errors.recall()}, {"matches", errors.matches}};
  for (const Alignment alignment : kAlignments)
    json["position_m"][toString(alignment)] = {{"median", errors.median[indexOf(alignment)]},
                                               {"rmse", errors.rmse[indexOf(alignment)]}};
  json["nees_half"] = errors.nees_half;
  json["predicted_sigma_m"] = errors.predicted_sigma;
  json["radius_m"] = {{"rmse", errors.radius_rmse}, {"bias", errors.radius_bias}};
  return json;
}

Json toJson(const TrunkMetrics &trunks)
{
  Json json = {{"confirmed", trunks.confirmed},
               {"precision", trunks.precision},
               {"recall", trunks.recall},
               {"f1", trunks.f1},
               {"duplicates", trunks.duplicates},
               {"gate_m", kMatchGate},
               {"matched_after", toString(trunks.matching)},
               {"all", toJson(trunks.all)}};
  for (const auto &[key, bins] :
       {std::pair("by_range", &trunks.by_range), std::pair("by_parallax", &trunks.by_parallax)})
    for (const TrunkBin &bin : *bins)
      json[key][bin.name] = toJson(bin.errors);
  const auto ifSeen = [](const TrunkVisibility &visibility, double value) {
    return visibility.frames == 0 ? kNotMeasured : value;
  };
  const auto idOrNull = [](int id) { return id < 0 ? Json() : Json(id); };
  json["matched"] = Json::array();
  for (const TrunkMatch &match : trunks.matches)
    json["matched"].push_back({{"truth", match.truth_id},
                               {"map", match.estimate.id},
                               {"expected", match.visibility.is_expected},
                               {"min_range_m", ifSeen(match.visibility, match.visibility.min_range)},
                               {"bearing_change_deg", ifSeen(match.visibility, match.visibility.bearing_change)},
                               {"position_error_m", match.error[indexOf(Alignment::xy_yaw)]},
                               {"nees_half", match.nees_half},
                               {"radius_m", match.estimate.radius},
                               {"radius_error_m", match.radius_error},
                               {"probability", match.estimate.probability}});
  json["missed"] = Json::array();
  for (const Unmatched &miss : trunks.misses)
    json["missed"].push_back({{"truth", miss.id},
                              {"min_range_m", ifSeen(miss.visibility, miss.visibility.min_range)},
                              {"bearing_change_deg", ifSeen(miss.visibility, miss.visibility.bearing_change)},
                              {"nearest_map", idOrNull(miss.nearest_id)},
                              {"distance_m", miss.nearest_distance}});
  json["false_positives"] = Json::array();
  for (const Unmatched &extra : trunks.false_positives)
    json["false_positives"].push_back({{"map", extra.id},
                                       {"nearest_truth", idOrNull(extra.nearest_id)},
                                       {"distance_m", extra.nearest_distance},
                                       {"duplicate", extra.is_duplicate},
                                       {"probability", extra.estimate.probability}});
  return json;
}
} // namespace

std::string toTable(const Evaluation &evaluation, bool verbose)
{
  std::string text;
  add(text, "{} against {}: {} of {} frames\n", evaluation.run, evaluation.sequence,
      evaluation.smoothed.absolute[0].poses, evaluation.frames);
  if (evaluation.time_shift_s)
    add(text, "  The run's stamps were shifted by {:+.3f} s, for its motion to fit.\n", *evaluation.time_shift_s);
  if (!evaluation.reference.empty())
    add(text, "{}\n", evaluation.reference);
  text += "\n";
  add(text, "  {:<10} {:^29} {:>8} {:>10} {:^20}\n", "", "ATE [m], aligned in", "", "rotation", "drift over 1 s");
  add(text, "  {:<10} {:>8} {:>10} {:>10} {:>8} {:>10} {:>8} {:>10}\n", "Trajectory", "nothing", "x, y, yaw",
      "and scale", "scale", "[degrees]", "[m]", "[degrees]");
  addTrajectory(text, "smoothed", evaluation.smoothed);
  if (evaluation.online)
    addTrajectory(text, "online", *evaluation.online);
  if (evaluation.odometry)
    addTrajectory(text, "odometry", *evaluation.odometry);
  if (std::isfinite(evaluation.online_nees_half))
    add(text, "  online positions: NEES/2 {} (first pose as gauge; 1 when honest)\n",
        figure(evaluation.online_nees_half, 0, 2));
  if (evaluation.trunks) {
    addTrunks(text, *evaluation.trunks, evaluation.is_against_run);
    if (verbose)
      addVerbose(text, *evaluation.trunks);
  }
  return text;
}

std::string toJson(const Evaluation &evaluation)
{
  Json json = {{"run", evaluation.run}, {"sequence", evaluation.sequence}, {"frames", evaluation.frames}};
  json["against_run"] = evaluation.is_against_run;
  if (evaluation.time_shift_s)
    json["time_shift_s"] = *evaluation.time_shift_s;
  json["reference"] = evaluation.reference.empty() ? Json() : Json(evaluation.reference);
  json["trajectory"]["smoothed"] = toJson(evaluation.smoothed);
  if (evaluation.online) {
    json["trajectory"]["online"] = toJson(*evaluation.online);
    json["trajectory"]["online"]["nees_half"] = evaluation.online_nees_half;
  }
  if (evaluation.odometry)
    json["trajectory"]["odometry"] = toJson(*evaluation.odometry);
  if (evaluation.trunks)
    json["trunks"] = toJson(*evaluation.trunks);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}
} // namespace bole
