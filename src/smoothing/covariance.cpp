// SPDX-License-Identifier: GPL-2.0-or-later
// Marginal covariances. With H = L L^T, X^T H^-1 X = |L^-1 X|^2, and L^-1 X is zero outside the
// paths from the rows of X to the roots: a handful of variables for what was seen of late.
#include "smoothing/state.h"

#include <algorithm>
#include <visp3/core/vpException.h>

namespace bole
{
template <int Columns>
Eigen::Matrix<double, Columns, Columns>
Smoother::State::inverseForm(const int *variable, const Eigen::Matrix<double, Columns, 6> *X, int count)
{
  using Rows = Eigen::Map<Eigen::Matrix<double, Columns, 6>>; // a row of X stands together
  position.resize(variables.size(), -1);
  path.clear();
  for (int i = 0; i < count; ++i)
    for (int v = variable[i]; v >= 0 && position[v] < 0; v = variables[v].parent) {
      position[v] = 0;
      path.push_back(v);
    }
  std::sort(path.begin(), path.end(), [this](int l, int r) { return variables[l].order < variables[r].order; });
  path_rows.resize(std::max(path_rows.size(), path.size()));
  for (std::size_t slot = 0; slot < path.size(); ++slot) {
    position[path[slot]] = static_cast<int>(slot);
    path_rows[slot].fill(0);
  }
  for (int i = 0; i < count; ++i)
    Rows(path_rows[position[variable[i]]].data()) += X[i];

  Eigen::Matrix<double, Columns, Columns> form = Eigen::Matrix<double, Columns, Columns>::Zero();
  for (std::size_t slot = 0; slot < path.size(); ++slot) {
    const Variable &v = variables[path[slot]];
    Rows y(path_rows[slot].data());
    const int rows = v.dim + v.separator_dim;
    withColumns(v, [&](const auto *columns) {
      const auto L = [&](int r, int c) { return double(columns[c * rows + r]); };
      for (int c = 0; c < v.dim; ++c) {
        y.col(c) /= L(c, c);
        for (int i = c + 1; i < v.dim; ++i)
          y.col(i) -= L(i, c) * y.col(c);
        form += y.col(c) * y.col(c).transpose();
      }
      int row = v.dim;
      for (const int s : v.separator) {
        Rows b(path_rows[position[s]].data());
        for (int i = 0; i < variables[s].dim; ++i, ++row) {
          Eigen::Matrix<double, Columns, 1> left = b.col(i);
          for (int c = 0; c < v.dim; ++c)
            left -= L(row, c) * y.col(c);
          b.col(i) = left;
        }
      }
    });
  }
  for (const int v : path)
    position[v] = -1;
  return form;
}

Matrix5d Smoother::State::trunkCovariance(int trunk)
{
  const TrunkState &state = trunks[trunk];
  if (!isOpen(state.variable))
    return state.marginalised_covariance;
  if (!variables[state.variable].eliminated)
    return state.prior.sigma.cwiseAbs2().asDiagonal();
  Eigen::Matrix<double, 5, 6> X = Eigen::Matrix<double, 5, 6>::Identity();
  return inverseForm<5>(&state.variable, &X, 1);
}

/// Covariance of a trunk's place relative to the pose that saw it last, or, where that pose is marginalised, to the
/// oldest one that is not.
Eigen::Matrix2d Smoother::State::placeCovariance(int trunk)
{
  const TrunkState &seen = trunks[trunk];
  if (!isOpen(seen.variable))
    return seen.marginalised_place_covariance;
  const PoseState &from = poses[std::max(seen.last_pose, oldest_open_pose)];
  if (!variables[seen.variable].eliminated || !variables[from.variable].eliminated)
    return seen.prior.sigma.head<2>().cwiseAbs2().asDiagonal();
  const Pose wMb = estimate(from);
  const Eigen::Vector2d offset = estimate(seen).xy - wMb.t.head<2>();
  const int ids[2] = {from.variable, seen.variable};
  Eigen::Matrix<double, 2, 6> X[2];
  X[0] << -wMb.R.topRows<2>(), Eigen::Vector2d(offset.y(), -offset.x()) * wMb.R.row(2);
  X[1].setIdentity();
  return inverseForm<2>(ids, X, 2);
}

Matrix6d Smoother::State::poseCovariance(int pose)
{
  const PoseState &state = poses[pose];
  if (!isOpen(state.variable))
    return marginalised_covariances[static_cast<std::size_t>(pose / kCovarianceEvery)];
  if (!variables[state.variable].eliminated)
    throw vpException(vpException::notInitialized, "pose = %d, must be taken in by update() first", pose);
  const Matrix6d X = Matrix6d::Identity();
  return inverseForm<6>(&state.variable, &X, 1);
}

/// Covariance of those coordinates of the relative trunk that \p which selects.
template <int Columns>
Eigen::Matrix<double, Columns, Columns>
Smoother::State::relativeCovariance(int trunk, const Eigen::Matrix<double, Columns, 4> &which)
{
  const TrunkState &seen = trunks[trunk];
  const PoseState &newest = poses.back();
  Matrix46d J_pose;
  Matrix45d J_trunk;
  relativeTrunk(estimate(newest), options.bMc, estimate(seen), &J_pose, &J_trunk);
  if (!J_pose.allFinite() || !J_trunk.allFinite())
    throw vpException(vpException::badValue, "trunk = %d, must not contain the camera", trunk);
  if (!isOpen(seen.variable) || !variables[seen.variable].eliminated) {
    const Matrix4d whole = J_pose * poseCovariance(static_cast<int>(poses.size()) - 1) * J_pose.transpose() +
                           J_trunk * trunkCovariance(trunk) * J_trunk.transpose();
    return which * whole * which.transpose();
  }
  if (!variables[newest.variable].eliminated)
    throw vpException(vpException::notInitialized, "newest pose, must be taken in by update() first");
  const int ids[2] = {newest.variable, seen.variable};
  Eigen::Matrix<double, Columns, 6> X[2];
  X[0] = which * J_pose;
  X[1].setZero();
  X[1].template leftCols<5>() = which * J_trunk;
  return inverseForm<Columns>(ids, X, 2);
}

Matrix4d Smoother::State::relativeCovariance(int trunk) { return relativeCovariance<4>(trunk, Matrix4d::Identity()); }

double Smoother::State::bearingVariance(int trunk)
{
  constexpr int kBearing = 2;
  return relativeCovariance<1>(trunk, Eigen::RowVector4d::Unit(kBearing))(0, 0);
}
} // namespace bole
