// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/fast_math.h"
#include "saliency/plane_warp.h"

#include "geometry/so3.h"
#include "saliency/rotation_em.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kConvergedStep = 1e-4;   // [rad], 0.02 px at f = 200 px
constexpr float kTextureGradient = 0.01f; // [1/px]; below, intensity noise hides a pixel of motion

/// Gauss-Newton sums of one M-step.
struct NormalEquations
{
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  int textured = 0, used = 0;
};

/// Noise of one level: variances of the flow [px^2 of the level] and of intensity.
struct LevelNoise
{
  float background, foreground, intensity, prior_logit;
};

LevelNoise levelNoise(const SaliencyOptions &options, int level, bool wide)
{
  const double scale = std::ldexp(1.0, -level);
  // Without a gyro the start may be pixels off: the coarse levels accept that as background.
  const double floor_px = wide && level > options.finest_level ? 0.5 : 0.0;
  const double background = std::max(options.sigma_background_px * scale, floor_px);
  const double foreground = std::max(options.sigma_foreground_px * scale, 2 * background);
  // The mean of four pixels has half the noise.
  const double intensity = options.sigma_intensity * std::max(scale, 0.25);
  return {static_cast<float>(background * background), static_cast<float>(foreground * foreground),
          static_cast<float>(intensity * intensity),
          static_cast<float>(std::log(options.background_prior / (1 - options.background_prior)))};
}

/// What a pixel says: residual r, its derivative J with respect to phi, and the flow relative to zero.
struct PixelMeasurement
{
  float r, gx, gy;
  float j[3];
  float zero_flow; // g v, the change of intensity that the whole flow explains
};

/// E-step of one pixel (Eq. 10 and 11) in the log domain: log p(r | background) - log p(r | foreground).
float logRatio(const PixelMeasurement &m, const LevelNoise &noise, bool zero_mean, float &var_b, float &var_f)
{
  const float g2 = m.gx * m.gx + m.gy * m.gy;
  var_b = noise.intensity + g2 * noise.background;
  var_f = noise.intensity + g2 * noise.foreground;
  const float rf = zero_mean ? m.r - m.zero_flow : m.r;
  return 0.5f * (fastLog(var_f / var_b) - m.r * m.r / var_b + rf * rf / var_f);
}

class LevelPass
{
public:
  LevelPass(const PyramidLevel &previous, const PyramidLevel &current, const SaliencyOptions &options, int level,
            bool wide)
      : m_previous(previous), m_current(current), m_options(options), m_noise(levelNoise(options, level, wide))
  {
  }

  /// One E-step at \p pRc and the sums of the M-step; \p log_ratio is filled where given.
  NormalEquations operator()(const Eigen::Matrix3d &pRc, vpImage<float> *log_ratio) const
  {
    NormalEquations sums;
    const int height = m_current.camera.height, width = m_current.camera.width;
    const PlaneWarp warp(m_current.camera, Pose(pRc, Eigen::Vector3d::Zero()));
    const Eigen::Vector3d omega = logSo3(pRc);
    for (int i = 1; i + 1 < height; ++i)
      row(i, width, warp, omega, sums, log_ratio);
    return sums;
  }

private:
  void row(int i, int width, const PlaneWarp &warp, const Eigen::Vector3d &omega, NormalEquations &sums,
           vpImage<float> *log_ratio) const
  {
    const PinholeCamera &c = m_current.camera;
    const float fx = static_cast<float>(c.fx), fy = static_cast<float>(c.fy);
    const float y = static_cast<float>((i - c.cy) / c.fy);
    const float w[3] = {static_cast<float>(omega.x()), static_cast<float>(omega.y()), static_cast<float>(omega.z())};
    float H[6] = {0, 0, 0, 0, 0, 0}, b[3] = {0, 0, 0};
    for (int j = 1; j + 1 < width; ++j) {
      const float x = static_cast<float>((j - c.cx) / c.fx);
      // V of Eq. 14
      const float V[6] = {fx * x * y, -fx * (1 + x * x), fx * y, fy * (1 + y * y), -fy * x * y, -fy * x};
      float flow[2] = {V[0] * w[0] + V[1] * w[1] + V[2] * w[2], V[3] * w[0] + V[4] * w[1] + V[5] * w[2]};
      if (!m_options.linear_flow) {
        const Eigen::Vector3f p = warp.H * Eigen::Vector3f(static_cast<float>(j), static_cast<float>(i), 1);
        flow[0] = p.z() > 0 ? j - p.x() / p.z() : -1e9f;
        flow[1] = p.z() > 0 ? i - p.y() / p.z() : -1e9f;
      }
      const Bilinear sample(j - flow[0], i - flow[1], width, c.height);
      if (!sample.inside)
        continue;
      PixelMeasurement m;
      m.gx = 0.5f * (sample(m_previous.gradient_x) + m_current.gradient_x[i][j]);
      m.gy = 0.5f * (sample(m_previous.gradient_y) + m_current.gradient_y[i][j]);
      m.r = m_current.image[i][j] - sample(m_previous.image);
      m.zero_flow = m.gx * flow[0] + m.gy * flow[1];
      for (int k = 0; k < 3; ++k)
        m.j[k] = m.gx * V[k] + m.gy * V[3 + k];
      float var_b, var_f;
      const float ratio = logRatio(m, m_noise, m_options.foreground_mean_zero, var_b, var_f);
      if (log_ratio)
        (*log_ratio)[i][j] = ratio;
      ++sums.used;
      sums.textured += m.gx * m.gx + m.gy * m.gy > kTextureGradient * kTextureGradient;
      // M-step (Eq. 16): expected negative log-likelihood; a foreground of mean zero does not depend on omega.
      const float p_b = 1.f / (1.f + fastExp(-(ratio + m_noise.prior_logit)));
      const float weight = p_b / var_b + (m_options.foreground_mean_zero ? 0.f : (1 - p_b) / var_f);
      const float wr = weight * m.r;
      H[0] += weight * m.j[0] * m.j[0], H[1] += weight * m.j[0] * m.j[1], H[2] += weight * m.j[0] * m.j[2];
      H[3] += weight * m.j[1] * m.j[1], H[4] += weight * m.j[1] * m.j[2], H[5] += weight * m.j[2] * m.j[2];
      b[0] += wr * m.j[0], b[1] += wr * m.j[1], b[2] += wr * m.j[2];
    }
    Eigen::Matrix3d rowH;
    rowH << H[0], H[1], H[2], H[1], H[3], H[4], H[2], H[4], H[5];
    sums.H += rowH;
    sums.g += Eigen::Vector3d(b[0], b[1], b[2]);
  }

