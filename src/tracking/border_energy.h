// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The image energy of one trunk, its gradient and its Hessian (paper, Eq. 3 and 4).
///
/// Idea: both borders of a trunk are image lines; the energy is low where the gradient along them is strong.
/// Per border: e = -alpha |mean g| / contrast, with g the signed gradient blurred with 1 px. The
/// mean makes it independent of the visible length, the contrast (the strength of the border where it was found)
/// makes its curvature that of a blurred step of 1 px, so that alpha alone sets how the image weighs.
///
/// Deviations from Eq. 3: either polarity (absolute value of the signed sum, as the paper's sentence says),
/// mean instead of sum, contrast-normalised, alpha calibrated (EnergyOptions::alpha).
///
/// Laws (each a test): the gradient agrees with central differences; the Hessian is positive semi-definite;
/// a step edge at the border is a minimum; brightness scaled by k leaves energy and Hessian unchanged.

#include "gradient/border_line.h"
#include "gradient/gradient.h"

namespace bole
{
struct EnergyOptions
{
  /// Weight of one border: 1/alpha is the variance [px^2] of a border's place at contrast. 0.01 to
  /// 100. Chosen so that the normalised estimation error squared of mapped trunks is near its degrees of freedom.
  double alpha = 0.5;
  double contrast_floor = 0.02;  ///< contrast below which a border weighs less [full scale/px], 0.001 to 0.5
  double hessian_step_px = 0.75; ///< of the central differences of the Hessian, 0.1 to 3
};

/// One border as it is looked for in one image.
struct BorderTarget
{
  bool visible = true;
  double contrast = 0.02; ///< abs of the mean gradient that normalises the energy [full scale/px]
};

/// The energy of one trunk in one image, as a function of its relative trunk. Keeps references: the gradient must
/// outlive it. Cost: about 1 us an evaluation for two borders of 100 rows.
class TrunkEnergy
{
public:
  TrunkEnergy(const Gradient &gradient, const PinholeCamera &camera, const ElevationRange &range,
              const BorderTarget &left, const BorderTarget &right, const EnergyOptions &options);

  /// Energy at \p relative; its derivative by the tangent of theta^r in \p f where not null.
  double evaluate(const RelativeTrunk &relative, Vector4d *f = nullptr) const;

  struct Curvature
  {
    Matrix4d F = Matrix4d::Zero(); ///< positive semi-definite
    bool negative = false;         ///< a border is no maximum of the gradient: the paper's stop rule
  };
  /// Gauss-Newton Hessian J^T H J: H the 2x2 Hessian of each border by the displacement of its ends.
  Curvature curvature(const RelativeTrunk &relative) const;

  /// Signed mean gradient along a border at \p relative.
  double contrastAt(const RelativeTrunk &relative, Border border) const;

private:
  double weight(Border border, double mean) const;
  const BorderTarget &target(Border border) const { return border == Border::left ? m_left : m_right; }

  const Gradient &m_gradient;
  PinholeCamera m_camera;
  ElevationRange m_range;
  BorderTarget m_left, m_right;
  EnergyOptions m_options;
};
} // namespace bole
