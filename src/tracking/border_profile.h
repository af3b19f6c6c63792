// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The profile of an image across one border: the front end of both trackers, that of the map and vpMbTrunkTracker.
///
/// Idea: the energy that holds in textured forest is the absolute value of the *mean of the signed* gradient along a
/// border, since bark and leaves cancel in the sum. The mean is taken first, at every offset of a scan at once, and
/// gives a profile. A profile of a gradient image is the contrast itself; a profile of a grey image becomes the
/// contrast by one differentiation, because the derivative of a mean is the mean of the derivative. The local maxima of
/// the absolute contrast are the places where the border may be.
///
/// Offsets are sideways in the image: pixels of a row from the line, positive to the right.

#include "gradient/border_line.h"

#include <optional>
#include <vector>

namespace bole
{
/// A border in the image: steep lines are walked row by row, the others column by column.
struct ImageBorder
{
  BorderLine line;      ///< x over rows; y over columns where is_flat
  bool is_flat = false; ///< more than 45 degrees from the image's vertical

  bool isVisible() const { return line.rows() > 0; }
  double length() const; ///< [px]
  /// The point of the image on row (column) \p row of the line, \p offset_px sideways.
  Eigen::Vector2d at(double row, double offset_px = 0) const;
};

/// The visible part of the segment from \p foot to \p top (camera frame, a line of the plane through the camera centre
/// with the normal \p cn), in any direction. \p margin_px is kept off the edge of the image on both sides of the line.
ImageBorder imageBorder(const PinholeCamera &camera, const Eigen::Vector3d &cn, const Eigen::Vector3d &foot,
                        const Eigen::Vector3d &top, double margin_px);

/// Adds the grey levels across \p border on its row (column) \p row at the offsets -half .. half to \p sum, which holds
/// 2 half + 1 numbers. Linear between pixels; offsets outside the image repeat its edge.
void addAcross(const vpImage<unsigned char> &image, const ImageBorder &border, int row, int half, float *sum);

/// Mean of a gradient image \p g along \p line at the offsets -n/2 .. n/2, each half a pixel from the next, with
/// n = ceil(2 half_px). Offsets outside the image count as zero.
std::vector<float> meanAcross(const vpImage<float> &g, const BorderLine &line, double half_px);

/// Signed contrast [grey levels a pixel] of a grey profile with a step of 1 px: its derivative, blurred with 1 px. Zero
/// at the three offsets on each end.
void differentiate(const std::vector<float> &profile, std::vector<float> &contrast);

/// A local maximum of the absolute contrast.
struct BorderPeak
{
  double offset_px = 0; ///< sideways from the line, refined by a parabola
  double contrast = 0;  ///< signed, in the unit of the profile
};

/// The maxima of \p contrast, an odd number of values around offset 0 with a step of \p step_px, that are at least
/// \p least, in the order of their offsets.
std::vector<BorderPeak> peaksOf(const std::vector<float> &contrast, double step_px, double least);

/// How badly a contrast continues the one of the frames before, or how weak it is where there is none: a negative
/// log-likelihood, 0 to 4. Both in full scale a pixel.
double contrastCost(double contrast, const std::optional<double> &before);

/// The scan of the border of a trunk under its prediction. In a textured forest the basin of the energy is 1-2 px and
/// blur does not widen it, so the profile is scanned over the prediction's uncertainty and the pair of maxima (left,
/// right) is chosen that best fits strength, prediction and the signed contrast of the frames before.
///
/// Local maxima of abs(mean gradient) with the line moved by up to +-\p half_width_px, strongest first, at most
/// \p most. The profile has a step of half a pixel, full scale a pixel; peaks are refined by a parabola.
std::vector<BorderPeak> scanBorder(const vpImage<float> &g, const BorderLine &line, double half_width_px,
                                   double contrast_min, std::size_t most = 6);

struct PairPrior
{
  Eigen::Matrix2d covariance_px = Eigen::Matrix2d::Identity(); ///< of (left, right) offsets under the prediction
  std::optional<double> left_contrast, right_contrast;         ///< signed, from the frames before
};
struct PeakPair
{
  BorderPeak left, right;
  double cost = 0; ///< negative log-likelihood up to a constant
};
/// The best (left, right) pairs, lowest cost first, at most \p most. With an empty side the other stands alone.
std::vector<PeakPair> pairPeaks(const std::vector<BorderPeak> &left, const std::vector<BorderPeak> &right,
                                const PairPrior &prior, std::size_t most = 3);
} // namespace bole
