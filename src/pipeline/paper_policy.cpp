// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/paper_policy.h"

#include "geometry/horizontal_view.h"
#include "tracking/borders.h"

#include <Eigen/Eigenvalues>

#include <cmath>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr double kNoCurvature = 1e-6; ///< of an energy without borders, by rounding [1/px^2]
constexpr double kSettled_px = 0.02;  ///< a border that moves less stands

TrunkEnergy energyOf(const Gradient &gradient, const PinholeCamera &camera, const StageOptions &options)
{
  return {gradient, camera, kWholeLine, BorderTarget(), BorderTarget(), options.tracking.energy};
}

/// Eq. 18 to 21: pairs of lines, each a tree whose range is that of the median radius.
std::vector<ObservedTree> instantiate(const Gradient &gradient, const vpImage<float> *p_background,
                                      const Viewpoint &view, Smoother &smoother, const TrunkMap &map,
                                      const StageOptions &options)
{
  std::vector<ObservedTree> trees;
  if (smoother.poseCount() < 2) // without a frame before there is no saliency
    return trees;
  ProfileOptions lines;
  lines.range = kWholeLine;
  for (const LineDetection &found : detectLines(gradient, p_background, view.camera, view.wMc.R,
                                                inhibitedRanges(map, view, true), lines, options.lines)) {
    const Trunk guess = trunkFromRelative(view.wMc, found.relative, options.smoothing.prior_radius);
    trees.push_back({-1, smoother.addTrunk(guess, priorOf(guess, options.smoothing)), found.relative});
  }
  return trees;
}

Sighting sightingOf(const ObservedTree &tree, const TrunkEnergy &energy, const Trunk &trunk, const Viewpoint &view)
{
  Sighting sighting;
  sighting.id = tree.id;
  sighting.kind = Sighting::Kind::seen;
  sighting.view.time_s = view.time_s;
  sighting.view.camera = view.wMc.t;
  sighting.view.bearing = horizontalView(view.wMc, trunk).bearing;
  sighting.view.left_contrast = energy.contrastAt(tree.relative, Border::left);
  sighting.view.right_contrast = energy.contrastAt(tree.relative, Border::right);
  return sighting;
}

/// Eq. 9 at the joint optimum, and the end of those whose energy is not convex there. A tree that no image has
/// measured is none.
std::vector<TrunkInView> summarise(const TrunkEnergy &energy, std::vector<ObservedTree> &trees, const Viewpoint &view,
                                   Smoother &smoother, TrunkMap &map)
{
  const std::size_t newest = smoother.poseCount() - 1;
  std::vector<TrunkInView> seen;
  for (ObservedTree &tree : trees) {
    const Trunk trunk = smoother.trunk(tree.smoother_id);
    const std::optional<SummaryFactor> summary = minimised(energy, view.camera, tree.relative);
    const bool is_observed =
        summary && smoother.addObservation(newest, tree.smoother_id, *summary) != SummaryStatus::not_finite;
    if (is_observed)
      tree.relative = summary->optimum;
    if (tree.id < 0 && !is_observed) {
      smoother.removeTrunk(tree.smoother_id);
      continue;
    }
    if (tree.id < 0) {
      NewTrunk found;
      found.smoother_id = tree.smoother_id;
      found.trunk = trunk;
      found.found_s = view.time_s;
      tree.id = map.add(found);
    }
    if (is_observed)
      map.record(sightingOf(tree, energy, trunk, view));
    else
      map.end(tree.id);
    if (!tree.relative.isFinite())
      continue;
    constexpr ElevationRange drawn = {-1, 1}; // of the endless line, what pictures show
    seen.push_back({tree.id, map.trunk(tree.id).status, is_observed,
                    toString(is_observed ? TrackingStatus::tracked : TrackingStatus::negative_curvature), tree.relative,
                    drawn.low, drawn.high, horizontalView(view.wMc, trunk).range});
  }
  smoother.optimize(kJointlySettled);
  return seen;
}
} // namespace

Vector4d pixelSteps(const PinholeCamera &camera, const RelativeTrunk &relative)
{
  constexpr double kLongest = 0.1; // of an angle [rad] and of the log of r/d: farther the energy is another
  Vector4d most = Vector4d::Constant(1 / kLongest);
  for (const Border border : kBorders) {
    const BorderLine line = borderLine(camera, relative, border, kWholeLine);
    if (line.rows() > 0)
      most = most.cwiseMax(
          borderJacobian(camera, relative, border, line).cwiseAbs().colwise().maxCoeff().transpose().eval());
  }
  return most.cwiseInverse();
}

