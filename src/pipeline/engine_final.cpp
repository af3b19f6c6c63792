// SPDX-License-Identifier: GPL-2.0-or-later
// The last look at a flight: which hypotheses are trunks.
#include "pipeline/engine.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <set>

namespace bole
{
namespace
{
constexpr int kLeastViews = 4; ///< of a hypothesis that is judged
}

std::vector<LevelView> Engine::levelViews() const
{
  std::vector<LevelView> views;
  for (const KeptFrame &frame : m_album.frames())
    views.emplace_back(frame.level, cameraAt(frame.pose));
  return views;
}

/// Tracks \p chosen through all frames that were kept, from where each is thought to stand.
std::vector<Adoption> Engine::followAll(const std::vector<Judged> &chosen) const
{
  constexpr int kRounds = 2; // what the first finds tells the second where else to look
  std::vector<Adoption> found;
  for (const Judged &one : chosen) {
    Adoption start;
    start.trunk.trunk = one.trunk;
    start.trunk.covariance.setZero();
    found.push_back(start);
  }
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Follower> followers;
    for (const Adoption &one : found)
      followers.emplace_back(one.trunk.trunk, one.trunk.covariance);
    for (const KeptFrame &frame : m_album.frames()) {
      const Gradient gradient = computeGradient(frame.image, m_units.gradient);
      const Pose wMb = m_smoother.pose(frame.pose);
      const Viewpoint at{m_camera, wMb * m_bMc, true, m_motion->groundZ(), frame.time_s};
      for (std::size_t i = 0; i < followers.size(); ++i)
        if ((found[i].trunk.trunk.axisAt(at.wMc.t.z()) - at.wMc.t).head<2>().norm() < m_units.flow.track_range)
          followers[i].look(gradient, frame.pose, wMb, at, m_map, chosen[i].id, m_units);
    }
    for (std::size_t i = 0; i < followers.size(); ++i) {
      Adoption next = followers[i].fitted(m_map.trunk(chosen[i].id).first_seen_s, m_camera, m_units);
      if (!next.views.empty())
        found[i] = std::move(next);
    }
  }
  return found;
}

/// Every hypothesis in the light of all frames. The likely ones are tracked anew, and judged where that puts them; what
/// the smoother still holds keeps its views unless the new ones are better.
void Engine::decideByAllFrames()
{
  constexpr double kLikely = -1.5;    // log-odds at which a hypothesis is tracked again
  constexpr double kBetter = 0.3;     // log-odds by which new views must be better than those at hand
  constexpr double kFarthest_m = 14;  // columns of what stands beyond are too few
  const std::vector<LevelView> views = levelViews();
  const double farthest = kFarthest_m / m_metres, apart = m_units.map.merge_distance;
  const auto judged = [&](const MapTrunk &trunk, const Trunk &place) {
    return judge(trunk.id, place, m_map.evidence(trunk), views, farthest);
  };
  std::vector<Judged> all;
  for (const MapTrunk &trunk : m_map.trunks())
    if (trunk.observations >= kLeastViews && trunk.fate != TrunkFate::unranged)
      if (const auto one = judged(trunk, trunk.trunk))
        all.push_back(*one);
  const std::vector<Judged> likely = chooseSet(all, kLikely, apart, views, farthest);
  const std::vector<Adoption> followed = followAll(likely);
  std::vector<Judged> again;
  std::map<int, const Adoption *> anew;
  for (std::size_t i = 0; i < likely.size(); ++i) {
    const MapTrunk &trunk = m_map.trunk(likely[i].id);
    const auto refit = judged(trunk, followed[i].trunk.trunk);
    const bool is_seen = refit && followed[i].views.size() >= kLeastViews;
    if (is_seen && (trunk.removed || refit->log_odds > likely[i].log_odds + kBetter)) {
      again.push_back(*refit);
      anew[trunk.id] = &followed[i];
    }
    else if (!trunk.removed)
      again.push_back(likely[i]);
    if (std::getenv("BOLE_FINAL"))
      std::fprintf(stderr, "F %d %.3f %.3f r %.3f odds %.2f -> %.3f %.3f r %.3f odds %.2f views %zu was %s%s\n", likely[i].id,
                   likely[i].trunk.xy.x(), likely[i].trunk.xy.y(), likely[i].trunk.radius(), likely[i].log_odds,
                   followed[i].trunk.trunk.xy.x(), followed[i].trunk.trunk.xy.y(), followed[i].trunk.trunk.radius(),
                   refit ? refit->log_odds : -99., followed[i].views.size(), toString(m_map.trunk(likely[i].id).status), trunk.removed?" removed":"");
  }
  const std::vector<Judged> chosen = chooseSet(again, m_units.map.confirm_evidence, apart, views, farthest);
  std::vector<TrunkDecision> decisions;
  for (const Judged &one : all)
    decisions.push_back({one.id, one.log_odds, false, std::nullopt});
  std::set<int> stays;
  for (const Judged &one : chosen) {
    const auto found = anew.find(one.id);
    if (found == anew.end()) {
      stays.insert(one.id);
      decisions.push_back({one.id, one.log_odds, true, std::nullopt});
      continue;
    }
    NewTrunk trunk = found->second->trunk;
    trunk.smoother_id = m_smoother.addTrunk(one.trunk, priorOf(one.trunk, m_units.smoothing));
    for (const AdoptedView &view : found->second->views)
      m_smoother.addObservation(view.pose, trunk.smoother_id, view.summary);
    decisions.push_back({one.id, one.log_odds, true, trunk});
  }
  for (const MapTrunk &trunk : m_map.trunks())
    if (!trunk.removed && stays.count(trunk.id) == 0)
      m_smoother.removeTrunk(trunk.smoother_id);
  m_map.decide(decisions);
}
} // namespace bole
