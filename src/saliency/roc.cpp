// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/roc.h"

#include <algorithm>
#include <limits>

namespace bole
{
void RocCurve::add(float score, bool positive)
{
  const float clamped = score > 0 ? std::min(score, 1.f) : 0.f; // NaN is 0
  const auto bin = static_cast<std::size_t>(clamped * (kBins - 1) + 0.5f);
  (positive ? m_positive : m_negative)[bin] += 1;
  ++m_count;
}

double RocCurve::area() const
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

vpImage<unsigned char> texturedAboveHorizon(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                            const Eigen::Matrix3d &wRc, double gradient)
{
  vpImage<unsigned char> mask(image.getHeight(), image.getWidth());
  mask = static_cast<unsigned char>(0);
  const double least = 255 * gradient * 255 * gradient;
  for (unsigned i = 1; i + 1 < image.getHeight(); ++i)
    for (unsigned j = 1; j + 1 < image.getWidth(); ++j) {
      const double gx = 0.5 * (image[i][j + 1] - image[i][j - 1]), gy = 0.5 * (image[i + 1][j] - image[i - 1][j]);
      const bool above = wRc.row(2).dot(camera.ray({j, i})) > 0;
      mask[i][j] = above && gx * gx + gy * gy > least;
    }
  return mask;
}
} // namespace bole
