// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The paper's own way from a frame to the map (Sections 3, 4, 6 and 7), for MapPolicy::paper. src/doc/paper.md goes
/// through its equations and says what had to be decided where it is silent.
///
/// Idea: a pair of lines that the detector finds is a tree at once (Eq. 18 to 21). The trees that the frame before
/// observed are observed again: their energies (Eq. 3 and 4) are optimised together with the pose, all other trees and
/// what the earlier frames left (Eq. 2, Fig. 2). At the minimum of its own energy next to where that leaves it the
/// image of a tree becomes a summary factor for ever (Eq. 9). A tree whose energy has no minimum there is observed no
/// more: it stays in the map, and nothing is ever associated with it.
///
/// Laws (each a test): the joint optimisation never raises the sum of the energies, and where it ends no move of a pose
/// or a tree lowers it; a tree is confirmed in the frame that finds it; one that ends stays, and what is found in its
/// place is another tree.

#include "pipeline/adoption.h"
#include "saliency/rotation_em.h"
#include <bole/pose.h>
#include <bole/report.h>

namespace bole
{
/// A cylinder has no ends (theta is x, y and r): its borders run through the whole image, up to 87 degrees of
/// elevation.
constexpr ElevationRange kWholeLine = {-20, 20};

constexpr double kJointlySettled =
    1e-8; ///< share of the joint energy by which its optimisation still falls when it ends

/// Steps of the tangent of \p relative that move an end of one of its borders by a pixel, none longer than a tenth.
Vector4d pixelSteps(const PinholeCamera &camera, const RelativeTrunk &relative);

/// Eq. 3 of one tree about \p relative, to second order.
SummaryFactor expandEnergy(const TrunkEnergy &energy, const PinholeCamera &camera, const RelativeTrunk &relative);

/// Whether the quadratic has a minimum, in each direction of the tangent.
bool isConvex(const SummaryFactor &summary, const Vector4d &steps);

/// The same value and gradient with a Hessian that is positive and lets the image move a border by a pixel at most (the
/// basin of Eq. 3 is the blur, three pixels wide): one step downhill from wherever it starts.
SummaryFactor convexified(SummaryFactor summary, const Vector4d &steps);

/// "We non-linearly optimize the relative tree parameters to maximize the true measurement likelihood before computing"
/// the quadratic: the minimum of the tree's own energy below \p start, in all four directions, by Newton steps that are
/// halved until the energy falls. Nothing where that ends on no minimum.
std::optional<SummaryFactor> minimised(const TrunkEnergy &energy, const PinholeCamera &camera,
                                       const RelativeTrunk &start);

/// The turn of the camera since the last pose of \p flight by the gyro, where it covers it: what EM starts from.
std::optional<RotationPrior> gyroTurn(const Frame &frame, const Trajectory &flight, const Pose &bMc,
                                      const GyroOptions &options);

/// A tree whose image takes part in the joint optimisation of a frame.
struct ObservedTree
{
  int id = -1; ///< in the map; -1: found in this frame
  std::size_t smoother_id = 0;
  RelativeTrunk relative;
};

/// Eq. 2 with the energies (Eq. 3 and 4) of the newest pose's image, all of it together, by Levenberg-Marquardt: a step
/// is taken only where the sum of the energies themselves and of all other factors falls. So it ends, and what it
/// leaves is never worse than what it was given; where the current image has no minimum it stops at the best there is.
/// \p trees and \p smoother then stand at the joint optimum, and the images are out of \p smoother again.
/// \throw vpException where the sum is no number
void optimiseJointly(const TrunkEnergy &energy, const PinholeCamera &camera, std::vector<ObservedTree> &trees,
                     Smoother &smoother);

/// From the newest pose's image to the map: detects, optimises jointly, summarises.
/// Returns what was looked for.
std::vector<TrunkInView> mapAsPaper(const Gradient &gradient, const vpImage<float> *p_background, const Viewpoint &view,
                                    Smoother &smoother, TrunkMap &map, const StageOptions &options);
} // namespace bole
