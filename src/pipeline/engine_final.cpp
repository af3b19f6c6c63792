// SPDX-License-Identifier: GPL-2.0-or-later
// The final pass over the keyframes of a flight: which hypotheses are trunks.
#include "pipeline/engine.h"

#include "detection/border_continuity.h"
#include "geometry/silhouette.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace bole
{
namespace
{
std::vector<int> idsOf(const std::vector<ScoredHypothesis> &scored, double least)
{
  std::vector<int> ids;
  for (const ScoredHypothesis &one : scored)
    if (one.log_odds >= least)
      ids.push_back(one.id);
  return ids;
}

Hypothesis hypothesisOf(const ScoredHypothesis &one) { return {one.id, one.trunk, one.online, one.points_beside}; }

bool isOf(const ScoredHypothesis &one, const Hypothesis &hypothesis)
{
  return one.id == hypothesis.id && one.trunk.minus(hypothesis.trunk).isZero(0) && one.online == hypothesis.online &&
         one.points_beside == hypothesis.points_beside;
}
} // namespace

Viewpoint Engine::viewpointOf(std::size_t pose, double time_s) const
{
  return {m_camera, cameraAt(pose), m_motion->hasRanges(), m_ground[pose], time_s};
}

/// How far what the keyframes show goes on across both borders of a hypothesis while it was seen: the mean correlation
/// over its nearest views, nothing where too few show it.
std::optional<double> Engine::continuity(const ScoredHypothesis &one) const
{
  constexpr std::size_t kNearest = 16, kLeast = 4;     // views; of them those that tell
  std::vector<std::pair<double, std::size_t>> nearest; // range, number of the keyframe
  for (std::size_t i = 0; i < m_keyframes.frames().size(); ++i)
    if (const Keyframe &frame = m_keyframes.frames()[i];
        frame.time_s >= one.first_seen_s && frame.time_s <= one.last_seen_s)
      nearest.emplace_back(horizontalView(cameraAt(frame.pose), one.trunk).range, i);
  std::sort(nearest.begin(), nearest.end());
  nearest.resize(std::min(nearest.size(), kNearest));
  double sum = 0;
  std::size_t count = 0;
  for (const auto &[range, i] : nearest) {
    const Keyframe &frame = m_keyframes.frames()[i];
    const Viewpoint at = viewpointOf(frame.pose, frame.time_s);
    const RelativeTrunk relative = relativeTrunk(at.wMc, Pose(), one.trunk);
    if (!relative.isFinite())
      continue;
    if (const auto across =
            continuityOf(frame.image, m_camera, relative, textureRange(relative, one.trunk, at, m_units))) {
      sum += *across;
      ++count;
    }
  }
  return count >= kLeast ? std::optional(sum / static_cast<double>(count)) : std::nullopt;
}

/// Scores \p hypothesis, which was seen from \p first_s to \p last_s, against chance, and, where it is worth the work,
/// against a strip of a surface.
std::optional<ScoredHypothesis> Engine::score(const Hypothesis &hypothesis, double first_s, double last_s,
                                              const std::vector<ColumnView> &views) const
{
  auto scored = scoreHypothesis(hypothesis, views, farthestScored());
  if (!scored)
    return scored;
  scored->first_seen_s = first_s;
  scored->last_seen_s = last_s;
  if (scored->log_odds > kMayBeTrunk)
    weighAgainstSurface(*scored, views, farthestScored(), continuity(*scored));
  return scored;
}

/// Scores all hypotheses of the map. One that has not changed since \p before keeps its score from there.
std::vector<ScoredHypothesis> Engine::scoreAll(const std::vector<ColumnView> &views,
                                               const std::vector<ScoredHypothesis> &before) const
{
  std::vector<ScoredHypothesis> all;
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.observations < kLeastViews || trunk.reject_reason == RejectReason::unranged)
      continue;
    const Hypothesis hypothesis{trunk.id, trunk.trunk, m_map.evidence(trunk), trunk.pointsBeside()};
    const auto known =
        std::find_if(before.begin(), before.end(), [&](const ScoredHypothesis &one) { return isOf(one, hypothesis); });
    if (const auto one =
            known != before.end() ? *known : score(hypothesis, trunk.first_seen_s, trunk.last_seen_s, views))
      all.push_back(*one);
  }
  return all;
}

double Engine::farthestScored() const
{
  constexpr double kFarthest_m = 14; // a trunk beyond it fills too few columns
  return kFarthest_m / m_metres;
}

