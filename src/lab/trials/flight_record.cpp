// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/closed_loop.h"

#include "support/text.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

namespace bole
{
namespace
{
using Json = nlohmann::ordered_json;

constexpr int kHolds = 5;            ///< frames for which they must have parted
constexpr double kStandsNear = 0.6;  ///< a trunk of the map this near to a true one is that one [m]
constexpr double kMisplaced = 0.3;   ///< [m]
constexpr double kBelievedRange = 4; ///< [m]
constexpr double kUnknownRange = 2;  ///< [m]
constexpr double kInImage = 0.61;    ///< from straight ahead [rad]

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

/// One frame seen from above, in the world of the truth [m].
Json mapOf(const LoopSample &now, const std::vector<SimulatedTrunk> &trunks)
{
  constexpr double kShown = 7; // round the drone [m]
  const Eigen::Vector2d drone = now.truth.t.head<2>();
  const Eigen::Vector3d ahead = now.truth.R.col(0);
  Json json = {{"time_s", now.time_s},
               {"drone", {drone.x(), drone.y(), std::atan2(ahead.y(), ahead.x())}},
               {"trunks", Json::array()},
               {"believed", Json::array()}};
  for (const SimulatedTrunk &trunk : trunks)
    if (const Eigen::Vector2d at = axisOf(trunk, now); (at - drone).norm() < kShown)
      json["trunks"].push_back({at.x(), at.y(), trunk.radiusAt(now.truth.t.z() - trunk.foot.z())});
  for (const KnownTrunk &trunk : now.map)
    if (const Eigen::Vector2d at = trulyAt(now, trunk); (at - drone).norm() < kShown)
      json["believed"].push_back({at.x(), at.y(), trunk.trunk.radius(), trunk.status == TrunkStatus::confirmed});
  return json;
}

std::vector<std::string> namesIn(const LoopRecord &record)
{
  std::vector<std::string> names;
  const auto take = [&names](const ServoTask::Values &values) {
    for (const auto &value : values)
      if (std::find(names.begin(), names.end(), value.first) == names.end())
        names.push_back(value.first);
  };
  for (const LoopSample &sample : record.samples) {
    take(sample.believed);
    take(sample.real);
  }
  return names;
}
} // namespace

std::string samplesCsv(const LoopRecord &record)
{
  const std::vector<std::string> names = namesIn(record);
  std::string text =
      "time [s],phase,lost,hovering,frame,true x [m],true y [m],true z [m],x [m],y [m],z [m],vx [m/s],vy [m/s],"
      "wz [rad/s],speed [m/s],least clearance [m],loop [ms]";
  for (const std::string &name : names)
    text += ",believed " + name + ",true " + name;
  text += ",what it does\n";
  const auto value = [](const ServoTask::Values &values, const std::string &name) {
    for (const auto &[key, number] : values)
      if (key == name)
        return fmt::format("{:.4f}", number);
    return std::string();
  };
  for (const LoopSample &s : record.samples) {
    text += fmt::format(
        "{:.2f},{},{:d},{:d},{},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.3f},{:.2f}",
        s.time_s, toString(s.phase), s.is_lost, s.is_hovering, toString(s.frame_status), s.truth.t.x(), s.truth.t.y(),
        s.truth.t.z(), s.estimate.t.x(), s.estimate.t.y(), s.estimate.t.z(), s.command(0), s.command(1), s.command(3),
        s.speed, s.clearance, s.loop_ms);
    for (const std::string &name : names)
      text += "," + value(s.believed, name) + "," + value(s.real, name);
    text += "," + csvField(s.reason) + "\n";
  }
  return text;
}
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

std::string failureJson(const LoopRecord &record, const std::vector<SimulatedTrunk> &trunks, const std::string &title,
                        const std::optional<Parting> &parting)
{
  Json json = {{"title", title}, {"sensors", Json::array()}, {"maps", Json::array()}};
  for (const SensorVerdict &verdict : record.verdicts)
    json["sensors"].push_back(verdict.text);
  if (parting)
    json["parting"] = {{"time_s", record.samples[parting->sample].time_s}, {"what", parting->what}};
  if (parting)
    json["maps"].push_back(mapOf(record.samples[parting->sample], trunks));
  if (!record.samples.empty()) {
    const LoopSample &end = record.samples.back();
    json["end"] = {
        {"time_s", end.time_s}, {"phase", toString(end.phase)}, {"reason", end.reason}, {"clearance_m", end.clearance}};
    json["maps"].push_back(mapOf(end, trunks));
  }
  return json.dump(1) + "\n";
}
} // namespace bole
