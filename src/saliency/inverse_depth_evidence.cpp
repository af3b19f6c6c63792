// SPDX-License-Identifier: GPL-2.0-or-later

#include "geometry/median.h"
#include "saliency/saliency.h"
#include "saliency/saliency_loops.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kNearPrior = 0.3;      // p(nearer than near_range) before looking
constexpr double kResidualSigma = 0.05; // 1 = full scale; above a pixel's noise: light, leaves, model

std::size_t index(int i, int j, int width)
{
  return (static_cast<std::size_t>(i) * static_cast<std::size_t>(width) + static_cast<std::size_t>(j)) *
         static_cast<std::size_t>(kInverseDepths);
}
} // namespace

InverseDepthEvidence::InverseDepthEvidence(const PinholeCamera &camera, int level, const SaliencyOptions &options)
    : m_camera(camera),
      m_options(options),
      m_rows((camera.height + kRowStep - 1) / kRowStep),
      m_window_rows(options.window_height_px / kRowStep | 1)
{
  const double sigma = kResidualSigma * std::max(std::ldexp(1.0, -level), 0.25);
  m_intensity_variance = 2 * sigma * sigma;
  const double rho_max = 1 / options.min_range;
  for (int k = 0; k < kInverseDepths; ++k) {
    const double share = static_cast<double>(k) / (kInverseDepths - 1);
    m_rho.push_back(static_cast<float>(rho_max * share * share));
    m_first_near += m_rho.back() * options.near_range <= 1;
  }
  const double far_count = static_cast<double>(m_first_near), near_count = kInverseDepths - far_count;
  for (std::size_t k = 0; k < m_rho.size(); ++k)
    m_log_prior.push_back(static_cast<float>(k < m_first_near ? std::log((1 - kNearPrior) / far_count)
                                                              : std::log(kNearPrior / near_count)));
  m_prior_log_odds = static_cast<float>(std::log(kNearPrior / (1 - kNearPrior)));
  clear();
}

void InverseDepthEvidence::clear()
{
  m_evidence.assign(index(m_rows, 0, m_camera.width), 0.f);
  m_scratch.assign(m_evidence.size(), 0.f);
  m_residuals.assign(m_evidence.size(), 0.f);
}

namespace
{
/// Rows of the working level as they are seen from another camera.
class RowsSeen
{
public:
  RowsSeen(const PinholeCamera &camera, const Pose &oMc, const std::vector<float> &rho) : m_warp(camera, oMc)
  {
    m_row.rho = rho.data();
    m_row.max_x = static_cast<float>(camera.width) - 1.001f;
    m_row.max_y = static_cast<float>(camera.height) - 1.001f;
    Eigen::Vector3f::Map(m_row.by_column) = m_warp.H.col(0);
    Eigen::Vector3f::Map(m_row.e) = m_warp.e;
  }
  const RowWarp &operator()(int v)
  {
    Eigen::Vector3f::Map(m_row.base) = static_cast<float>(v) * m_warp.H.col(1) + m_warp.H.col(2);
    return m_row;
  }

private:
  PlaneWarp m_warp;
  RowWarp m_row;
};
} // namespace

void InverseDepthEvidence::predict(const Pose &pMc)
{
  RowsSeen seen(m_camera, pMc, m_rho);
  for (int i = 0; i < m_rows; ++i)
    movedEvidenceOfRow(seen(i * kRowStep), m_evidence.data(), m_rows, 1.f / kRowStep, m_camera.width,
                       &m_scratch[index(i, 0, m_camera.width)]);
  m_evidence.swap(m_scratch);
}

void InverseDepthEvidence::add(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc,
                               const MotionNoise &noise)
{
  compare(older, current, oMc);
  addLikelihood(current, oMc, noise);
}

namespace
{
/// Means over \p window pixels of a row of \p count numbers each, which stands in the middle of \p line; its ends
/// repeat.
void meansOfRow(std::vector<float> &line, int width, int count, int window, float *out)
{
  const int half = window / 2 * count;
  const auto first = line.begin() + half, last = first + (width - 1) * count;
  for (int i = 0; i < window / 2; ++i) {
    std::copy_n(first, count, line.begin() + i * count);
    std::copy_n(last, count, last + (i + 1) * count);
  }
  slidingMeans(line.data(), width * count, count, window, out);
}
} // namespace

