// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/summary_json.h"

#include "geometry/median.h"
#include "output/figure.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kAtRest_m = 0.1, kAtRest_deg = 2; // less than this is no motion

std::size_t framesIn(const RunSummary &summary)
{
  std::size_t count = 0;
  for (const auto &[status, frames] : summary.frames)
    count += frames;
  return count;
}

std::size_t goodFrames(const RunSummary &summary)
{
  const auto ok = summary.frames.find(FrameStatus::ok);
  return ok == summary.frames.end() ? 0 : ok->second;
}

std::string gapsText(const std::vector<PictureGap> &gaps)
{
  if (gaps.empty())
    return {};
  const auto longest = std::max_element(
      gaps.begin(), gaps.end(), [](const PictureGap &a, const PictureGap &b) { return a.length_s < b.length_s; });
  const std::string text =
      fmt::format("; no picture for {:.1f} s from {:.1f} s on", longest->length_s, longest->begin_s);
  return gaps.size() == 1 ? text : fmt::format("{}, the longest of {} gaps", text, gaps.size());
}

std::string framesText(const RunSummary &summary)
{
  const std::size_t all = framesIn(summary), good = goodFrames(summary);
  if (good == all)
    return fmt::format("{} frames, all ok{}", all, gapsText(summary.gaps));
  std::string text = fmt::format("{} of {} frames ok", good, all);
  for (const auto &[status, count] : summary.frames) {
    if (status == FrameStatus::ok)
      continue;
    text += fmt::format(", {} {}", count, toString(status));
    const auto reason = summary.reasons.find(status);
    if (reason != summary.reasons.end())
      text += fmt::format(" ({})", reason->second);
  }
  return text + gapsText(summary.gaps);
}

/// Takes the common error of the scale, which the verdict tells beside it, out of the covariance of \p trunk.
TrunkRecord amongThemselves(TrunkRecord trunk, const RunSummary &summary)
{
  Eigen::Matrix<double, 5, 1> by_scale;
  by_scale << trunk.xy - summary.first_place, trunk.radius, 0, 0;
  by_scale *= summary.reference.scale_sigma;
  trunk.covariance -= by_scale * by_scale.transpose();
  return trunk;
}

