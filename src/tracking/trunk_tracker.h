// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Relative tracking: where the energy of one trunk has its optimum in one image, near its prediction.
///
/// Idea: predict, scan each border under the prediction's covariance, start from the best pair of maxima, let
/// NLopt polish the four parameters, keep gradient and Hessian for the summary factor (paper, Sections 4.1, 4.2).
///
/// Status, not exceptions: what happens to a trunk in a frame is an outcome. NaN never becomes `tracked`.

#include "tracking/border_energy.h"
#include "tracking/border_profile.h"

#include <optional>

namespace bole
{
struct TrackingOptions
{
  EnergyOptions energy;
  /// Of how far left and right border are off those of the cylinder: bow moves both, taper widens; 0 to 0.99.
  double border_correlation = 0;
  double scan_min_px = 2.5;    ///< half-width of the scan at the least, [px], 0.5 to 20; the lean and bow of trunks
  double scan_max_px = 12;     ///< and at the most, [px], 1 to 60
  double scan_sigmas = 3;      ///< half-width in standard deviations of the prediction, 1 to 10
  double contrast_min = 0.006; ///< weaker borders are not seen [full scale/px], 0 to 0.5
  int rows_min = 20;           ///< shortest part of a border worth looking at, [px], 4 to 1000
  double tilt_sigma = 0.03;    ///< of the trunk against the vertical (lean and bow), [rad], 0.001 to 0.5
  double polish_max_px = 3;    ///< a minimum farther from its start is another border, [px], 0.5 to 20
};

enum class TrackingStatus
{
  tracked,
  not_visible,        ///< no border long enough in the image
  occluded,           ///< hidden by nearer trunks
  no_border,          ///< nothing strong enough near the prediction
  diverged,           ///< the minimisation left its start
  negative_curvature, ///< the paper's stop rule
  sign_changed        ///< a border turned from dark-bright to bright-dark: another edge
};
const char *toString(TrackingStatus status);

/// The prediction of a trunk before it is tracked in an image.
struct TrackingPrediction
{
  RelativeTrunk relative;
  Matrix4d covariance = Matrix4d::Identity() * 1e-4;
  ElevationRange range;
  bool left_hidden = false, right_hidden = false;      ///< by nearer trunks
  bool left_on_bark = false, right_on_bark = false;    ///< a line of light and shade: not read where the other is
  std::optional<double> left_contrast, right_contrast; ///< signed, from the frames before
};

struct TrackingResult
{
  TrackingStatus status = TrackingStatus::no_border;
  RelativeTrunk optimum;
  double energy = 0;             ///< image energy at the optimum
  Vector4d f = Vector4d::Zero(); ///< its gradient there (the prior on the tilt holds the optimum off f = 0)
  Matrix4d F = Matrix4d::Zero(); ///< its Hessian, positive semi-definite
  double left_contrast = 0, right_contrast = 0; ///< signed; 0 where the border was not used
  bool left_used = false, right_used = false;
  double evenness = 0; ///< mean of evennessAlong() over the borders used, 0 to 1
};

/// Cost: 30 to 150 us a trunk with the scan. Thread-safe.
TrackingResult trackTrunk(const Gradient &gradient, const PinholeCamera &camera, const TrackingPrediction &prediction,
                          const TrackingOptions &options);
} // namespace bole
