// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/trials/failure_sheet.h"

#include "lab/trials/error_curves.h"
#include "output/palette.h"
#include "output/svg.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr int kHolds = 5;                 ///< frames for which they must have parted
constexpr double kStandsNear = 0.6;       ///< a trunk of the map this near to a true one is that one [m]
constexpr double kMisplaced = 0.3;        ///< [m]
constexpr double kBelievedRange = 4;      ///< [m]
constexpr double kUnknownRange = 2;       ///< [m]
constexpr double kInImage = 0.61;         ///< from straight ahead [rad]
constexpr double kShown = 7, kScale = 45; ///< of the map round the drone [m], [px/m]

double allowed(const std::string &name)
{
  if (name.find("[deg]") != std::string::npos)
    return 0.5;
  return name.find("[%]") != std::string::npos ? 3 : 0.3;
}

/// Axis of a believed trunk where it would stand if the drone were where it believes to be.
Eigen::Vector2d trulyAt(const LoopSample &sample, const KnownTrunk &trunk)
{
  const Eigen::Vector3d at = trunk.trunk.axisAt(sample.estimate.t.z());
  return (sample.truth * (sample.estimate.inverse() * at)).head<2>();
}

Eigen::Vector2d axisOf(const SimulatedTrunk &trunk, const LoopSample &sample)
{
  return trunk.axisAt(sample.truth.t.z() - trunk.foot.z()).head<2>();
}

std::string wrongError(const LoopSample &sample)
{
  for (const auto &[name, believed] : sample.believed)
    for (const auto &[other, real] : sample.real)
      if (name == other && std::abs(believed - real) > allowed(name))
        return fmt::format("{}: believed {:.2f}, is {:.2f}", name, believed, real);
  return {};
}

std::string wrongTrunk(const LoopSample &sample, const std::vector<SimulatedTrunk> &trunks)
{
  for (const KnownTrunk &trunk : sample.map) {
    const Eigen::Vector2d at = trulyAt(sample, trunk);
    if (trunk.status != TrunkStatus::confirmed || (at - sample.truth.t.head<2>()).norm() > kBelievedRange)
      continue;
    double off = 1e9;
    for (const SimulatedTrunk &other : trunks)
      off = std::min(off, (axisOf(other, sample) - at).norm());
    if (off > kStandsNear)
      return fmt::format("trunk {} of the map stands where none is within {:.1f} m", trunk.id, std::min(off, 99.0));
    if (off > kMisplaced)
      return fmt::format("trunk {} of the map is {:.2f} m off", trunk.id, off);
  }
  return {};
}

std::string unknownTrunk(const LoopSample &sample, const std::vector<SimulatedTrunk> &trunks)
{
  for (const SimulatedTrunk &trunk : trunks) {
    const Eigen::Vector2d at = axisOf(trunk, sample);
    const Eigen::Vector3d seen = sample.truth.inverse() * Eigen::Vector3d(at.x(), at.y(), sample.truth.t.z());
    if (seen.head<2>().norm() > kUnknownRange || std::abs(std::atan2(seen.y(), seen.x())) > kInImage)
      continue;
    const bool is_known = std::any_of(sample.map.begin(), sample.map.end(), [&](const KnownTrunk &known) {
      return (trulyAt(sample, known) - at).norm() < kStandsNear;
    });
    if (!is_known)
      return fmt::format("the map does not hold the trunk {:.1f} m ahead", seen.head<2>().norm());
  }
  return {};
}

/// x ahead of the drone is up.
class MapDrawing
{
public:
  explicit MapDrawing(const LoopSample &sample) : m_bTw(sample.truth.inverse()), m_drawing(kSide, kSide) {}
  std::pair<double, double> at(const Eigen::Vector2d &p) const
  {
    const Eigen::Vector3d q = m_bTw * Eigen::Vector3d(p.x(), p.y(), m_bTw.inverse().t.z());
    return {0.5 * kSide - kScale * q.y(), 0.5 * kSide - kScale * q.x()};
  }
  void trunk(const Eigen::Vector2d &p, double radius, const char *fill, const std::string &style)
  {
    const auto [x, y] = at(p);
    if (std::abs(x - 0.5 * kSide) < 0.5 * kSide && std::abs(y - 0.5 * kSide) < 0.5 * kSide)
      m_drawing.circle(x, y, kScale * radius, fill, style);
  }
  void path(const SvgPoints &places, const char *colour) { m_drawing.polyline(places, colour); }
  void text(double y, const std::string &text) { m_drawing.text(8, y, text); }
  std::string finish() const { return m_drawing.finish(); }

private:
  static constexpr double kSide = 2 * kShown * kScale;
  Pose m_bTw;
  SvgDrawing m_drawing;
};

