// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Evidence per pixel for each of a few inverse depths, gathered over frames.
///
/// Where the translation t of the camera is known, a static point at inverse depth rho moves by V w + A t rho. A coarse
/// sweep over rho compares the current image with an older one at each rho; squared residuals are averaged over a small
/// upright window and turned into a log-likelihood by the noise of intensity, of the motion and of the step of the
/// sweep. So a window without texture, or near the focus of expansion, likes every rho the same and says nothing.
/// From frame to frame the evidence moves with the pixel and the depth it speaks of, and fades.
///
/// Laws (each a test): no motion leaves the evidence unchanged but for its fading; without texture the log odds are
/// those of the prior; finite on any image.
///
/// Not in the paper: it asks whether a pixel *moves* with the background; this asks whether it is *near*.

#include "saliency/image_pyramid.h"
#include "saliency/saliency_options.h"
#include <bole/pose.h>

#include <vector>

namespace bole
{
/// Uncertainty of the motion between two frames, as standard deviations.
struct MotionNoise
{
  double rotation = 1e-3;    ///< [rad]
  double translation = 0.01; ///< an axis [m]
};

class InverseDepthEvidence
{
public:
  static constexpr int kRowStep = 2; ///< rows of the working level to a row of evidence

  /// \p camera is that of the working level, \p level its level in the pyramid.
  InverseDepthEvidence(const PinholeCamera &camera, int level, const SaliencyOptions &options);

  void clear();
  /// Moves the evidence to the current frame; \p pMc is the current camera in the previous one. Fades it.
  void predict(const Pose &pMc);
  /// Adds what \p older says about \p current, both at the working level; \p oMc is the current camera in the older.
  void add(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise);
  /// log p(nearer than near_range) - log p(farther), one value a pixel of the working level, but only each kRowStep-th
  /// row: trunks are upright, and windows taller than wide.
  vpImage<float> logOddsNear() const;
  /// log odds before any evidence.
  float priorLogOdds() const { return m_prior_log_odds; }

private:
  void compare(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc);
  void addLikelihood(const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise);

  PinholeCamera m_camera;
  SaliencyOptions m_options;
  double m_intensity_variance;
  int m_rows, m_window_rows;
  std::size_t m_first_near = 0; ///< first step nearer than near_range
  float m_prior_log_odds;
  std::vector<float> m_rho;                                     ///< [1/m], rising from 0
  std::vector<float> m_log_prior;                               ///< of each step
  std::vector<float> m_evidence;                                ///< row by row, pixel by pixel, all steps of each
  std::vector<float> m_scratch, m_residuals, m_line, m_squares; ///< kept for their memory
};

/// Median flow [px of \p camera] of points at \p range under the translation of \p oMc.
double medianParallax(const PinholeCamera &camera, const Pose &oMc, double range);
} // namespace bole