  const PyramidLevel &m_previous, &m_current;
  const SaliencyOptions &m_options;
  LevelNoise m_noise;
};

Eigen::Matrix3d inverseOf(const Eigen::Matrix3d &A) { return A.ldlt().solve(Eigen::Matrix3d::Identity()); }
} // namespace

RotationEm estimateRotation(const ImagePyramid &previous, const ImagePyramid &current,
                            const std::optional<RotationPrior> &prior, const Eigen::Matrix3d &start,
                            const SaliencyOptions &options)
{
  RotationEm result;
  result.pRc = prior ? prior->pRc : start;
  const bool wide = !prior;
  // A blank image leaves this: any rotation up to half a turn a second or so.
  const Eigen::Matrix3d vague = Eigen::Matrix3d::Identity() / (0.3 * 0.3);
  const Eigen::Matrix3d prior_information = prior && options.use_rotation_prior ? inverseOf(prior->covariance) : vague;
  const int finest = std::min(options.finest_level, current.levels() - 1);
  const int coarsest = prior ? std::min(finest + 1, current.levels() - 1) : current.levels() - 1;
  Eigen::Matrix3d information = prior_information;
  for (int level = coarsest; level >= finest; --level) {
    const LevelPass pass(previous[level], current[level], options, level, wide);
    for (int iteration = 0; iteration < options.iterations; ++iteration) {
      const NormalEquations sums = pass(result.pRc, nullptr);
      const Eigen::Vector3d off_prior =
          prior && options.use_rotation_prior ? logSo3(prior->pRc.transpose() * result.pRc) : Eigen::Vector3d::Zero();
      // The images' own step, trusted no further than near things may pull it.
      const Eigen::Matrix3d H = sums.H + 1e-3 * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d image_step = H.ldlt().solve(sums.g);
      const double pull = options.sigma_rotation_pull;
      const Eigen::Matrix3d image_information =
          inverseOf(inverseOf(H) * options.sample_correlation + pull * pull * Eigen::Matrix3d::Identity());
      information = image_information + prior_information;
      const Eigen::Vector3d step =
          -information.ldlt().solve(image_information * image_step + prior_information * off_prior);
      if (!step.allFinite() || step.norm() > 0.5)
        break;
      result.pRc = orthonormalized(result.pRc * expSo3(step));
      ++result.iterations;
      result.converged = step.norm() < kConvergedStep;
      if (result.converged)
        break;
    }
  }
  result.covariance = inverseOf(information);
  result.log_ratio.resize(current[finest].image.getHeight(), current[finest].image.getWidth());
  result.log_ratio = 0.f;
  const NormalEquations last =
      LevelPass(previous[finest], current[finest], options, finest, false)(result.pRc, &result.log_ratio);
  result.texture = last.used > 0 ? static_cast<double>(last.textured) / last.used : 0;
  return result;
}
} // namespace bole
