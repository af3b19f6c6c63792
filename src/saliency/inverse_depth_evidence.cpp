// SPDX-License-Identifier: GPL-2.0-or-later
#include "fast_math.h"
#include "plane_warp.h"

#include <bole/saliency/flow_matrix.h>
#include <bole/saliency/inverse_depth_evidence.h>

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr float kOutside = 1;        // residual where the older image ends: as bad as any, so that it says nothing
constexpr double kUnrelatedPx = 2.5; // two unrelated places of the same texture differ as if so far apart

std::size_t index(int i, int j, int width, int count)
{
  return (static_cast<std::size_t>(i) * static_cast<std::size_t>(width) + static_cast<std::size_t>(j)) *
         static_cast<std::size_t>(count);
}
} // namespace

InverseDepthEvidence::InverseDepthEvidence(const PinholeCamera &camera, int level, const SaliencyOptions &options)
  : m_camera(camera), m_options(options), m_count(options.inverse_depths)
{
  const double sigma = options.sigma_intensity * std::max(std::ldexp(1.0, -level), 0.25);
  m_intensity_variance = 2 * sigma * sigma;
  const double rho_max = 1 / options.min_range;
  int near_count = 0;
  for (int k = 0; k < m_count; ++k) {
    const double share = static_cast<double>(k) / (m_count - 1);
    m_rho.push_back(static_cast<float>(rho_max * share * share));
    near_count += m_rho.back() * options.near_range > 1;
  }
  for (float rho : m_rho) {
    const bool near = rho * options.near_range > 1;
    m_log_prior.push_back(static_cast<float>(
        near ? std::log(options.near_prior / near_count)
             : std::log((1 - options.near_prior) / (m_count - near_count))));
  }
  m_prior_log_odds = static_cast<float>(std::log(options.near_prior / (1 - options.near_prior)));
  clear();
}

void InverseDepthEvidence::clear()
{
  m_evidence.assign(index(m_camera.height, 0, m_camera.width, m_count), 0.f);
  m_scratch.assign(m_evidence.size(), 0.f);
  m_residuals.assign(m_evidence.size(), 0.f);
}

void InverseDepthEvidence::predict(const Pose &pMc)
{
  const PlaneWarp warp(m_camera, pMc);
  const int width = m_camera.width, height = m_camera.height;
  const float decay = static_cast<float>(m_options.evidence_decay);
  const float index_scale = (m_count - 1) / std::sqrt(m_rho.back());
  const std::size_t next_row = index(1, 0, width, m_count), next = static_cast<std::size_t>(m_count);
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      const Eigen::Vector3f base = warp.H * Eigen::Vector3f(static_cast<float>(j), static_cast<float>(i), 1);
      float *out = &m_scratch[index(i, j, width, m_count)];
      for (int k = 0; k < m_count; ++k) {
        out[k] = 0;
        const float z = base.z() + m_rho[k] * warp.e.z();
        if (z < 0.1f)
          continue;
        const float inverse_z = 1 / z;
        const Bilinear sample((base.x() + m_rho[k] * warp.e.x()) * inverse_z,
                              (base.y() + m_rho[k] * warp.e.y()) * inverse_z, width, height);
        if (!sample.inside)
          continue;
        const float position = std::min(std::sqrt(m_rho[k] * inverse_z) * index_scale, m_count - 1.001f);
        const int step = static_cast<int>(position);
        const float c = position - step;
        const float *p = &m_evidence[index(sample.i, sample.j, width, m_count) + static_cast<std::size_t>(step)];
        const auto at = [c](const float *v) { return v[0] + c * (v[1] - v[0]); };
        const float upper = at(p) + sample.a * (at(p + next) - at(p));
        const float lower = at(p + next_row) + sample.a * (at(p + next_row + next) - at(p + next_row));
        out[k] = decay * (upper + sample.b * (lower - upper));
      }
    }
  }
  m_evidence.swap(m_scratch);
}

void InverseDepthEvidence::add(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc,
                               const MotionNoise &noise)
{
  squaredResiduals(older, current, oMc);
  averageOverWindow();
  addLikelihood(current, oMc, noise);
}

void InverseDepthEvidence::squaredResiduals(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc)
{
  const PlaneWarp warp(m_camera, oMc);
  const int width = m_camera.width, height = m_camera.height;
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      const Eigen::Vector3f base = warp.H * Eigen::Vector3f(static_cast<float>(j), static_cast<float>(i), 1);
      const float here = current.image[i][j];
      float *out = &m_residuals[index(i, j, width, m_count)];
      for (int k = 0; k < m_count; ++k) {
        const float z = base.z() + m_rho[k] * warp.e.z();
        const float inverse_z = z > 0.1f ? 1 / z : 1e9f;
        const Bilinear sample((base.x() + m_rho[k] * warp.e.x()) * inverse_z,
                              (base.y() + m_rho[k] * warp.e.y()) * inverse_z, width, height);
        const float r = sample.inside ? here - sample(older.image) : kOutside;
        out[k] = r * r;
      }
    }
  }
}

namespace
{
/// Running mean of vectors of \p count floats along a line of \p n, \p stride apart; the ends repeat.
void runningMean(const float *in, float *out, int n, std::size_t stride, int count, int window, float *sum)
{
  const int half = window / 2;
  const float scale = 1.f / window;
  const auto at = [=](int i) { return in + static_cast<std::size_t>(std::clamp(i, 0, n - 1)) * stride; };
  std::fill(sum, sum + count, 0.f);
  for (int i = -half; i <= half; ++i)
    for (int k = 0; k < count; ++k)
      sum[k] += at(i)[k];
  for (int i = 0; i < n; ++i) {
    float *o = out + static_cast<std::size_t>(i) * stride;
    const float *enter = at(i + half + 1), *leave = at(i - half);
    for (int k = 0; k < count; ++k) {
      o[k] = sum[k] * scale;
      sum[k] += enter[k] - leave[k];
    }
  }
}
} // namespace