SummaryFactor expandEnergy(const TrunkEnergy &energy, const PinholeCamera &camera, const RelativeTrunk &relative)
{
  constexpr double kStep_px = 0.5; // of the central differences: a sixth of the blur of Eq. 3
  SummaryFactor summary;
  summary.optimum = relative;
  summary.energy = energy.evaluate(relative, &summary.f);
  summary.F = energy.hessian(relative, kStep_px * pixelSteps(camera, relative));
  return summary;
}

bool isConvex(const SummaryFactor &summary, const Vector4d &steps)
{
  const Matrix4d F = steps.asDiagonal() * summary.F * steps.asDiagonal();
  return F.allFinite() && Eigen::SelfAdjointEigenSolver<Matrix4d>(F).eigenvalues()(0) > kNoCurvature;
}

SummaryFactor convexified(SummaryFactor summary, const Vector4d &steps)
{
  constexpr double kMost_px = 1;
  const Eigen::SelfAdjointEigenSolver<Matrix4d> eigen(steps.asDiagonal() * summary.F * steps.asDiagonal());
  const Vector4d slope = eigen.eigenvectors().transpose() * steps.cwiseProduct(summary.f);
  const Vector4d curvature =
      eigen.eigenvalues().cwiseAbs().cwiseMax(slope.cwiseAbs() / kMost_px).cwiseMax(kNoCurvature);
  const Matrix4d V = steps.cwiseInverse().asDiagonal() * eigen.eigenvectors();
  summary.F = V * curvature.asDiagonal() * V.transpose();
  return summary;
}

std::optional<SummaryFactor> minimised(const TrunkEnergy &energy, const PinholeCamera &camera,
                                       const RelativeTrunk &start)
{
  constexpr int kIterations = 50;
  if (!start.isFinite())
    return std::nullopt;
  SummaryFactor summary = expandEnergy(energy, camera, start);
  for (int i = 0; i < kIterations; ++i) {
    const Vector4d steps = pixelSteps(camera, summary.optimum);
    if (!summary.f.allFinite() || !summary.F.allFinite())
      return std::nullopt;
    Vector4d step = -convexified(summary, steps).F.ldlt().solve(summary.f);
    const auto length_px = [&] { return step.cwiseQuotient(steps).cwiseAbs().maxCoeff(); };
    while (length_px() >= kSettled_px && !(energy.evaluate(summary.optimum.plus(step)) < summary.energy))
      step *= 0.5;
    if (!(length_px() >= kSettled_px))
      return isConvex(summary, steps) ? std::optional(summary) : std::nullopt;
    summary = expandEnergy(energy, camera, summary.optimum.plus(step));
  }
  return std::nullopt;
}

std::optional<RotationPrior> gyroTurn(const Frame &frame, const Trajectory &flight, const Pose &bMc,
                                      const GyroOptions &options)
{
  if (flight.empty() || frame.gyro.empty())
    return std::nullopt;
  const GyroRotation turn =
      integrateGyro(frame.gyro, flight.back().stamp_ns, frame.stamp_ns, GyroBias::unknown(options), options);
  if (!turn.complete)
    return std::nullopt;
  return RotationPrior{bMc.R.transpose() * turn.R * bMc.R, bMc.R.transpose() * turn.covariance() * bMc.R};
}

void optimiseJointly(const TrunkEnergy &energy, const PinholeCamera &camera, std::vector<ObservedTree> &trees,
                     Smoother &smoother)
{
  const auto expanded = [&](const RelativeTrunk &relative) {
    return convexified(expandEnergy(energy, camera, relative), pixelSteps(camera, relative));
  };
  const std::size_t newest = smoother.poseCount() - 1;
  for (const ObservedTree &tree : trees)
    smoother.addImage(newest, tree.smoother_id, expanded);
  const UpdateResult result = smoother.optimize(kJointlySettled);
  for (ObservedTree &tree : trees) {
    smoother.removeObservation(newest, tree.smoother_id);
    tree.relative = smoother.predictedRelative(tree.smoother_id);
  }
  if (!std::isfinite(result.cost))
    throw vpException(vpException::divideByZeroError, "paper: frame %zu: the joint energy is not finite", newest);
}

std::vector<TrunkInView> mapAsPaper(const Gradient &gradient, const vpImage<float> *p_background, const Viewpoint &view,
                                    Smoother &smoother, TrunkMap &map, const StageOptions &options)
{
  std::vector<ObservedTree> trees = instantiate(gradient, p_background, view, smoother, map, options);
  for (const std::size_t i : map.active()) // observed in the frame before, or ended
    trees.push_back({map.trunks()[i].id, map.trunks()[i].smoother_id, {}});
  const TrunkEnergy energy = energyOf(gradient, view.camera, options);
  optimiseJointly(energy, view.camera, trees, smoother);
  return summarise(energy, trees, view, smoother, map);
}
} // namespace bole
