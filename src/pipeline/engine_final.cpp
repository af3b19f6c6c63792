// SPDX-License-Identifier: GPL-2.0-or-later
// The last look at a flight: which hypotheses are trunks.
#include "pipeline/engine.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace bole
{
namespace
{
std::vector<int> idsOf(const std::vector<Judged> &judged, double least)
{
  std::vector<int> ids;
  for (const Judged &one : judged)
    if (one.log_odds >= least)
      ids.push_back(one.id);
  return ids;
}

Hypothesis hypothesisOf(const Judged &one) { return {one.id, one.trunk, one.online}; }

bool isOf(const Judged &one, const Hypothesis &hypothesis)
{
  return one.id == hypothesis.id && one.trunk.minus(hypothesis.trunk).isZero(0) && one.online == hypothesis.online;
}
} // namespace

Viewpoint Engine::viewpointOf(const KeptFrame &frame) const
{
  return {m_camera, cameraAt(frame.pose), true, m_motion->groundZ(), frame.time_s};
}

/// Those that are as they were \p before are not asked again.
std::vector<Judged> Engine::judgeAll(const std::vector<LevelView> &views, const std::vector<Judged> &before) const
{
  std::vector<Judged> all;
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.observations < kLeastViews || trunk.fate == TrunkFate::unranged)
      continue;
    const Hypothesis hypothesis{trunk.id, trunk.trunk, m_map.evidence(trunk)};
    const auto known =
        std::find_if(before.begin(), before.end(), [&](const Judged &one) { return isOf(one, hypothesis); });
    if (auto one = known != before.end() ? *known : judge(hypothesis, views, farthestJudged())) {
      one->first_seen_s = trunk.first_seen_s;
      one->last_seen_s = trunk.last_seen_s;
      all.push_back(*one);
    }
  }
  return all;
}

double Engine::farthestJudged() const
{
  constexpr double kFarthest_m = 14; // columns of what stands beyond are too few
  return kFarthest_m / m_metres;
}

/// Tracks hypotheses through all frames that were kept, from where each is thought to stand.
/// \p map: what may hide them.
std::vector<Adoption> Engine::followAll(const std::vector<Hypothesis> &hypotheses, const TrunkMap &map,
                                        AlbumGradients &gradients) const
{
  constexpr int kRounds = 2; // what the first finds tells the second where else to look
  std::vector<Adoption> found;
  for (const Hypothesis &one : hypotheses) {
    Adoption start;
    start.trunk.trunk = one.trunk;
    start.trunk.covariance = one.covariance;
    found.push_back(start);
  }
  for (int round = 0; round < kRounds; ++round) {
    std::vector<Follower> followers;
    for (const Adoption &one : found)
      followers.emplace_back(one.trunk.trunk, one.trunk.covariance);
    for (std::size_t f = 0; f < m_album.frames().size(); ++f) {
      const KeptFrame &frame = m_album.frames()[f];
      const Pose wMb = m_smoother.pose(frame.pose);
      const Viewpoint at = viewpointOf(frame);
      std::shared_ptr<const Gradient> gradient; // made where somebody asks for it
      for (std::size_t i = 0; i < followers.size(); ++i) {
        const Eigen::Vector3d to = found[i].trunk.trunk.axisAt(at.wMc.t.z()) - at.wMc.t;
        if (to.dot(at.wMc.R.col(2)) < 0 || to.head<2>().norm() > m_units.flow.track_range)
          continue;
        if (!gradient)
          gradient = gradients[f];
        followers[i].look(*gradient, frame.pose, wMb, at, map, hypotheses[i].id, m_units);
      }
    }
    for (std::size_t i = 0; i < followers.size(); ++i)
      if (Adoption next = followers[i].fitted(m_map.trunk(hypotheses[i].id).first_seen_s, m_camera, m_units);
          !next.views.empty())
        found[i] = std::move(next);
  }
  return found;
}

