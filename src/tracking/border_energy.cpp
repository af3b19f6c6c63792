// SPDX-License-Identifier: GPL-2.0-or-later

#include "tracking/border_energy.h"

#include <Eigen/Eigenvalues>
#include <algorithm>

namespace bole
{
TrunkEnergy::TrunkEnergy(const Gradient &gradient, const PinholeCamera &camera, const ElevationRange &range,
                         const BorderTarget &left, const BorderTarget &right, const EnergyOptions &options)
    : m_gradient(gradient), m_camera(camera), m_range(range), m_left(left), m_right(right), m_options(options)
{
}

/// Factor that turns the mean along a line into energy.
double TrunkEnergy::weight(Border border, double mean) const
{
  const double contrast = std::max(target(border).contrast, m_options.contrast_floor);
  return (mean >= 0 ? -1 : 1) * m_options.alpha / contrast;
}

double TrunkEnergy::evaluate(const RelativeTrunk &relative, Vector4d *f) const
{
  double energy = 0;
  if (f)
    f->setZero();
  for (const Border border : kBorders) {
    if (!target(border).visible)
      continue;
    const BorderLine line = borderLine(m_camera, relative, border, m_range);
    if (line.rows() == 0)
      continue;
    const MeanGradient g = meanAlong(m_gradient.signed_x, line);
    const double k = weight(border, g.mean);
    energy += k * g.mean;
    if (f)
      *f += k * borderJacobian(m_camera, relative, border, line).transpose() * Eigen::Vector2d(g.by_top, g.by_bottom);
  }
  return energy;
}

TrunkEnergy::Curvature TrunkEnergy::curvature(const RelativeTrunk &relative) const
{
  Curvature curvature;
  const double h = m_options.hessian_step_px;
  for (const Border border : kBorders) {
    if (!target(border).visible)
      continue;
    const BorderLine line = borderLine(m_camera, relative, border, m_range);
    if (line.rows() == 0)
      continue;
    const auto &g = m_gradient.signed_x;
    const double k = weight(border, meanAlongOnly(g, line));
    Eigen::Matrix2d H;
    for (int i = 0; i < 2; ++i) {
      const double top = i == 0 ? h : 0, bottom = i == 1 ? h : 0;
      const MeanGradient plus = meanAlong(g, line.moved(top, bottom)), minus = meanAlong(g, line.moved(-top, -bottom));
      H(0, i) = k * (plus.by_top - minus.by_top) / (2 * h);
      H(1, i) = k * (plus.by_bottom - minus.by_bottom) / (2 * h);
    }
    H = (0.5 * (H + H.transpose())).eval();
    if (!(H.sum() > 0)) // along a sideways move of the whole border
      curvature.negative = true;
    const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(H);
    const Eigen::Matrix2d H_psd =
        eigen.eigenvectors() * eigen.eigenvalues().cwiseMax(0).asDiagonal() * eigen.eigenvectors().transpose();
    const auto J = borderJacobian(m_camera, relative, border, line);
    curvature.F += J.transpose() * H_psd * J;
  }
  return curvature;
}

double TrunkEnergy::contrastAt(const RelativeTrunk &relative, Border border) const
{
  return meanAlongOnly(m_gradient.signed_x, borderLine(m_camera, relative, border, m_range));
}
} // namespace bole
