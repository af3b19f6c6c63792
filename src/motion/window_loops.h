// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
// Private to the stage: the loops of Lucas and Kanade over one window, and of the corners' response over one image.

#include <cstddef>
#include <vector>

namespace bole
{
constexpr int kWindow_px = 11;   ///< side of the Lucas-Kanade window, odd
constexpr int kWindowLanes = 16; ///< numbers a row is kept in, so that it is whole registers
constexpr int kWindowReach = 20; ///< pixels that an image must go on beyond its edge

/// Grey levels of an image that goes on by kWindowReach pixels beyond each edge.
struct GreyPlane
{
  const unsigned char *pixels = nullptr; ///< of the first row and column
  std::ptrdiff_t stride = 0;
  int width = 0, height = 0;
};

/// A window of the image that is searched for, with its gradient; 0 in the lanes that are none of it. In whole numbers,
/// as OpenCV has them: 32 for a grey level and for a grey level a pixel.
struct Window
{
  short grey[kWindow_px * kWindowLanes], gradient_x[kWindow_px * kWindowLanes], gradient_y[kWindow_px * kWindowLanes];
  float xx = 0, xy = 0, yy = 0; ///< sums of the products of the gradient
};

/// The window whose first pixel is (x, y), which may be outside by kWindow_px; beyond the image there is no gradient.
void cutWindow(const GreyPlane &image, float x, float y, Window &window);

/// Sums of the difference between \p image at (x, y) and \p window, times the gradient of the window; 32 for a grey
/// level and for a grey level a pixel.
void mismatch(const GreyPlane &image, float x, float y, const Window &window, float &by_x, float &by_y);

/// Memory of cornerResponse().
struct CornerScratch
{
  std::vector<int> products, sums;
  std::vector<float> most;
};

constexpr int kCornerMargin = 3;
/// Smaller eigenvalue of the gradient moments over 5 x 5 pixels (Shi and Tomasi), grey from 0 to 1: what
/// cv::cornerMinEigenVal(image, response, 5, 3) gives; 0 in the kCornerMargin outermost rows and columns. Returns the
/// largest.
float cornerResponse(const unsigned char *image, int width, int height, CornerScratch &scratch, float *response);

/// 1 where a response of the row, which has one above and one below it, is beyond \p threshold and no neighbour's is
/// larger; 0 elsewhere. The first and the last pixel are left as they are.
void peaksOfRow(const float *row, int width, float threshold, unsigned char *is_peak);
} // namespace bole
