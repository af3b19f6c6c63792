// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/fast_math.h"
#include "saliency/plane_warp.h"

#include "saliency/flow_matrix.h"
#include "saliency/inverse_depth_evidence.h"

#include "geometry/median.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr int kInverseDepths = 16;   // steps of the sweep from infinity to min_range
constexpr double kNearPrior = 0.3;   // p(nearer than near_range) before looking
constexpr float kOutside = 1;        // residual where the older image ends: as bad as any, so that it says nothing
constexpr double kUnrelatedPx = 2.5; // two unrelated places of the same texture differ as if so far apart

std::size_t index(int i, int j, int width, int count)
{
  return (static_cast<std::size_t>(i) * static_cast<std::size_t>(width) + static_cast<std::size_t>(j)) *
         static_cast<std::size_t>(count);
}
} // namespace

InverseDepthEvidence::InverseDepthEvidence(const PinholeCamera &camera, int level, const SaliencyOptions &options)
    : m_camera(camera),
      m_options(options),
      m_count(kInverseDepths),
      m_rows((camera.height + kRowStep - 1) / kRowStep),
      m_window_rows(options.window_height_px / kRowStep | 1)
{
  const double sigma = options.sigma_residual * std::max(std::ldexp(1.0, -level), 0.25);
  m_intensity_variance = 2 * sigma * sigma;
  const double rho_max = 1 / options.min_range;
  for (int k = 0; k < m_count; ++k) {
    const double share = static_cast<double>(k) / (m_count - 1);
    m_rho.push_back(static_cast<float>(rho_max * share * share));
    m_first_near += m_rho.back() * options.near_range <= 1;
  }
  const double far_count = static_cast<double>(m_first_near), near_count = m_count - far_count;
  for (std::size_t k = 0; k < m_rho.size(); ++k)
    m_log_prior.push_back(static_cast<float>(k < m_first_near ? std::log((1 - kNearPrior) / far_count)
                                                              : std::log(kNearPrior / near_count)));
  m_prior_log_odds = static_cast<float>(std::log(kNearPrior / (1 - kNearPrior)));
  clear();
}

void InverseDepthEvidence::clear()
{
  m_evidence.assign(index(m_rows, 0, m_camera.width, m_count), 0.f);
  m_scratch.assign(m_evidence.size(), 0.f);
  m_residuals.assign(m_evidence.size(), 0.f);
}

namespace
{
/// Where the steps of one pixel come from in the older image.
class StepPositions
{
public:
  StepPositions(const PinholeCamera &camera, const Pose &oMc, const std::vector<float> &rho)
      : m_warp(camera, oMc),
        m_rho(rho),
        m_max_x(static_cast<float>(camera.width) - 1.001f),
        m_max_y(static_cast<float>(camera.height) - 1.001f),
        x(rho.size()),
        y(rho.size()),
        inverse_z(rho.size())
  {
  }

  void at(int u, int v)
  {
    const Eigen::Vector3f base = m_warp.H * Eigen::Vector3f(static_cast<float>(u), static_cast<float>(v), 1);
    const float bx = base.x(), by = base.y(), bz = base.z(), ex = m_warp.e.x(), ey = m_warp.e.y(), ez = m_warp.e.z();
    const std::size_t count = m_rho.size();
    const float *rho = m_rho.data();
    float *px = x.data(), *py = y.data(), *pz = inverse_z.data();
    for (std::size_t k = 0; k < count; ++k) {
      const float z = bz + rho[k] * ez;
      // Behind the older camera: far outside.
      pz[k] = z > 0.1f ? 1 / z : -1e9f;
      px[k] = (bx + rho[k] * ex) * pz[k];
      py[k] = (by + rho[k] * ey) * pz[k];
    }
    // The steps lie on a segment, in order, so that its ends speak for all.
    all_inside = pz[0] > 0 && pz[count - 1] > 0 && inside(0) && inside(count - 1);
  }
  bool inside(std::size_t k) const
  {
    return x[k] >= 0 && y[k] >= 0 && x[k] <= m_max_x && y[k] <= m_max_y && inverse_z[k] > 0; // false for NaN
  }

private:
  PlaneWarp m_warp;
  const std::vector<float> &m_rho;
  float m_max_x, m_max_y;

public:
  std::vector<float> x, y, inverse_z;
  bool all_inside = false;
};
} // namespace