/// Squared residuals, averaged over the window.
void InverseDepthEvidence::compare(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc)
{
  RowsSeen seen(m_camera, oMc, m_rho);
  const int width = m_camera.width, window = m_options.window_width_px, columns = width * kInverseDepths;
  m_line.resize(index(0, width + window, width));
  for (int i = 0; i < m_rows; ++i) {
    squaredResidualsOfRow(seen(i * kRowStep), older.image.bitmap, static_cast<int>(older.image.getWidth()),
                          current.image[static_cast<unsigned>(i * kRowStep)], width,
                          m_line.data() + window / 2 * kInverseDepths);
    meansOfRow(m_line, width, kInverseDepths, window, &m_scratch[index(i, 0, width)]);
  }
  meansDownColumns(m_scratch.data(), m_rows, columns, m_window_rows, m_line.data(), m_residuals.data());
}

void InverseDepthEvidence::addLikelihood(const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise)
{
  const int width = m_camera.width, window = m_options.window_width_px;
  const std::size_t pixels = index(m_rows, 0, width) / kInverseDepths;
  m_squares.resize(2 * pixels);
  float *g2 = m_squares.data(), *mean = g2 + pixels;
  for (int i = 0; i < m_rows; ++i) {
    squaresOfRow(current.gradient_x[i * kRowStep], current.gradient_y[i * kRowStep], width, m_line.data() + window / 2);
    meansOfRow(m_line, width, 1, window, mean + i * width);
  }
  meansDownColumns(mean, m_rows, width, m_window_rows, m_line.data(), g2);

  const double f = 0.5 * (m_camera.fx + m_camera.fy);
  const double parallax = medianParallax(m_camera, oMc, 1.0); // [px m]
  std::vector<float> flow_variance(m_rho.size());
  for (int k = 0; k < kInverseDepths; ++k) {
    const double step = m_rho[std::min(k + 1, kInverseDepths - 1)] - m_rho[std::min(k, kInverseDepths - 2)];
    const double quantisation = parallax * step / std::sqrt(12.0);
    const double shift = f * m_rho[k] * noise.translation, turn = f * noise.rotation;
    flow_variance[k] = static_cast<float>(quantisation * quantisation + shift * shift + turn * turn);
  }
  // log of the likelihood of the window's residual, a Student's t, over that of an unrelated window; never below 0:
  // where no step matches (the place was hidden, or left the image) none is preferred.
  addLikelihoods(static_cast<float>(m_intensity_variance), flow_variance.data(), g2, m_residuals.data(), pixels,
                 m_evidence.data());
}

vpImage<float> InverseDepthEvidence::logOddsNear() const
{
  vpImage<float> log_odds(static_cast<unsigned>(m_rows), static_cast<unsigned>(m_camera.width));
  std::vector<float> is_near(m_rho.size(), 0.f);
  std::fill(is_near.begin() + static_cast<std::ptrdiff_t>(m_first_near), is_near.end(), 1.f);
  logOddsOfEvidence(m_evidence.data(), m_log_prior.data(), is_near.data(), log_odds.getSize(), log_odds.bitmap);
  return log_odds;
}

double medianParallax(const PinholeCamera &camera, const Pose &oMc, double range)
{
  std::vector<double> flows;
  flows.reserve(64);
  const Eigen::Vector3d ct = oMc.R.transpose() * oMc.t;
  for (int i = 0; i < 8; ++i)
    for (int j = 0; j < 8; ++j) {
      const Eigen::Vector2d u((j + 0.5) * camera.width / 8, (i + 0.5) * camera.height / 8);
      const Eigen::Vector3d ray = camera.ray(u);
      const Eigen::Vector2d flow(-camera.fx * ct.x() + camera.fx * ray.x() * ct.z(),
                                 -camera.fy * ct.y() + camera.fy * ray.y() * ct.z()); // times the depth
      flows.push_back(flow.norm() / range);
    }
  return medianOf(std::move(flows));
}
} // namespace bole
