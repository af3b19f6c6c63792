// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/evaluation.h>

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

std::size_t index(Alignment alignment) { return static_cast<std::size_t>(alignment); }

void addTrajectory(std::string &text, const char *name, const TrajectoryReport &report)
{
  const auto ate = [&](Alignment alignment) { return report.absolute[index(alignment)].ate; };
  add(text, "  {:<10} {:8.3f} {:10.3f} {:10.3f} {:8.3f} {:10.2f} {:10.3f} {:10.2f}\n", name, ate(Alignment::none),
      ate(Alignment::xy_yaw), ate(Alignment::xy_yaw_scale), report.scaled.scale,
      report.absolute[index(Alignment::xy_yaw)].rotation_deg, report.over_second.translation,
      report.over_second.rotation_deg);
}

void addErrors(std::string &text, const std::string &name, const TrunkErrors &errors)
{
  add(text, "  {:<20} {:>3} of {:<3} {:6} {:8.3f} {:8.3f} {:8.3f} {:8.2f} {:9.3f} {:+9.3f}\n", name, errors.found,
      errors.expected, errors.matches, errors.median[index(Alignment::xy_yaw)], errors.rmse[index(Alignment::xy_yaw)],
      errors.predicted_sigma, errors.nees_half, errors.radius_rmse, errors.radius_bias);
}

void addBins(std::string &text, const TrunkMetrics &trunks)
{
  add(text, "  predicted sigma {:.3f} m, NEES/2 {:.2f} (first pose as gauge; 1 when honest)\n",
      trunks.all.predicted_sigma, trunks.all.nees_half);
  add(text, "\n  {:<20} {:<10} {:>6} {:>8} {:>8} {:>8} {:>8} {:>9} {:>9}\n", "", "found", "match", "median", "RMSE",
      "sigma", "NEES/2", "r RMSE", "r bias");
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
  add(text,
      "\nTrunks: {} confirmed, {} matched one to one under {} m after alignment in x, y, yaw{}\n"
      "  recall {:.3f} ({} of {})   precision {:.3f}   F1 {:.3f}   duplicates {:.3f}\n\n",
      trunks.confirmed, trunks.matches.size(), kMatchGate,
      trunks.matching == Alignment::xy_yaw_scale ? " and scale" : "", trunks.recall, trunks.all.found,
      trunks.all.expected, trunks.precision, trunks.f1, trunks.duplicates);
  add(text, "  Position error [m]       median     RMSE\n");
  for (const auto &[alignment, name] :
       {std::pair(Alignment::none, "unaligned"), std::pair(Alignment::xy_yaw, "aligned x, y, yaw"),
        std::pair(Alignment::xy_yaw_scale, "and scale")})
    add(text, "  {:<20} {:10.3f} {:8.3f}\n", name, trunks.all.median[index(alignment)],
        trunks.all.rmse[index(alignment)]);
  if (is_against_run)
    add(text, "  radius difference {:.3f} m RMSE\n", trunks.all.radius_rmse);
  else
    addBins(text, trunks);
}

