// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Noise parameters of the saliency model, learnt from a sequence (the paper calls it straightforward, Section 5.1).
///
/// Pairs of consecutive images are compared under their rotation alone. Where there is no texture the residual is the
/// noise of intensity; elsewhere residual / gradient is the flow along the gradient that the rotation does not explain:
/// small for the background, wide for the foreground. Which is which is the label of the estimator. Deviations are
/// 1.4826 times the median of magnitudes, so that a few wrong labels do not matter.
///
/// Laws (each a test): noise added to a still scene is found again to 30 %.

#include "saliency/saliency.h"

#include <vector>

namespace bole
{
class SaliencyNoiseLearner
{
public:
  SaliencyNoiseLearner(const PinholeCamera &camera, const SaliencyOptions &start);

  /// \p saliency is the result of \p current; only pixels it knows are used for the flows.
  void add(const vpImage<unsigned char> &previous, const vpImage<unsigned char> &current, const Saliency &saliency);
  /// \p start with sigma_intensity, sigma_background_px, sigma_foreground_px and background_prior learnt; each keeps
  /// its value where fewer than 1000 pixels spoke of it.
  SaliencyOptions learnt() const;
  std::size_t count() const { return m_background.size() + m_foreground.size(); }

private:
  PinholeCamera m_camera;
  SaliencyOptions m_start;
  std::vector<float> m_intensity, m_background, m_foreground; ///< magnitudes
};
} // namespace bole