/// Tracks hypotheses through all keyframes, each from its present estimate.
/// \p map: the trunks that may occlude them.
std::vector<CandidateTrack> Engine::trackThroughKeyframes(const std::vector<Hypothesis> &hypotheses,
                                                          const TrunkMap &map, KeyframeGradients &gradients) const
{
  constexpr int kRounds = 2; // the second starts from the fit of the first and finds borders that the first missed
  std::vector<CandidateTrack> found;
  for (const Hypothesis &one : hypotheses) {
    CandidateTrack start;
    start.trunk.trunk = one.trunk;
    start.trunk.covariance = one.covariance;
    found.push_back(start);
  }
  for (int round = 0; round < kRounds; ++round) {
    std::vector<CandidateTracker> trackers;
    for (const CandidateTrack &one : found)
      trackers.emplace_back(one.trunk.trunk, one.trunk.covariance);
    for (std::size_t f = 0; f < m_keyframes.frames().size(); ++f) {
      const Keyframe &frame = m_keyframes.frames()[f];
      const Pose wMb = m_smoother.pose(frame.pose);
      const Viewpoint at = viewpointOf(frame.pose, frame.time_s);
      std::shared_ptr<const Gradient> gradient; // computed when the first hypothesis needs it
      for (std::size_t i = 0; i < trackers.size(); ++i) {
        const Eigen::Vector3d to = found[i].trunk.trunk.axisAt(at.wMc.t.z()) - at.wMc.t;
        if (to.dot(at.wMc.R.col(2)) < 0 || to.head<2>().norm() > m_units.flow.track_range)
          continue;
        if (!gradient)
          gradient = gradients[f];
        trackers[i].track(*gradient, frame.pose, wMb, at, map, hypotheses[i].id, m_units);
      }
    }
    for (std::size_t i = 0; i < trackers.size(); ++i)
      if (CandidateTrack next = trackers[i].fit(m_map.trunk(hypotheses[i].id).first_seen_s, m_camera, m_units);
          !next.views.empty())
        found[i] = std::move(next);
  }
  return found;
}

/// Tracks \p likely hypotheses again through all keyframes, where the surest of the \p best may occlude them, and
/// scores each where that puts it. A trunk that is still in the smoother keeps its views there unless the new ones
/// score better.
std::vector<Engine::RetrackedHypothesis> Engine::retrack(const std::vector<ScoredHypothesis> &likely,
                                                         const std::vector<ScoredHypothesis> &best,
                                                         const std::vector<ColumnView> &views,
                                                         KeyframeGradients &gradients) const
{
  constexpr double kBetter = 0.3; // log-odds by which new views must score better than those in the smoother
  constexpr double kHides = 1.5;  // log-odds above which a hypothesis may occlude what stands behind it
  const TrunkMap map = m_map.withTrunks(idsOf(best, kHides));
  const auto read = [&](const std::vector<Hypothesis> &hypotheses) {
    std::vector<RetrackedHypothesis> results;
    std::vector<CandidateTrack> followed = trackThroughKeyframes(hypotheses, map, gradients);
    for (std::size_t i = 0; i < hypotheses.size(); ++i) {
      RetrackedHypothesis result;
      result.id = hypotheses[i].id;
      result.is_seen = !followed[i].views.empty();
      const NewTrunk &trunk = followed[i].trunk;
      if (followed[i].views.size() >= kLeastViews)
        result.scored = score({hypotheses[i].id, trunk.trunk, hypotheses[i].online, hypotheses[i].points_beside},
                              trunk.views.front().time_s, trunk.views.back().time_s, views);
      if (result.scored)
        result.views = std::move(followed[i]);
      results.push_back(std::move(result));
    }
    return results;
  };
  std::vector<Hypothesis> hypotheses;
  for (const ScoredHypothesis &one : likely)
    hypotheses.push_back(hypothesisOf(one));
  std::vector<RetrackedHypothesis> results = read(hypotheses);
  for (std::size_t i = 0; i < likely.size(); ++i) {
    RetrackedHypothesis &result = results[i];
    const MapTrunk &known = m_map.trunk(likely[i].id);
    const bool is_held = !known.removed && result.is_seen && isPlaced(known.place_covariance);
    if (is_held && (!result.views || result.scored->log_odds <= likely[i].log_odds + kBetter)) {
      result.scored = likely[i];
      result.views.reset();
    }
  }
  /// Tracks each hypothesis again from the alternative that \p guess_of proposes; keeps it where \p is_better says so.
  const auto challenge = [&](const auto &guess_of, const auto &is_better) {
    std::vector<Hypothesis> guesses;
    std::vector<std::size_t> of;
    for (std::size_t i = 0; i < results.size(); ++i)
      if (results[i].scored)
        if (const auto guess = guess_of(hypothesisOf(*results[i].scored))) {
          guesses.push_back(*guess);
          of.push_back(i);
        }
    std::vector<RetrackedHypothesis> others = read(guesses);
    for (std::size_t k = 0; k < others.size(); ++k)
      if (others[k].views && is_better(k, *others[k].scored, *results[of[k]].scored))
        results[of[k]] = std::move(others[k]);
  };
  const double thickest = m_units.detection.radius_max;
  // first alternative: one border was the edge of a shadow on the bark, or of something behind the trunk
  std::vector<BorderProposal> proposals;
  challenge(
      [&](const Hypothesis &hypothesis) -> std::optional<Hypothesis> {
        const auto proposal = proposeBorders(hypothesis, views, farthestScored(), thickest);
        if (!proposal)
          return std::nullopt;
        proposals.push_back(*proposal);
        return proposal->guess;
      },
      [&](std::size_t k, const ScoredHypothesis &other, const ScoredHypothesis &current) {
        return isBetterSilhouette(other, current, proposals[k], views, farthestScored());
      });
  // second alternative: lines that differ from frame to frame gave another range than the texture does
  challenge([&](const Hypothesis &hypothesis) { return proposeRange(hypothesis, views, farthestScored(), thickest); },
            [](std::size_t, const ScoredHypothesis &other, const ScoredHypothesis &current) {
              return other.log_odds > current.log_odds;
            });
  return results;
}

