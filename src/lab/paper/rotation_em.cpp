// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper/paper_mapper.h"

#include "support/units.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace bole::paper
{
namespace
{
/// Between four pixels.
struct Bilinear
{
  std::size_t at;
  unsigned width;
  float a, b;

  float operator()(const vpImage<float> &image) const
  {
    const float *upper = image.bitmap + at, *lower = upper + width;
    return (1 - b) * ((1 - a) * upper[0] + a * upper[1]) + b * ((1 - a) * lower[0] + a * lower[1]);
  }
};

/// Gauss-Newton sums of one M-step.
struct Sums
{
  Eigen::Matrix3f H = Eigen::Matrix3f::Zero();
  Eigen::Vector3f g = Eigen::Vector3f::Zero();
};

/// The E-step at \p omega, of one pixel after the other, and the sums of the M-step; \p log_ratio gets the labels where
/// given.
class Pass
{
public:
  Pass(const GreyImage &previous, const GreyImage &current, const PinholeCamera &camera)
      : m_previous(previous), m_current(current), m_camera(camera)
  {
  }

  Eigen::Vector3d step(const Eigen::Vector3d &omega, vpImage<float> *log_ratio) const
  {
    Eigen::Matrix3d H = (1e-3 + 1 / (0.3 * 0.3)) * Eigen::Matrix3d::Identity(); // a blank image leaves the turn
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    for (int v = 1; v + 1 < m_camera.height; ++v) {
      Sums row;
      for (int u = 1; u + 1 < m_camera.width; ++u)
        add(u, v, omega.cast<float>(), row, log_ratio);
      H += row.H.cast<double>();
      g += row.g.cast<double>();
    }
    return -H.ldlt().solve(g);
  }

private:
  void add(int u, int v, const Eigen::Vector3f &omega, Sums &sums, vpImage<float> *log_ratio) const
  {
    constexpr auto square = [](double sigma) { return static_cast<float>(sigma * sigma); };
    constexpr float intensity = square(kIntensity), background = square(kBackground_px),
                    foreground = square(kForeground_px);
    const Eigen::Matrix<float, 2, 3> V = flowMatrix(m_camera, Eigen::Vector2d(u, v)).cast<float>();
    const Eigen::Vector2f flow = V * omega, from = Eigen::Vector2f(u, v) - flow;
    if (!(from.x() >= 0 && from.y() >= 0 && from.x() < static_cast<float>(m_camera.width - 1) &&
          from.y() < static_cast<float>(m_camera.height - 1)))
      return;
    const unsigned width = m_previous.grey.getWidth();
    const auto column = static_cast<unsigned>(from.x()), line = static_cast<unsigned>(from.y());
    const Bilinear before{std::size_t{line} * width + column, width, from.x() - static_cast<float>(column),
                          from.y() - static_cast<float>(line)};
    const Eigen::Vector2f gradient(0.5f * (before(m_previous.by_x) + m_current.by_x[v][u]),
                                   0.5f * (before(m_previous.by_y) + m_current.by_y[v][u]));
    const float residual = m_current.grey[v][u] - before(m_previous.grey); // Eq. 15
    const float unexplained = residual - gradient.dot(flow);               // by a flow of mean 0
    const float var_b = intensity + background * gradient.squaredNorm();
    const float var_f = intensity + foreground * gradient.squaredNorm();
    const float ratio =
        0.5f * (std::log(var_f / var_b) - residual * residual / var_b + unexplained * unexplained / var_f);
    if (log_ratio)
      (*log_ratio)[v][u] = ratio;
    // Eq. 16; a foreground of mean zero does not depend on omega.
    const float weight = 1 / ((1 + std::exp(-ratio)) * var_b);
    const Eigen::Vector3f J = V.transpose() * gradient;
    sums.H += weight * J * J.transpose();
    sums.g += weight * residual * J;
  }

  const GreyImage &m_previous, &m_current;
  const PinholeCamera &m_camera;
};
} // namespace

FlowMatrix flowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px)
{
  const Eigen::Vector3d ray = camera.ray(u_px);
  const double x = ray.x(), y = ray.y();
  FlowMatrix V;
  V << camera.fx * x * y, -camera.fx * (1 + x * x), camera.fx * y, // Eq. 14
      camera.fy * (1 + y * y), -camera.fy * x * y, -camera.fy * x;
  return V;
}

GreyImage::GreyImage(const vpImage<unsigned char> &image)
    : grey(image.getHeight(), image.getWidth()), by_x(grey.getHeight(), grey.getWidth(), 0.f), by_y(by_x)
{
  for (unsigned i = 0; i < image.getSize(); ++i)
    grey.bitmap[i] = static_cast<float>(image.bitmap[i]) / 255;
  for (unsigned v = 0; v < grey.getHeight(); ++v)
    for (unsigned u = 0; u < grey.getWidth(); ++u) {
      if (u > 0 && u + 1 < grey.getWidth())
        by_x[v][u] = 0.5f * (grey[v][u + 1] - grey[v][u - 1]);
      if (v > 0 && v + 1 < grey.getHeight())
        by_y[v][u] = 0.5f * (grey[v + 1][u] - grey[v - 1][u]);
    }
}

TurnAndLabels estimateTurn(const GreyImage &previous, const GreyImage &current, const PinholeCamera &camera,
                           const Turn &start, int iterations)
{
  constexpr double kConverged = 1e-4, kFar = 0.5; // of a step [rad]
  const Pass pass(previous, current, camera);
  TurnAndLabels result;
  result.pRc = start;
  for (int i = 0; i < iterations; ++i) {
    const Eigen::Vector3d step = pass.step(logSo3(result.pRc), nullptr);
    if (!(step.norm() <= kFar)) // NaN too
      break;
    result.pRc = result.pRc * expSo3(step);
    if (step.norm() < kConverged)
      break;
  }
  result.log_ratio = vpImage<float>(current.grey.getHeight(), current.grey.getWidth(), 0.f);
  pass.step(logSo3(result.pRc), &result.log_ratio);
  return result;
}
} // namespace bole::paper
