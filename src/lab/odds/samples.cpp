// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/odds/samples.h"

#include "evaluation/trajectory_metrics.h"
#include "input/asl_source.h"
#include "input/truth.h"
#include "output/trunks_csv.h"

#include <cmath>
#include <limits>
#include <optional>

namespace bole
{
namespace
{
/// A hypothesis nearer than this to a true trunk [m] and by no more than this off in the logarithm of its radius is
/// one; one that is farther off in either is none. Between them nobody knows.
constexpr double kPlace = 0.35, kLogRadius = 0.45, kOffPlace = 0.5, kOffLogRadius = 0.7;

std::optional<bool> isTrunk(const Eigen::Vector2d &xy, double radius, const std::vector<TruthTrunk> &truth)
{
  double nearest = std::numeric_limits<double>::infinity(), off = 0;
  for (const TruthTrunk &trunk : truth) {
    const double distance = (trunk.xy - xy).norm();
    if (distance >= nearest)
      continue;
    nearest = distance;
    off = trunk.radius > 0 ? std::abs(std::log(radius / trunk.radius)) : 0; // far ones have none
  }
  if (nearest < kPlace && off < kLogRadius)
    return true;
  if (nearest > kOffPlace || off > kOffLogRadius)
    return false;
  return std::nullopt;
}
} // namespace

std::vector<OddsSample> oddsSamples(const std::string &run, const std::string &sequence)
{
  constexpr double kSpacing = 0.06, kBaseline = 0.45; // as in the final pass [m]
  constexpr int kLeastViews = 4;
  AslSource source(sequence);
  const Trajectory trajectory = readTumTrajectory(run + "/trajectory.tum");
  LevelGrid grid;
  grid.column_step = 1 / source.camera().fx;
  std::vector<LevelImage> images;
  Frame frame;
  for (std::size_t i = 0; source.next(frame) && i < trajectory.size(); ++i) {
    const Pose wMc = trajectory[i].wMb * source.bMc();
    if (frame.status == FrameStatus::ok && (images.empty() || (wMc.t - images.back().wMc().t).norm() > kSpacing))
      images.emplace_back(frame.image, source.camera(), wMc, grid);
  }
  const DepthSweep sweep;
  const std::vector<EvidenceView> views = evidenceViews(images, kBaseline, sweep);
  const PlanarTransform aligned = align(pairPoses(trajectory, source.truth()), Alignment::xy_yaw);
  const std::vector<TruthTrunk> truth = readTruthTrunks(sequence);
  std::vector<TrunkRecord> map = readTrunks(run + "/trunks.csv");
  for (const TrunkRecord &hypothesis : readTrunks(run + "/hypotheses.csv"))
    map.push_back(hypothesis);
  std::vector<OddsSample> samples;
  for (const TrunkRecord &record : map) {
    const std::optional<bool> is_trunk = isTrunk(aligned * record.xy, record.radius, truth);
    Trunk trunk;
    trunk.lean = record.lean;
    trunk.log_radius = std::log(record.radius);
    trunk.xy = record.xy - (record.ground_z + kBreastHeight) * record.lean;
    const TrunkEvidence evidence = evidenceOf(trunk, views, sweep, {});
    if (is_trunk && evidence.views >= kLeastViews)
      samples.push_back({termsOf(evidence), *is_trunk});
  }
  return samples;
}
} // namespace bole