void InverseDepthEvidence::predict(const Pose &pMc)
{
  StepPositions from(m_camera, pMc, m_rho);
  const int width = m_camera.width;
  const std::size_t count = m_rho.size();
  const float decay = static_cast<float>(m_options.evidence_decay), last_step = static_cast<float>(count) - 1.001f;
  for (int i = 0; i < m_rows; ++i) {
    for (int j = 0; j < width; ++j) {
      from.at(j, i * kRowStep);
      float *out = &m_scratch[index(i, j, width, m_count)];
      for (std::size_t k = 0; k < count; ++k) {
        if (!from.all_inside && !from.inside(k)) {
          out[k] = 0;
          continue;
        }
        // Steps go with the square root of the inverse depth, which in the older frame is rho / z.
        const float position = std::min(static_cast<float>(k) * std::sqrt(from.inverse_z[k]), last_step);
        const int step = static_cast<int>(position), column = static_cast<int>(from.x[k]);
        const int row = std::min(static_cast<int>(from.y[k] * (1.f / kRowStep) + 0.5f), m_rows - 1);
        const float a = from.x[k] - static_cast<float>(column), c = position - static_cast<float>(step);
        const float *p = &m_evidence[index(row, column, width, m_count) + static_cast<std::size_t>(step)];
        const float left = p[0] + c * (p[1] - p[0]), right = p[count] + c * (p[count + 1] - p[count]);
        out[k] = decay * (left + a * (right - left));
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
  StepPositions from(m_camera, oMc, m_rho);
  const int width = m_camera.width;
  const std::size_t count = m_rho.size(), stride = older.image.getWidth();
  for (int i = 0; i < m_rows; ++i) {
    const float *here = current.image[static_cast<unsigned>(i * kRowStep)];
    for (int j = 0; j < width; ++j) {
      from.at(j, i * kRowStep);
      float *out = &m_residuals[index(i, j, width, m_count)];
      for (std::size_t k = 0; k < count; ++k) {
        if (!from.all_inside && !from.inside(k)) {
          out[k] = kOutside * kOutside;
          continue;
        }
        const int column = static_cast<int>(from.x[k]), row = static_cast<int>(from.y[k]);
        const float a = from.x[k] - static_cast<float>(column), b = from.y[k] - static_cast<float>(row);
        const float *p = older.image.bitmap + static_cast<std::size_t>(row) * stride + column, *q = p + stride;
        const float upper = p[0] + a * (p[1] - p[0]), lower = q[0] + a * (q[1] - q[0]);
        const float r = here[j] - upper - b * (lower - upper);
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
  const int width = m_camera.width, height = m_rows;
  const std::size_t row = index(1, 0, width, m_count), pixel = static_cast<std::size_t>(m_count);
  std::vector<float> sum(row);
  for (int i = 0; i < height; ++i)
    runningMean(&m_residuals[static_cast<std::size_t>(i) * row], &m_scratch[static_cast<std::size_t>(i) * row], width,
                pixel, m_count, m_options.window_width_px, sum.data());
  // down the image, a whole row at a time
  runningMean(m_scratch.data(), m_residuals.data(), height, row, static_cast<int>(row), m_window_rows, sum.data());
}

void InverseDepthEvidence::addLikelihood(const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise)
{
  const int width = m_camera.width, height = m_rows;
  std::vector<float> g2(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)), mean(g2.size());
  std::vector<float> sum(static_cast<std::size_t>(width));
  for (int i = 0; i < height; ++i) {
    const float *gx = current.gradient_x[i * kRowStep], *gy = current.gradient_y[i * kRowStep];
    for (int j = 0; j < width; ++j)
      g2[static_cast<std::size_t>(i * width + j)] = gx[j] * gx[j] + gy[j] * gy[j];
  }
  for (int i = 0; i < height; ++i)
    runningMean(&g2[static_cast<std::size_t>(i * width)], &mean[static_cast<std::size_t>(i * width)], width, 1, 1,
                m_options.window_width_px, sum.data());
  runningMean(mean.data(), g2.data(), height, static_cast<std::size_t>(width), width, m_window_rows, sum.data());

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
  const float weight = 2.5f;
  const float intensity = static_cast<float>(m_intensity_variance);
  constexpr float kUnrelated = static_cast<float>(kUnrelatedPx * kUnrelatedPx);
  for (std::size_t p = 0; p < g2.size(); ++p) {
    const float *r2 = &m_residuals[p * static_cast<std::size_t>(m_count)];
    float *out = &m_evidence[p * static_cast<std::size_t>(m_count)];
    const float unrelated = intensity + g2[p] * kUnrelated;
    for (int k = 0; k < m_count; ++k) {
      const float variance = intensity + g2[p] * flow_variance[k];
      if (!m_options.relative_evidence) {
        out[k] += weight * fastLog(std::sqrt(variance) / (variance + r2[k]));
        continue;
      }
      // Without texture both variances are the same, and even a perfect match says nothing.
      const float gain = std::max(2 - variance / unrelated, 0.5f);
      const float ratio = gain * std::sqrt(unrelated * variance) / (variance + r2[k]);
      out[k] += weight * std::max(0.f, fastLog(ratio));
    }
  }
}

vpImage<float> InverseDepthEvidence::logOddsNear() const
{
  vpImage<float> log_odds(static_cast<unsigned>(m_rows), static_cast<unsigned>(m_camera.width));
  const std::size_t count = m_rho.size();
  std::vector<float> weight(count);
  for (unsigned p = 0; p < log_odds.getSize(); ++p) {
    const float *e = &m_evidence[p * count];
    const float best = *std::max_element(e, e + count);
    for (std::size_t k = 0; k < count; ++k)
      weight[k] = fastExp(e[k] - best + m_log_prior[k]);
    float far = 1e-20f, near = 1e-20f;
    for (std::size_t k = 0; k < count; ++k)
      (k < m_first_near ? far : near) += weight[k];
    log_odds.bitmap[p] = fastLog(near / far);
  }
  return log_odds;
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
  return medianOf(std::move(flows));
}
} // namespace bole
