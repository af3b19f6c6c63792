// SPDX-License-Identifier: GPL-2.0-or-later
// What the columns of the last frames say of the trunks in sight: whether they are trunks, and whether the borders are
// those of the silhouette.
#include "pipeline/engine.h"

#include <algorithm>
#include <limits>

namespace bole
{
namespace
{
/// The trunk between the borders that this frame shows, at the range that is known: what the estimate is wrong by does
/// not count as what stands beside them.
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

/// A line beside which the trunk goes on is one of light and shade: the border is not read there while the other one
/// tells the bearing.
void Engine::leaveLinesOnBark(std::vector<PredictedTrunk> &predicted) const
{
  for (PredictedTrunk &trunk : predicted) {
    const auto evidence = m_columns.lately(trunk.id);
    if (!evidence || !goesOnBeside(*evidence))
      continue;
    bool &on_bark = evidence->left < evidence->right ? trunk.tracking.left_on_bark : trunk.tracking.right_on_bark;
    on_bark = true;
  }
}

/// Depth inside and beside the borders of what was tracked: whether it is a trunk, and whether its borders are those of
/// the silhouette.
void Engine::lookAtColumns(const Frame &frame, const std::vector<TrackedTrunk> &tracked, const Viewpoint &view)
{
  constexpr double kBeside = 0.12; // least difference beside a border that is not asked again: of most it is .3 to 1.5
  const LevelImage *level =
      m_columns.add(frame.image, newest(), view, m_units.flow.view_spacing, m_units.detection.profile.range);
  if (!level)
    return;
  if (m_units.flow.final_pass)
    m_album.add(frame.image, *level, newest(), view.time_s);
  if (!view.has_ranges)
    return;
  const std::vector<LevelView> views = levelViews(m_columns.frames());
  std::optional<Hypothesis> doubtful; // the one whose borders are the least those of its silhouette
  double least = 0;
  for (const TrackedTrunk &one : tracked) {
    if (one.result.status != TrackingStatus::tracked || one.is_flipped)
      continue;
    const MapTrunk &trunk = m_map.trunk(one.predicted.id);
    const auto evidence = m_columns.look(trunk.id, asSeen(one, trunk.trunk, view), views, farthestJudged());
    if (!evidence)
      continue;
    const Hypothesis hypothesis{trunk.id, trunk.trunk, m_map.evidence(trunk)};
    m_map.record(
        ColumnOdds{trunk.id, judgedBy(*evidence, hypothesis).log_odds, evidence->views, evidence->leastBeside()});
    const bool is_doubtful = m_units.flow.leave_bark ? evidence->leastBeside() < kBeside : goesOnBeside(*evidence);
    if (!m_columns.mayReadAgain(trunk.id) || !(is_doubtful || isBehind(*evidence)))
      continue;
    const double worst = evidence->weakestBorder();
    if (!doubtful || worst < least) {
      doubtful = hypothesis;
      least = worst;
    }
  }
  m_columns.forgetIf([this](int id) { return !m_map.isActive(id); });
  if (doubtful)
    readAnew(*doubtful, views, view);
}

/// A reading of \p doubtful between other borders takes its place where the columns speak for it: to steer by, where
/// they are rather those of the silhouette, also by a pixel.
void Engine::readAnew(const Hypothesis &doubtful, const std::vector<LevelView> &views, const Viewpoint &view)
{
  constexpr double kBetter = 0.05; // of the score
  const bool is_steered_by = m_units.flow.leave_bark;
  const double outside_px = is_steered_by ? 1 : std::numeric_limits<double>::infinity();
  m_columns.noteReading(doubtful.id);
  const auto doubt = doubtBorders(doubtful, views, farthestJudged(), m_units.detection.radius_max, outside_px);
  if (!doubt)
    return;
  const auto before = judge(doubtful, views, farthestJudged()); // where it stands now
  if (!before)
    return;
  const Adoption other = followThroughWindow(doubt->guess, m_window, m_smoother, m_map, view, m_units);
  if (static_cast<int>(other.views.size()) < kLeastViews)
    return;
  const auto judged = judge({doubtful.id, other.trunk.trunk, doubtful.online}, views, farthestJudged());
  if (!judged)
    return;
  if (is_steered_by ? silhouetteScore(*judged) < silhouetteScore(*before) + kBetter
                    : !isSilhouetteOf(*judged, *before, *doubt, views, farthestJudged()))
    return;
  m_smoother.removeTrunk(m_map.readAgain(doubtful.id, hold(other)));
  m_columns.forget(doubtful.id);
}
} // namespace bole