void addVerbose(std::string &text, const TrunkMetrics &trunks)
{
  add(text, "\nMatches (truth <- map): position error unaligned / aligned, predicted sigma, "
            "NEES/2, radius error\n");
  for (const TrunkMatch &match : trunks.matches)
    add(text,
        "  {:>5} <- {:<5} {:6.3f} / {:.3f} m  sigma {:.3f} m  NEES/2 {:6.2f}  r {:.3f} {:+.3f} m  "
        "seen {:3} frames from "
        "{:4.1f} m over {:5.1f} deg, {} observations{}\n",
        match.truth.id, match.estimate.id, match.error[index(Alignment::none)], match.error[index(Alignment::xy_yaw)],
        match.predicted_sigma, match.nees_half, match.truth.radius, match.radius_error, match.visibility.frames,
        match.visibility.min_range, match.visibility.bearing_change, match.estimate.observations,
        match.visibility.is_expected ? "" : " (not expected)");
  add(text, "Missed trunks of the truth\n");
  for (const Unmatched &miss : trunks.misses) {
    add(text, "  {:>5} seen {:3} frames from {:4.1f} m over {:5.1f} deg; ", miss.id, miss.visibility.frames,
        miss.visibility.min_range, miss.visibility.bearing_change);
    if (miss.nearest_id < 0)
      add(text, "the map is empty\n");
    else
      add(text, "nearest of the map: {} ({}, {} observations) at {:.2f} m\n", miss.nearest_id,
          toString(miss.estimate.status), miss.estimate.observations, miss.nearest_distance);
  }
  add(text, "False positives\n");
  for (const Unmatched &extra : trunks.false_positives)
    add(text,
        "  {:>5} at ({:.2f}, {:.2f}) r {:.3f} m, sigma {:.2f} m, {} observations, {:.1f} to {:.1f} "
        "s: {} {} at {:.2f} m\n",
        extra.id, extra.estimate.xy.x(), extra.estimate.xy.y(), extra.estimate.radius,
        std::sqrt(std::max(0.0, extra.estimate.covariance_xy.trace())), extra.estimate.observations,
        extra.estimate.first_seen_s, extra.estimate.last_seen_s, extra.is_duplicate ? "duplicate of" : "nearest is",
        extra.nearest_id, extra.nearest_distance);
}

Json toJson(const TrajectoryReport &report)
{
  Json json;
  for (const Alignment alignment : kAlignments) {
    const TrajectoryErrors &errors = report.absolute[index(alignment)];
    json["ate"][toString(alignment)] = {
        {"rmse_m", errors.ate}, {"rmse_xy_m", errors.ate_xy}, {"rotation_rmse_deg", errors.rotation_deg}};
  }
  json["poses"] = report.absolute[0].poses;
  json["scale"] = report.scaled.scale;
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
    json["position_m"][toString(alignment)] = {{"median", errors.median[index(alignment)]},
                                               {"rmse", errors.rmse[index(alignment)]}};
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
  json["matched"] = Json::array();
  for (const TrunkMatch &match : trunks.matches)
    json["matched"].push_back({{"truth", match.truth.id},
                               {"map", match.estimate.id},
                               {"expected", match.visibility.is_expected},
                               {"min_range_m", match.visibility.min_range},
                               {"bearing_change_deg", match.visibility.bearing_change},
                               {"position_error_m", match.error[index(Alignment::xy_yaw)]},
                               {"nees_half", match.nees_half},
                               {"radius_error_m", match.radius_error}});
  json["missed"] = Json::array();
  for (const Unmatched &miss : trunks.misses)
    json["missed"].push_back(
        {{"truth", miss.id}, {"nearest_map", miss.nearest_id}, {"distance_m", miss.nearest_distance}});
  json["false_positives"] = Json::array();
  for (const Unmatched &extra : trunks.false_positives)
    json["false_positives"].push_back({{"map", extra.id},
                                       {"nearest_truth", extra.nearest_id},
                                       {"distance_m", extra.nearest_distance},
                                       {"duplicate", extra.is_duplicate}});
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
  add(text, "  {:<10} {:>8} {:>10} {:>10} {:>8} {:>10} {:>10} {:>10}\n", "Trajectory", "ATE [m]", "x, y, yaw",
      "and scale", "scale", "rot [deg]", "RPE 1s [m]", "[deg]");
  addTrajectory(text, "smoothed", evaluation.smoothed);
  if (evaluation.online)
    addTrajectory(text, "online", *evaluation.online);
  if (evaluation.odometry)
    addTrajectory(text, "odometry", *evaluation.odometry);
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
  json["reference"] = evaluation.reference;
  json["trajectory"]["smoothed"] = toJson(evaluation.smoothed);
  if (evaluation.online)
    json["trajectory"]["online"] = toJson(*evaluation.online);
  if (evaluation.odometry)
    json["trajectory"]["odometry"] = toJson(*evaluation.odometry);
  if (evaluation.trunks)
    json["trunks"] = toJson(*evaluation.trunks);
  return json.dump(2) + "\n";
}
} // namespace bole