/// Refines the borders and ranges of the trunks by photo-consistency, after the last optimisation. No pose is moved,
/// because columns and borders were both measured along this path.
void Engine::refineByConsistency()
{
  const std::vector<ColumnView> views = columnViews(m_keyframes.frames());
  for (const MapTrunk &trunk : m_map.trunks()) {
    if (trunk.removed)
      continue;
    TrunkEstimate estimate = fuseDepthBorders({trunk.id, trunk.trunk, trunk.covariance}, views, farthestScored());
    estimate.trunk = fuseTextureRange(estimate.trunk, views, farthestScored());
    estimate.place_covariance =
        trunk.place_covariance + (*estimate.covariance - trunk.covariance).topLeftCorner<2, 2>();
    m_map.refresh(estimate);
  }
}

/// Whether the standard deviation of a place, relative to the pose that saw it, is below MapOptions::most_place_sigma.
bool Engine::isPlaced(const Eigen::Matrix2d &covariance) const
{
  const double most = m_units.map.most_place_sigma;
  return most == 0 || covariance.trace() <= most * most;
}

/// The final pass: scores every hypothesis by all keyframes, tracks the likely ones again, and confirms the best set of
/// which no two share a place or lines.
void Engine::runFinalPass()
{
  constexpr double kHides = 0.5; // log-odds above which a hypothesis may occlude a leaning trunk behind it
  const std::vector<ColumnView> views = columnViews(m_keyframes.frames());
  const std::vector<ScoredHypothesis> before = scoreAll(views);
  KeyframeGradients gradients(m_keyframes.frames(), m_units.gradient);
  detectLeaning(m_map.withTrunks(idsOf(before, kHides)), gradients);
  m_scored = scoreAll(views, before);
  std::vector<RetrackedHypothesis> results;
  const auto again = [&](const std::vector<ScoredHypothesis> &untried, const std::vector<ScoredHypothesis> &best) {
    std::vector<std::optional<ScoredHypothesis>> scored;
    for (RetrackedHypothesis &result : retrack(untried, best, views, gradients)) {
      const bool is_placed = isPlaced(result.views ? result.views->trunk.covariance.topLeftCorner<2, 2>()
                                                   : m_map.trunk(result.id).place_covariance);
      // one of unknown place must not suppress another of its lines
      scored.push_back(is_placed ? result.scored : std::nullopt);
      results.push_back(std::move(result));
    }
    return scored;
  };
  const double apart = m_units.map.merge_distance;
  const auto candidates = scoreBestAgain(m_scored, apart, views, farthestScored(), again);
  std::map<int, TrunkDecision> decisions;
  for (const ScoredHypothesis &one : m_scored)
    decisions[one.id] = {one.id, one.log_odds, false, std::nullopt};
  for (const ScoredHypothesis &one : candidates)
    decisions[one.id].log_odds = one.log_odds;
  const double least = std::max(m_units.map.confirm_odds, kMayBeTrunk);
  for (const ScoredHypothesis &one : chooseSet(candidates, least, apart, views, farthestScored()))
    decisions[one.id].is_trunk = true;
  for (RetrackedHypothesis &result : results) {
    TrunkDecision &decision = decisions[result.id];
    if (decision.is_trunk && result.views)
      decision.found = addToSmoother(*result.views);
  }
  std::vector<TrunkDecision> list;
  for (auto &[id, decision] : decisions)
    list.push_back(std::move(decision));
  for (const std::size_t gone : m_map.applyDecisions(list))
    m_smoother.removeTrunk(gone);
  m_smoother.optimize(kSettled);
  refreshWholeMap();
  refineByConsistency();
}
} // namespace bole
