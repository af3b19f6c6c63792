// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The twist of a camera between ViSP's types and Eigen's: cMo_moved = exp(-xi) cMo, xi = (v, w) in m and rad.

#include <bole/pose.h>

#include <Eigen/Cholesky>

#include <visp3/core/vpExponentialMap.h>
#include <visp3/core/vpVelocityTwistMatrix.h>

namespace bole
{
/// Inverse of a covariance or an information.
inline Matrix6d inverted(const Matrix6d &m) { return Eigen::MatrixXd(m).llt().solve(Eigen::MatrixXd::Identity(6, 6)); }

/// Takes a twist in b to a.
inline Matrix6d twistMatrix(const vpHomogeneousMatrix &aMb)
{
  const vpVelocityTwistMatrix V(aMb);
  Matrix6d m;
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      m(int(i), int(j)) = V[i][j];
  return m;
}

/// Twist of the camera that takes it from \p from to \p to: to = exp(-xi) from.
inline Vector6d twistBetween(const vpHomogeneousMatrix &from, const vpHomogeneousMatrix &to)
{
  const vpColVector xi = vpExponentialMap::inverse(from * to.inverse());
  Vector6d v;
  for (unsigned i = 0; i < 6; ++i)
    v(int(i)) = xi[i];
  return v;
}

inline vpHomogeneousMatrix moved(const vpHomogeneousMatrix &cMo, const Vector6d &xi)
{
  vpColVector v(6);
  for (unsigned i = 0; i < 6; ++i)
    v[i] = xi(int(i));
  return vpExponentialMap::direct(v).inverse() * cMo;
}
} // namespace bole
