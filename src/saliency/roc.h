// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// How well a score tells near pixels from far ones.

#include <bole/camera.h>

#include <cstddef>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Area under the curve of true against false positives, from a histogram of scores in [0, 1].
///
/// Laws (each a test): .5 for scores that know nothing, 1 for a perfect one, 1 - area for the opposite score.
class RocCurve
{
public:
  /// \p score is high where the pixel is thought to be positive.
  void add(float score, bool positive);
  /// NaN where one of the classes is empty.
  double area() const;
  std::size_t count() const { return m_count; }

private:
  static constexpr std::size_t kBins = 4096;
  std::vector<double> m_positive = std::vector<double>(kBins, 0.), m_negative = std::vector<double>(kBins, 0.);
  std::size_t m_count = 0;
};

/// Marks pixels with texture (central difference above \p gradient of full scale per pixel) whose ray points above the
/// horizon; \p wRc is the rotation of the camera, w with z up.
vpImage<unsigned char> texturedAboveHorizon(const vpImage<unsigned char> &image, const PinholeCamera &camera,
                                            const Eigen::Matrix3d &wRc, double gradient = 0.02);
} // namespace bole
