// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How well a score tells near pixels from far ones.

#include <bole/camera.h>

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole::support
{
/// Area under the curve of true against false positives, from a histogram of scores in [0, 1].
class RocCurve
{
public:
  /// \p score is high where the pixel is thought to be positive.
  void add(float score, bool positive)
  {
    const float clamped = score > 0 ? std::min(score, 1.f) : 0.f; // NaN is 0
    const auto bin = static_cast<std::size_t>(clamped * (kBins - 1) + 0.5f);
    (positive ? m_positive : m_negative)[bin] += 1;
    ++m_count;
  }
  /// NaN where one of the classes is empty.
  double area() const
  {
    double positives = 0, negatives = 0, area = 0;
    for (std::size_t bin = 0; bin < kBins; ++bin) {
      // A pair of equal scores counts half.
      area += m_positive[bin] * (negatives + 0.5 * m_negative[bin]);
      positives += m_positive[bin];
      negatives += m_negative[bin];
    }
    return positives > 0 && negatives > 0 ? area / (positives * negatives) : std::numeric_limits<double>::quiet_NaN();
  }
  std::size_t count() const { return m_count; }

private:
  static constexpr std::size_t kBins = 4096;
  std::vector<double> m_positive = std::vector<double>(kBins, 0.), m_negative = std::vector<double>(kBins, 0.);
  std::size_t m_count = 0;
};

/// Marks pixels with texture (central difference above 2 % of full scale a pixel) whose ray points above the horizon;
/// \p wRc is the rotation of the camera, w with z up.
inline vpImage<unsigned char> texturedAboveHorizon(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                                   const Eigen::Matrix3d &wRc)
{
  constexpr double kGradient = 0.02 * 255;
  vpImage<unsigned char> mask(image.getHeight(), image.getWidth());
  mask = static_cast<unsigned char>(0);
  for (unsigned i = 1; i + 1 < image.getHeight(); ++i)
    for (unsigned j = 1; j + 1 < image.getWidth(); ++j) {
      const double gx = 0.5 * (image[i][j + 1] - image[i][j - 1]), gy = 0.5 * (image[i + 1][j] - image[i - 1][j]);
      const bool above = wRc.row(2).dot(camera.ray({j, i})) > 0;
      mask[i][j] = above && gx * gx + gy * gy > kGradient * kGradient;
    }
  return mask;
}
} // namespace bole::support
