// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/plane_warp.h"

#include "saliency/noise_learner.h"

#include "geometry/median.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kPixelStep = 3;   // every third pixel of every third row is enough
constexpr float kFlat = 0.004f; // [1/px]; below, a pixel of motion changes less than a grey level
constexpr float kSteep = 0.04f; // [1/px]; above, intensity noise is small against a pixel of motion
constexpr std::size_t kLeastCount = 1000;

/// Standard deviation of what has these magnitudes, or \p otherwise.
double deviation(std::vector<float> magnitudes, double otherwise)
{
  if (magnitudes.size() < kLeastCount)
    return otherwise;
  return 1.4826 * medianOf({magnitudes.begin(), magnitudes.end()});
}
} // namespace

SaliencyNoiseLearner::SaliencyNoiseLearner(const PinholeCamera &camera, const SaliencyOptions &start)
    : m_camera(camera), m_start(start)
{
}

void SaliencyNoiseLearner::add(const vpImage<unsigned char> &previous, const vpImage<unsigned char> &current,
                               const Saliency &saliency)
{
  if (saliency.status != SaliencyStatus::with_gyro && saliency.status != SaliencyStatus::without_gyro)
    return;
  const ImagePyramid before(previous, m_camera, 1), now(current, m_camera, 1);
  const PlaneWarp warp(m_camera, Pose(saliency.pRc, Eigen::Vector3d::Zero()));
  for (int i = 1; i + 1 < m_camera.height; i += kPixelStep)
    for (int j = 1; j + 1 < m_camera.width; j += kPixelStep) {
      const Eigen::Vector3f p = warp.H * Eigen::Vector3f(static_cast<float>(j), static_cast<float>(i), 1);
      const Bilinear sample(p.x() / p.z(), p.y() / p.z(), m_camera.width, m_camera.height);
      if (!sample.inside)
        continue;
      const float gx = 0.5f * (now[0].gradient_x[i][j] + sample(before[0].gradient_x));
      const float gy = 0.5f * (now[0].gradient_y[i][j] + sample(before[0].gradient_y));
      const float here = now[0].image[i][j], r = std::abs(here - sample(before[0].image));
      const float g = std::hypot(gx, gy);
      const bool exposed = here > 0.02f && here < 0.98f; // a clipped pixel shows no noise
      if (g < kFlat && exposed)
        m_intensity.push_back(r / std::sqrt(2.f));
      else if (g > kSteep && saliency.isKnown(static_cast<unsigned>(i), static_cast<unsigned>(j)))
        (saliency.p_background[i][j] > 0.5f ? m_background : m_foreground).push_back(r / g);
    }
}

SaliencyOptions SaliencyNoiseLearner::learnt() const
{
  SaliencyOptions options = m_start;
  options.sigma_intensity = std::clamp(deviation(m_intensity, m_start.sigma_intensity), 0.002, 0.5);
  options.sigma_background_px = std::clamp(deviation(m_background, m_start.sigma_background_px), 0.05, 10.);
  options.sigma_foreground_px =
      std::clamp(deviation(m_foreground, m_start.sigma_foreground_px), 1.5 * options.sigma_background_px, 100.);
  if (count() >= kLeastCount)
    options.background_prior =
        std::clamp(static_cast<double>(m_background.size()) / static_cast<double>(count()), 0.05, 0.95);
  return options;
}
} // namespace bole
