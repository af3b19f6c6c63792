// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether a matrix that somebody hands over is a rotation.

#include <Eigen/LU>

namespace bole
{
/// But for the few digits with which matrices are written; never where a number is not finite.
inline bool isRotation(const Eigen::Matrix3d &R)
{
  constexpr double kLoosest = 1e-3;
  return (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() < kLoosest && R.determinant() > 0;
}
} // namespace bole