void InverseDepthEvidence::averageOverWindow()
{
  const int width = m_camera.width, height = m_camera.height;
  const std::size_t row = index(1, 0, width, m_count), pixel = static_cast<std::size_t>(m_count);
  std::vector<float> sum(row);
  for (int i = 0; i < height; ++i)
    runningMean(&m_residuals[static_cast<std::size_t>(i) * row], &m_scratch[static_cast<std::size_t>(i) * row], width,
                pixel, m_count, m_options.window_width_px, sum.data());
  // down the image, a whole row at a time
  runningMean(m_scratch.data(), m_residuals.data(), height, row, static_cast<int>(row), m_options.window_height_px,
              sum.data());
}

void InverseDepthEvidence::addLikelihood(const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise)
{
  const int width = m_camera.width, height = m_camera.height;
  std::vector<float> g2(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)), mean(g2.size());
  std::vector<float> sum(static_cast<std::size_t>(width));
  for (std::size_t p = 0; p < g2.size(); ++p) {
    const float gx = current.gradient_x.bitmap[p], gy = current.gradient_y.bitmap[p];
    g2[p] = gx * gx + gy * gy;
  }
  for (int i = 0; i < height; ++i)
    runningMean(&g2[static_cast<std::size_t>(i * width)], &mean[static_cast<std::size_t>(i * width)], width, 1, 1,
                m_options.window_width_px, sum.data());
  runningMean(mean.data(), g2.data(), height, static_cast<std::size_t>(width), width, m_options.window_height_px,
              sum.data());

  const double f = 0.5 * (m_camera.fx + m_camera.fy);
  const double parallax = medianParallax(m_camera, oMc, 1.0); // [px m]
  std::vector<float> flow_variance(m_rho.size());
  for (int k = 0; k < m_count; ++k) {
    const double step = m_rho[std::min(k + 1, m_count - 1)] - m_rho[std::min(k, m_count - 2)];
    const double quantisation = parallax * step / std::sqrt(12.0);
    const double shift = f * m_rho[k] * noise.translation, turn = f * noise.rotation;
    flow_variance[k] = static_cast<float>(quantisation * quantisation + shift * shift + turn * turn);
  }
  // log of the likelihood of the window's residual, a Student's t, over that of an unrelated window; never below 0:
  // where no step matches (the place was hidden, or left the image) none is preferred.
  const float weight = static_cast<float>(m_options.evidence_scale * 2.5);
  const float intensity = static_cast<float>(m_intensity_variance);
  constexpr float kUnrelated = static_cast<float>(kUnrelatedPx * kUnrelatedPx);
  for (std::size_t p = 0; p < g2.size(); ++p) {
    const float *r2 = &m_residuals[p * static_cast<std::size_t>(m_count)];
    float *out = &m_evidence[p * static_cast<std::size_t>(m_count)];
    const float unrelated = intensity + g2[p] * kUnrelated;
    for (int k = 0; k < m_count; ++k) {
      const float variance = intensity + g2[p] * flow_variance[k];
      const float ratio = 2 * std::sqrt(unrelated * variance) / (variance + r2[k]);
      out[k] += weight * std::max(0.f, fastLog(ratio));
    }
  }
}

vpImage<float> InverseDepthEvidence::logOddsNear() const
{
  vpImage<float> result(m_camera.height, m_camera.width);
  for (unsigned p = 0; p < result.getSize(); ++p) {
    const float *e = &m_evidence[p * static_cast<std::size_t>(m_count)];
    float best = e[0];
    for (int k = 1; k < m_count; ++k)
      best = std::max(best, e[k]);
    float near = 1e-20f, far = 1e-20f;
    for (int k = 0; k < m_count; ++k)
      (m_rho[k] * m_options.near_range > 1 ? near : far) += fastExp(e[k] - best + m_log_prior[k]);
    result.bitmap[p] = std::log(near / far);
  }
  return result;
}

vpImage<float> InverseDepthEvidence::inverseDepth() const
{
  vpImage<float> result(m_camera.height, m_camera.width);
  for (unsigned p = 0; p < result.getSize(); ++p) {
    const float *e = &m_evidence[p * static_cast<std::size_t>(m_count)];
    const float best = *std::max_element(e, e + m_count);
    float sum = 0, weighted = 0;
    for (int k = 0; k < m_count; ++k) {
      const float w = fastExp(e[k] - best + m_log_prior[k]);
      sum += w;
      weighted += w * m_rho[k];
    }
    result.bitmap[p] = weighted / sum;
  }
  return result;
}

double medianParallax(const PinholeCamera &camera, const Pose &oMc, double range)
{
  std::vector<double> flows;
  const Eigen::Vector3d ct = oMc.R.transpose() * oMc.t;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) {
      const Eigen::Vector2d u((j + 0.5) * camera.width / 8, (i + 0.5) * camera.height / 8);
      flows.push_back((translationFlowMatrix(camera, u) * ct).norm() / range);
    }
  std::nth_element(flows.begin(), flows.begin() + 32, flows.end());
  return flows[32];
}
} // namespace bole