double medianOf(const RunSummary &summary, double (TrunkRecord::*sigma)() const)
{
  std::vector<double> values;
  for (const TrunkRecord &trunk : summary.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      values.push_back((amongThemselves(trunk, summary).*sigma)());
  return values.empty() ? NAN : bole::medianOf(std::move(values));
}

std::size_t confirmedIn(const RunSummary &summary)
{
  return static_cast<std::size_t>(
      std::count_if(summary.trunks.begin(), summary.trunks.end(),
                    [](const TrunkRecord &trunk) { return trunk.status == TrunkStatus::confirmed; }));
}

std::string viewText(const RunSummary &summary)
{
  const double view = 2 * std::atan2(0.5 * summary.camera.width, summary.camera.fx) * 180 / M_PI;
  const bool is_measured = summary.field_of_view_sigma_deg > 0;
  return fmt::format("field of view: {:.1f} degrees, {}", view,
                     !summary.is_camera_known ? "a guess"
                     : is_measured            ? fmt::format("measured +- {:.1f}", summary.field_of_view_sigma_deg)
                                              : "calibrated");
}

void addFacts(Verdict &verdict, const RunSummary &summary)
{
  const bool has_ranges = summary.reference.has_ranges;
  const std::size_t confirmed = confirmedIn(summary);
  if (goodFrames(summary) == 0) {
    verdict.facts.push_back(fmt::format("{:.1f} s; {}", summary.duration_s, framesText(summary)));
    return;
  }
  if (has_ranges)
    verdict.facts.push_back(fmt::format("path {} in {:.1f} s; {}", withUnit(summary.path_m, 2, "m"), summary.duration_s,
                                        framesText(summary)));
  else
    verdict.facts.push_back(fmt::format("{:.1f} s; {}", summary.duration_s, framesText(summary)));
  verdict.facts.push_back(describe(summary.reference) + "; " + viewText(summary));
  for (const CalibratedConstant &constant : summary.calibration)
    if (constant.used)
      verdict.facts.push_back(fmt::format("{}: measured and taken out", constant.text));
  if (has_ranges)
    verdict.facts.push_back(
        fmt::format("{} trunk{}, median sigma {} in place and {} in radius{}; {} other hypotheses", confirmed,
                    confirmed == 1 ? "" : "s", withUnit(medianOf(summary, &TrunkRecord::positionSigma), 3, "m"),
                    withUnit(medianOf(summary, &TrunkRecord::radiusSigma), 3, "m"),
                    summary.reference.scale_sigma > 0 ? " at this scale" : "", summary.trunks.size() - confirmed));
  else
    verdict.facts.push_back(
        fmt::format("{} bearing{} of what looks like trunks", confirmed, confirmed == 1 ? "" : "s"));
  verdict.facts.push_back(fmt::format("median {} a frame", withUnit(summary.timing.medianTotal_ms(), 1, "ms")));
}

/// Adds what makes the result worthless, and what would help.
void judgeMotion(Verdict &verdict, const RunSummary &summary)
{
  const auto distrust = [&verdict](std::string why) {
    verdict.is_trusted = false;
    verdict.doubts.push_back(std::move(why));
  };
  const bool has_moved = summary.reference.has_ranges && !(summary.extent_m < kAtRest_m);
  const bool has_rotated = summary.rotated_deg > kAtRest_deg;
  if (goodFrames(summary) == 0) {
    distrust("THE CAMERA SAW NOTHING: no frame could be used.");
    return;
  }
  if (!has_moved && !has_rotated)
    distrust("THE CAMERA NEVER MOVED: without motion there is no distance. Move it sideways by a tenth of the distance "
             "of the trunks.");
  else if (!has_moved)
    distrust(
        fmt::format("THE CAMERA ONLY ROTATED, by {:.0f} degrees: without translation there is no distance. Move it "
                    "sideways by a tenth of the distance of the trunks.",
                    summary.rotated_deg));
  else if (summary.trunks.empty())
    distrust("NOTHING WAS SEEN that looks like a trunk.");
  if (!summary.reference.has_ranges)
    verdict.doubts.push_back("No lengths are written: bearings.csv tells the bearing and the width of what was seen.");
}

void judgeReference(Verdict &verdict, const RunSummary &summary)
{
  if (summary.reference.scale == ScaleSource::prior && summary.reference.has_ranges)
    verdict.doubts.push_back(fmt::format(
        "The scale is a guess{}: --camera-height (over the ground) or --odometry would tell it.",
        summary.reference.scale_sigma > 0 ? fmt::format(" (+- {:.0f} %)", 100 * summary.reference.scale_sigma) : ""));
  if (!summary.is_camera_known)
    verdict.doubts.push_back(
        "The field of view is a guess: --camera (a calibration) or --field-of-view would tell it.");
  if (summary.reference.gravity == GravitySource::assumed)
    verdict.doubts.push_back("The first image is taken to be upright: nothing showed the direction of gravity.");
}
} // namespace

Verdict judge(const RunSummary &summary)
{
  Verdict verdict;
  addFacts(verdict, summary);
  if (!summary.is_complete)
    verdict.doubts.push_back("The run was interrupted: this is what was known by then.");
  judgeMotion(verdict, summary);
  if (goodFrames(summary) > 0)
    judgeReference(verdict, summary);
  for (const SensorVerdict &sensor : summary.sensors) {
    verdict.is_trusted = false;
    verdict.doubts.push_back(sensor.sensor == "images" || sensor.sensor == "accelerometer"
                                 ? sensor.text + "."
                                 : fmt::format("{}: --without {} would map without it.", sensor.text, sensor.sensor));
  }
  const auto figure = [&summary](const char *name) {
    const auto at = summary.figures.find(name);
    return at == summary.figures.end() ? 0 : at->second;
  };
  if (const double refused = figure("live_navdata_refused"); refused > figure("live_navdata"))
    verdict.doubts.push_back(
        fmt::format("Of {:.0f} packets of navdata {:.0f} were refused (wrong checksum, or cut): no "
                    "gyro or odometry by these.",
                    refused + figure("live_navdata"), refused));
  constexpr double kFew = 0.8;
  const double good = static_cast<double>(goodFrames(summary));
  if (good > 0 && good < kFew * static_cast<double>(framesIn(summary)))
    verdict.doubts.push_back(fmt::format("Many frames could not be used: {}.", framesText(summary)));
  if (verdict.is_trusted && confirmedIn(summary) == 0)
    verdict.doubts.push_back("No trunk was confirmed: hypotheses.csv tells why.");
  return verdict;
}

std::string toText(const Verdict &verdict)
{
  std::string text;
  for (const std::string &fact : verdict.facts)
    text += "  " + fact + "\n";
  if (!verdict.doubts.empty())
    text += verdict.is_trusted ? "Doubtful\n" : "NOT TO BE TRUSTED\n";
  for (const std::string &doubt : verdict.doubts)
    text += "  " + doubt + "\n";
  return text;
}
} // namespace bole
