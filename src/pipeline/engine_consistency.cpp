// SPDX-License-Identifier: GPL-2.0-or-later
// Photo-consistency of the trunks in sight over the last frames: whether they are trunks, and whether their borders are
// their occluding contours.
#include "pipeline/engine.h"

#include <algorithm>
#include <limits>

namespace bole
{
namespace
{
/// The trunk between the borders measured in this frame, at its estimated range, so that an error of the estimated
/// bearing is not taken for background beside a border.
Trunk asSeen(const TrackedTrunk &tracked, const Trunk &trunk, const Viewpoint &view)
{
  const RelativeTrunk &seen = tracked.result.optimum;
  const double distance = trunk.radius() / tracked.predicted.tracking.relative.ratio();
  Trunk between = trunkFromRelative(view.wMc, seen, seen.ratio() * distance);
  between.lean = trunk.lean; // about its place at the height of the camera
  between.xy -= view.wMc.t.z() * trunk.lean;
  return between;
}
} // namespace

/// Marks the borders beyond which the trunk continues by depth: such a line is an edge of light and shade on the bark,
/// and tracking leaves it out while the other border gives the bearing.
void Engine::maskTextureEdges(std::vector<PredictedTrunk> &predicted) const
{
  for (PredictedTrunk &trunk : predicted) {
    const auto evidence = m_consistency.borderConsistency(trunk.id);
    if (!evidence || !continuesBeyondBorder(*evidence))
      continue;
    bool &on_bark = evidence->left < evidence->right ? trunk.tracking.left_on_bark : trunk.tracking.right_on_bark;
    on_bark = true;
  }
}

/// Scores each tracked trunk by photo-consistency inside and beside its borders, and re-detects the borders of the
/// trunk whose borders fit depth least.
void Engine::scoreByConsistency(const Frame &frame, const std::vector<TrackedTrunk> &tracked, const Viewpoint &view)
{
  constexpr double kBeside = 0.12; // difference beside a border below which it is re-detected: of most it is .3 to 1.5
  const ColumnImage *level =
      m_consistency.add(frame.image, newest(), view, m_units.flow.view_spacing, m_units.detection.profile.range);
  if (!level)
    return;
  if (m_units.flow.final_pass)
    m_keyframes.add(frame.image, *level, newest(), view.time_s);
  if (!view.has_ranges)
    return;
  const std::vector<ColumnView> views = columnViews(m_consistency.frames());
  std::optional<Hypothesis> suspect; // the trunk whose borders are the least likely occluding contours
  double least = 0;
  for (const TrackedTrunk &one : tracked) {
    if (one.result.status != TrackingStatus::tracked || one.is_flipped)
      continue;
    const MapTrunk &trunk = m_map.trunk(one.predicted.id);
    const auto evidence = m_consistency.update(trunk.id, asSeen(one, trunk.trunk, view), views, farthestScored());
    if (!evidence)
      continue;
    const Hypothesis hypothesis{trunk.id, trunk.trunk, m_map.evidence(trunk)};
    m_map.record(ConsistencyScore{trunk.id, scoreFrom(*evidence, hypothesis).log_odds, evidence->views,
                                  evidence->weakestOutside()});
    const bool is_suspect =
        m_units.flow.mask_texture_edges ? evidence->weakestOutside() < kBeside : continuesBeyondBorder(*evidence);
    if (!m_consistency.mayRedetect(trunk.id) || !(is_suspect || isBackgroundInside(*evidence)))
      continue;
    const double worst = evidence->weakestBorder();
    if (!suspect || worst < least) {
      suspect = hypothesis;
      least = worst;
    }
  }
  m_consistency.forgetIf([this](int id) { return !m_map.isActive(id); });
  if (suspect)
    redetectBorders(*suspect, views, view);
}

/// Tracks \p suspect again between the borders that depth proposes, and replaces it in map and smoother where
/// photo-consistency is better there. While servoing, a border that is off by a pixel is reason enough to try.
void Engine::redetectBorders(const Hypothesis &suspect, const std::vector<ColumnView> &views, const Viewpoint &view)
{
  constexpr double kBetter = 0.05; // of the score
  const bool is_steered_by = m_units.flow.mask_texture_edges;
  const double outside_px = is_steered_by ? 1 : std::numeric_limits<double>::infinity();
  m_consistency.noteRedetection(suspect.id);
  const auto proposal = proposeBorders(suspect, views, farthestScored(), m_units.detection.radius_max, outside_px);
  if (!proposal)
    return;
  const auto before = scoreHypothesis(suspect, views, farthestScored()); // where it stands now
  if (!before)
    return;
  const CandidateTrack other = trackThroughWindow(proposal->guess, m_window, m_smoother, m_map, view, m_units);
  if (static_cast<int>(other.views.size()) < kLeastViews)
    return;
  const auto scored = scoreHypothesis({suspect.id, other.trunk.trunk, suspect.online}, views, farthestScored());
  if (!scored)
    return;
  if (is_steered_by ? silhouetteScore(*scored) < silhouetteScore(*before) + kBetter
                    : !isBetterSilhouette(*scored, *before, *proposal, views, farthestScored()))
    return;
  m_smoother.removeTrunk(m_map.replaceHypothesis(suspect.id, addToSmoother(other)));
  m_consistency.forget(suspect.id);
}
} // namespace bole
