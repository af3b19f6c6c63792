// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/camera_plausibility.h"

#include "geometry/failure.h"
#include "geometry/so3.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr double kDegrees = 180 / M_PI;
constexpr double kNarrowest_deg = 3, kWidest_deg = 170; // a telephoto lens; beyond, no pinhole shows it
constexpr double kLargestAspect = 2;                    // of the focal lengths: pixels of video are at most 4:3
constexpr double kLargestArm_m = 10;                    // of the camera in the body
constexpr int kSmallest_px = 16, kLargest_px = 16384;   // of a picture: a trunk in a smaller one is a smear

/// Whether the lens maps rays farther out to pixels farther out, up to \p goal (in the normalised picture).
bool reaches(const CameraModel &model, const Eigen::Vector2d &goal)
{
  constexpr double kStep = 0.01, kFarthest = 12; // tan(85 degrees)
  constexpr double kLargestSlope = 20;           // no lens magnifies so much more beside its axis than on it
  const Eigen::Vector2d direction = goal.normalized();
  double last = 0;
  for (double r = kStep; r < kFarthest; r += kStep) {
    const Eigen::Vector2d u_px = model.distort(r * direction);
    const double reached = Eigen::Vector2d((u_px.x() - model.pinhole.cx) / model.pinhole.fx,
                                           (u_px.y() - model.pinhole.cy) / model.pinhole.fy)
                               .dot(direction);
    if (!std::isfinite(reached) || reached <= last || reached - last > kLargestSlope * kStep)
      return false;
    if (reached >= goal.norm())
      return true;
    last = reached;
  }
  return false;
}

/// Whether the distortion is monotonic from the centre to the middle of each side.
bool isUnfolded(const CameraModel &model)
{
  const PinholeCamera &p = model.pinhole;
  const double left = -p.cx / p.fx, right = (p.width - 1 - p.cx) / p.fx;
  const double top = -p.cy / p.fy, bottom = (p.height - 1 - p.cy) / p.fy;
  for (const Eigen::Vector2d &goal :
       {Eigen::Vector2d(left, 0), Eigen::Vector2d(right, 0), Eigen::Vector2d(0, top), Eigen::Vector2d(0, bottom)})
    if (goal.norm() > 1e-3 && !reaches(model, goal))
      return false;
  return true;
}
} // namespace

Implausibility implausibility(const MountedCamera &camera)
{
  using Part = Implausibility::Part;
  const PinholeCamera &p = camera.model.pinhole;
  if (std::min(p.width, p.height) < kSmallest_px || std::max(p.width, p.height) > kLargest_px)
    return {Part::pinhole, fmt::format("a picture of {}x{} px, must be {} to {} px wide and high", p.width, p.height,
                                       kSmallest_px, kLargest_px)};
  const double view_deg = 2 * std::atan(0.5 * p.width / p.fx) * kDegrees;
  if (!(view_deg >= kNarrowest_deg && view_deg <= kWidest_deg))
    return {Part::pinhole, fmt::format("fx = {:g} px at {} columns is a field of view of {:.3g} degrees, must be {:g} "
                                       "to {:g}",
                                       p.fx, p.width, view_deg, kNarrowest_deg, kWidest_deg)};
  const double aspect = p.fx / p.fy;
  if (!(aspect >= 1 / kLargestAspect && aspect <= kLargestAspect))
    return {Part::pinhole,
            fmt::format("fx / fy = {:.3g}, must be {:g} to {:g}", aspect, 1 / kLargestAspect, kLargestAspect)};
  if (!p.contains({p.cx, p.cy}, -0.5))
    return {Part::pinhole, fmt::format("the principal point ({:g}, {:g}) must be in the picture of {}x{} px", p.cx,
                                       p.cy, p.width, p.height)};
  if (camera.model.distortion != Distortion::none && !isUnfolded(camera.model))
    return {Part::distortion, "the distortion folds the picture: farther out in the scene must be farther out in the "
                              "picture, up to its sides (too large coefficients, or in another order?)"};
  if (!(camera.bMc.t.norm() < kLargestArm_m))
    return {Part::mounting, fmt::format("the camera is {:.4g} m from the body, must be less than {:g} m (millimetres?)",
                                        camera.bMc.t.norm(), kLargestArm_m)};
  if ((camera.bMc.R - Eigen::Matrix3d::Identity()).norm() < 1e-6)
    return {Part::mounting, "no rotation in the body, must take the camera's axes (x right, y down, z ahead) to the "
                            "body's (x ahead, y left, z up)"};
  if (!isRotation(camera.bMc.R))
    return {Part::mounting, "its pose in the body must be a rigid motion"};
  return {};
}

void requirePlausible(const MountedCamera &camera)
{
  if (const Implausibility fault = implausibility(camera); fault.part != Implausibility::Part::none)
    throw badValue("camera: {}", fault.text);
}

double foldThirdCoefficient(const PinholeCamera &pinhole, double k3, double &k1, double &k2)
{
  const Eigen::Vector2d corner(std::max(pinhole.cx, pinhole.width - 1 - pinhole.cx) / pinhole.fx,
                               std::max(pinhole.cy, pinhole.height - 1 - pinhole.cy) / pinhole.fy);
  constexpr int kSamples = 100;
  Eigen::Matrix2d A = Eigen::Matrix2d::Zero();
  Eigen::Vector2d b = Eigen::Vector2d::Zero();
  for (int i = 1; i <= kSamples; ++i) {
    const double r = corner.norm() * i / kSamples;
    const Eigen::Vector2d row(std::pow(r, 3), std::pow(r, 5));
    A += row * row.transpose();
    b += row * k3 * std::pow(r, 7);
  }
  const Eigen::Vector2d added = A.inverse() * b;
  double worst = 0;
  for (int i = 1; i <= kSamples; ++i) {
    const double r = corner.norm() * i / kSamples;
    worst = std::max(worst, std::abs(added[0] * std::pow(r, 3) + added[1] * std::pow(r, 5) - k3 * std::pow(r, 7)));
  }
  k1 += added[0];
  k2 += added[1];
  return worst * pinhole.fx;
}
} // namespace bole
