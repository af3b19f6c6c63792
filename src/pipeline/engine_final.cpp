// SPDX-License-Identifier: GPL-2.0-or-later
// The end of a flight.
#include "pipeline/engine.h"

#include <algorithm>
#include <cmath>

namespace bole
{
/// A trunk that was given up stands where it did relative to the camera that saw it last.
Trunk Engine::carried(const MapTrunk &trunk) const
{
  if (!trunk.removed)
    return trunk.trunk;
  const auto after = std::upper_bound(
      m_online.begin(), m_online.end(), trunk.last_seen_s + 1e-6,
      [](double time_s, const StampedPose &pose) { return time_s < 1e-9 * static_cast<double>(pose.stamp_ns); });
  const auto i = static_cast<std::size_t>(std::max<std::ptrdiff_t>(0, after - m_online.begin() - 1));
  const Pose moved = m_smoother.pose(i) * m_online[i].wMb.inverse();
  Trunk there = trunk.trunk;
  const double z = m_online[i].wMb.t.z();
  there.xy = (moved * trunk.trunk.axisAt(z)).head<2>() - z * there.lean;
  return there;
}

std::vector<Hypothesis> Engine::hypotheses() const
{
  std::vector<Hypothesis> all;
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.fate == TrunkFate::unranged || trunk.fate == TrunkFate::duplicate)
      continue;
    Hypothesis one;
    one.id = trunk.id;
    one.trunk = carried(trunk);
    all.push_back(one);
  }
  return all;
}

/// By all frames of the flight, twice: what is chosen is measured anew in every frame, and where it stands then it is
/// judged once more. At first a trunk may be some way off its place, which costs it half of what speaks for it.
void Engine::decideByAllFrames()
{
  constexpr double kOffPlace = 1.5; // log-odds
  const Viewpoint view{m_camera, cameraAt(newest()), true, m_motion->groundZ(),
                       1e-9 * static_cast<double>(m_online.back().stamp_ns)};
  for (const Trunk &found : detectAgain(m_kept, m_smoother, view, m_units)) {
    NewTrunk trunk;
    trunk.trunk = found;
    trunk.found_s = view.time_s;
    trunk.smoother_id = m_smoother.addTrunk(found, priorOf(found, m_units.smoothing));
    m_map.add(trunk);
  }
  const std::vector<EvidenceView> views = lookBack(m_kept, m_smoother, view, m_units, m_metres);
  const double least = m_units.map.confirm_evidence;
  std::vector<Hypothesis> candidates = hypotheses();
  for (const double still_off : {kOffPlace, 0.0}) {
    judge(candidates, views, view, m_units, m_metres);
    const std::vector<Hypothesis> chosen = choose(candidates, least - still_off, m_units);
    const std::vector<Adoption> measured = measure(chosen, m_kept, m_smoother, view, m_units);
    for (const Hypothesis &one : candidates)
      giveUp(one, one.log_odds >= least - still_off ? TrunkFate::outdone : TrunkFate::doubted);
    candidates.clear();
    for (std::size_t i = 0; i < chosen.size(); ++i)
      if (measured[i].views.size() >= static_cast<std::size_t>(m_units.map.confirm_observations))
        candidates.push_back(takeIn(chosen[i], measured[i]));
    m_smoother.optimize(kSettled);
    refreshWholeMap();
    for (Hypothesis &one : candidates)
      one.trunk = m_map.trunk(one.id).trunk;
  }
  const auto isVague = [&](const Hypothesis &one) {
    return m_map.trunk(one.id).positionSigma() > m_units.map.confirm_position_sigma;
  };
  if (std::none_of(candidates.begin(), candidates.end(), isVague))
    return;
  for (const Hypothesis &one : candidates)
    if (isVague(one))
      giveUp(one, TrunkFate::undecided);
  m_smoother.optimize(kSettled);
  refreshWholeMap();
}

void Engine::giveUp(const Hypothesis &one, TrunkFate fate)
{
  if (!m_map.trunk(one.id).removed)
    m_smoother.removeTrunk(m_map.trunk(one.id).smoother_id);
  m_map.refresh({one.id, one.trunk, std::nullopt});
  m_map.reject(one.id, fate, one.log_odds);
}

Hypothesis Engine::takeIn(const Hypothesis &one, Adoption measured)
{
  const Trunk &trunk = measured.trunk.trunk;
  measured.trunk.smoother_id = m_smoother.addTrunk(trunk, priorOf(trunk, m_units.smoothing));
  for (const AdoptedView &seen : measured.views)
    m_smoother.addObservation(seen.pose, measured.trunk.smoother_id, seen.summary);
  m_map.accept(one.id, measured.trunk, one.log_odds);
  return one;
}
} // namespace bole