/// Tracks the likely ones anew and judges each where that puts it; what the smoother still holds keeps its views unless
/// the new ones are better.
std::vector<Engine::Reading> Engine::readAgain(const std::vector<Judged> &likely, const std::vector<LevelView> &views,
                                               AlbumGradients &gradients) const
{
  constexpr double kBetter = 0.3; // log-odds by which new views must be better than those at hand
  constexpr double kHides = 1.5;  // log-odds at which one may hide what stands behind it
  const TrunkMap map = m_map.withTrunks(idsOf(likely, kHides));
  const auto read = [&](const std::vector<Hypothesis> &hypotheses) {
    std::vector<Reading> readings;
    std::vector<Adoption> followed = followAll(hypotheses, map, gradients);
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
      const auto refit =
          judge({hypotheses[i].id, followed[i].trunk.trunk, hypotheses[i].online}, views, farthestJudged());
      Reading reading;
      reading.is_seen = !followed[i].views.empty();
      if (refit && followed[i].views.size() >= kLeastViews) {
        reading.judged = *refit;
        reading.judged->first_seen_s = followed[i].trunk.views.front().time_s;
        reading.judged->last_seen_s = followed[i].trunk.views.back().time_s;
        reading.views = std::move(followed[i]);
      }
      readings.push_back(std::move(reading));
    }
    return readings;
  };
  std::vector<Hypothesis> hypotheses;
  for (const Judged &one : likely)
    hypotheses.push_back(hypothesisOf(one));
  std::vector<Reading> readings = read(hypotheses);
  for (std::size_t i = 0; i < likely.size(); ++i) {
    Reading &reading = readings[i];
    const MapTrunk &known = m_map.trunk(likely[i].id);
    const bool is_held = !known.removed && reading.is_seen && isPlaced(known.place_covariance);
    if (is_held && (!reading.views || reading.judged->log_odds <= likely[i].log_odds + kBetter)) {
      reading.judged = likely[i];
      reading.views.reset();
    }
  }
  /// Reads each again where \p guess_of puts it, and keeps what \p is_better.
  const auto challenge = [&](const auto &guess_of, const auto &is_better) {
    std::vector<Hypothesis> guesses;
    std::vector<std::size_t> of;
    for (std::size_t i = 0; i < readings.size(); ++i)
      if (readings[i].judged)
        if (const auto guess = guess_of(hypothesisOf(*readings[i].judged))) {
          guesses.push_back(*guess);
          of.push_back(i);
        }
    std::vector<Reading> others = read(guesses);
    for (std::size_t k = 0; k < others.size(); ++k)
      if (others[k].views && is_better(k, *others[k].judged, *readings[of[k]].judged))
        readings[of[k]] = std::move(others[k]);
  };
  const double thickest = m_units.detection.radius_max;
  // one border may be the edge of a shadow on the bark, or of something behind
  std::vector<BorderDoubt> doubts;
  challenge(
      [&](const Hypothesis &reading) -> std::optional<Hypothesis> {
        const auto doubt = doubtBorders(reading, views, farthestJudged(), thickest);
        if (!doubt)
          return std::nullopt;
        doubts.push_back(*doubt);
        return doubt->guess;
      },
      [&](std::size_t k, const Judged &other, const Judged &reading) {
        return isSilhouetteOf(other, reading, doubts[k], views, farthestJudged());
      });
  // lines that are not the same in all frames put a trunk nearer or farther than its bark says
  challenge([&](const Hypothesis &reading) { return nearerOrFarther(reading, views, farthestJudged(), thickest); },
            [](std::size_t, const Judged &other, const Judged &reading) { return other.log_odds > reading.log_odds; });
  return readings;
}

/// The last word on where the trunks stand. It moves no pose: columns and borders share the path by which both are
/// measured.
void Engine::placeByColumns()
{
  const std::vector<LevelView> views = levelViews(m_album.frames());
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.removed)
      continue;
    TrunkEstimate estimate = endedByDepth({trunk.id, trunk.trunk, trunk.covariance}, views, farthestJudged());
    estimate.trunk = placedByBark(estimate.trunk, views, farthestJudged());
    estimate.place_covariance =
        trunk.place_covariance + (*estimate.covariance - trunk.covariance).topLeftCorner<2, 2>();
    m_map.refresh(estimate);
  }
}

/// Whether a place is known as well as is asked for, from where it was seen.
bool Engine::isPlaced(const Eigen::Matrix2d &covariance) const
{
  const double most = m_units.map.most_place_sigma;
  return most == 0 || covariance.trace() <= most * most;
}

/// Every hypothesis in the light of all frames.
void Engine::decideByAllFrames()
{
  constexpr double kLikely = -1.5; // log-odds at which a hypothesis is tracked again
  constexpr double kHides = 0.5;   // log-odds at which one hides what leans behind it
  const std::vector<LevelView> views = levelViews(m_album.frames());
  const std::vector<Judged> before = judgeAll(views);
  AlbumGradients gradients(m_album.frames(), m_units.gradient);
  detectLeaning(m_map.withTrunks(idsOf(before, kHides)), gradients);
  const double apart = m_units.map.merge_distance;
  m_judged = judgeAll(views, before);
  std::vector<Reading> readings =
      readAgain(chooseSet(m_judged, kLikely, apart, views, farthestJudged()), views, gradients);
  std::vector<Judged> again;
  for (const Reading &reading : readings) // one that is not placed would keep another of the same lines away
    if (reading.judged && isPlaced(reading.views ? reading.views->trunk.covariance.topLeftCorner<2, 2>()
                                                 : m_map.trunk(reading.judged->id).place_covariance))
      again.push_back(*reading.judged);
  const std::vector<Judged> chosen = chooseSet(again, m_units.map.confirm_odds, apart, views, farthestJudged());
  std::map<int, TrunkDecision> decisions;
  for (const Judged &one : m_judged)
    decisions[one.id] = {one.id, one.log_odds, false, std::nullopt};
  for (const Judged &one : chosen)
    decisions[one.id] = {one.id, one.log_odds, true, std::nullopt};
  for (Reading &reading : readings) {
    if (!reading.judged || !reading.views || !decisions[reading.judged->id].is_trunk)
      continue;
    decisions[reading.judged->id].found = hold(*reading.views);
  }
  std::vector<TrunkDecision> list;
  for (auto &[id, decision] : decisions)
    list.push_back(std::move(decision));
  for (const std::size_t gone : m_map.decide(list))
    m_smoother.removeTrunk(gone);
  m_smoother.optimize(kSettled);
  refreshWholeMap();
  placeByColumns();
}
} // namespace bole
