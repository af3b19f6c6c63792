// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Matrices between ViSP and Eigen.

#include <bole/pose.h>

#include <visp3/core/vpMatrix.h>

namespace bole
{
inline Matrix6d toEigen(const vpMatrix &m)
{
  return Eigen::Map<const Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(m.data);
}

inline vpMatrix toVisp(const Eigen::MatrixXd &e)
{
  vpMatrix m(unsigned(e.rows()), unsigned(e.cols()));
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(m.data, e.rows(), e.cols()) = e;
  return m;
}
} // namespace bole
