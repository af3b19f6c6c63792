// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing/state.h"

#include <visp3/core/vpException.h>

namespace bole
{
/// Whether the last update() or optimize() took it in.
bool Smoother::State::isSolved(const Name &name) const
{
  if (!window || (name.is_pose && name.number < window_places.first_pose))
    return false;
  const std::vector<int> &list = name.is_pose ? window_places.pose : window_places.trunk;
  const std::size_t at = name.is_pose ? name.number - window_places.first_pose : name.number;
  return at < list.size() && list[at] >= 0;
}

Matrix5d Smoother::State::trunkCovariance(std::size_t trunk) const
{
  if (!isSolved({false, trunk}))
    return trunks[trunk].covariance;
  return window->covariance({{window_places.of({false, trunk}), Matrix5d::Identity()}});
}

/// Along the axes of the world there.
Smoother::State::FromPose Smoother::State::placeJacobian(const TrunkState &trunk) const
{
  const Pose &wMb = poses[trunk.last_seen];
  const Eigen::Vector2d offset = trunk.value.xy - wMb.t.head<2>();
  FromPose J;
  J << -wMb.R.topRows<2>(), Eigen::Vector2d(offset.y(), -offset.x()) * wMb.R.row(2);
  return J;
}

Eigen::Matrix2d Smoother::State::placeCovariance(std::size_t trunk) const
{
  const TrunkState &seen = trunks[trunk];
  if (!isSolved({false, trunk}) || !isSolved({true, seen.last_seen}))
    return seen.place_covariance;
  return window->covariance({{window_places.of({true, seen.last_seen}), placeJacobian(seen)},
                             {window_places.of({false, trunk}), Eigen::MatrixXd::Identity(2, 5)}});
}

Matrix6d Smoother::State::poseCovariance(std::size_t pose) const
{
  if (isSolved({true, pose}))
    return window->covariance({{window_places.of({true, pose}), Matrix6d::Identity()}});
  if (pose >= pose_covariances.size())
    throw vpException(vpException::notInitialized, "pose = %zu, must be in the window or taken in by optimize()", pose);
  return pose_covariances[pose];
}

/// Covariance of those coordinates of the relative trunk that \p which selects.
Eigen::MatrixXd Smoother::State::relativeCovariance(std::size_t pose, std::size_t trunk,
                                                    const Eigen::MatrixXd &which) const
{
  Matrix46d J_pose;
  Matrix45d J_trunk;
  relativeTrunk(poses[pose], options.bMc, trunks[trunk].value, &J_pose, &J_trunk);
  if (!J_pose.allFinite() || !J_trunk.allFinite())
    throw vpException(vpException::badValue, "trunk = %zu, must not contain the camera", trunk);
  if (isSolved({true, pose}) && isSolved({false, trunk}))
    return window->covariance(
        {{window_places.of({true, pose}), which * J_pose}, {window_places.of({false, trunk}), which * J_trunk}});
  const Matrix4d whole =
      J_pose * poseCovariance(pose) * J_pose.transpose() + J_trunk * trunkCovariance(trunk) * J_trunk.transpose();
  return which * whole * which.transpose();
}
} // namespace bole