std::string mapOf(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, std::size_t k)
{
  const LoopSample &now = record.samples[k];
  MapDrawing drawing(now);
  for (const SimulatedTrunk &trunk : trunks)
    drawing.trunk(axisOf(trunk, now), trunk.radiusAt(now.truth.t.z() - trunk.foot.z()), palette::kGrey, "");
  for (const KnownTrunk &trunk : now.map)
    drawing.trunk(trulyAt(now, trunk), trunk.trunk.radius(), "none",
                  fmt::format("stroke=\"{}\" stroke-width=\"2\"",
                              trunk.status == TrunkStatus::confirmed ? palette::kBlue : palette::kSkyBlue));
  SvgPoints flown;
  for (const LoopSample &sample : record.samples)
    if ((sample.truth.t - now.truth.t).head<2>().norm() < kShown)
      flown.push_back(drawing.at(sample.truth.t.head<2>()));
  drawing.path(flown, palette::kVermilion);
  drawing.trunk(now.truth.t.head<2>(), 0.28, palette::kVermilion, "fill-opacity=\".4\"");
  drawing.text(16, "grey: bark; blue: believed, pale: candidates; red: flown; ahead is up");
  return drawing.finish();
}
} // namespace

std::optional<Parting> findParting(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks)
{
  std::string first;
  int held = 0;
  for (std::size_t k = 0; k < record.samples.size(); ++k) {
    const LoopSample &sample = record.samples[k];
    std::string what;
    if (sample.phase == TaskPhase::servoing) {
      what = wrongError(sample);
      what = what.empty() ? wrongTrunk(sample, trunks) : what;
      what = what.empty() ? unknownTrunk(sample, trunks) : what;
    }
    held = what.empty() ? 0 : held + 1;
    first = held == 1 ? what : first;
    if (held == kHolds)
      return Parting{k + 1 - kHolds, first};
  }
  return std::nullopt;
}

std::string failureSheet(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, const std::string &title,
                         const std::optional<Parting> &parting, const std::string &picture)
{
  std::string html = fmt::format("<!DOCTYPE html>\n<html><head><meta charset=\"utf-8\"><title>{0}</title></head>\n"
                                 "<body><h1>{0}</h1>\n",
                                 escaped(title));
  if (record.samples.empty())
    return html + "<p>No frame came.</p></body></html>\n";
  const LoopSample &end = record.samples.back();
  if (parting)
    html += fmt::format("<p>Belief and truth parted at {:.1f} s: {}.</p>\n", record.samples[parting->sample].time_s,
                        escaped(parting->what));
  else
    html += "<p>Belief and truth did not part while it servoed: what failed is control, or the task's patience.</p>\n";
  html += fmt::format("<p>It ended at {:.1f} s ({}): {}; {:.2f} m from the nearest bark at the least.</p>\n",
                      end.time_s, toString(end.phase), escaped(end.reason), end.clearance);
  for (const SensorVerdict &verdict : record.verdicts)
    html += fmt::format("<p>{}.</p>\n", escaped(verdict.text));
  if (!picture.empty())
    html += fmt::format("<p><img src=\"{}\" alt=\"the frame of the parting\"></p>\n", escaped(picture));
  const std::size_t shown = parting ? parting->sample : record.samples.size() - 1;
  html += fmt::format("<h2>At {:.1f} s</h2>\n", record.samples[shown].time_s) + mapOf(record, trunks, shown);
  if (parting)
    html += "<h2>At the end</h2>\n" + mapOf(record, trunks, record.samples.size() - 1);
  return html + "<h2>Errors</h2>\n" + errorCurves(record, title) + "</body></html>\n";
}
} // namespace bole
