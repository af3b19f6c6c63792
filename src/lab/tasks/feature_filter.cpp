// SPDX-License-Identifier: GPL-2.0-or-later
#include "tasks/feature_filter.h"

#include <algorithm>
#include <cmath>

namespace bole
{
void FeatureFilter::start(double seen, double sigma, double drift_sigma)
{
  m_x << seen, 0;
  m_P = Eigen::Vector2d(sigma * sigma, drift_sigma * drift_sigma).asDiagonal();
}

void FeatureFilter::predict(double moved, double dt, double unrest)
{
  Eigen::Matrix2d F;
  F << 1, dt, 0, 1;
  Eigen::Matrix2d Q; // a drift that walks at random, integrated over dt
  Q << dt * dt * dt / 3, dt * dt / 2, dt * dt / 2, dt;
  m_x = F * m_x + Eigen::Vector2d(moved, 0);
  m_P = F * m_P * F.transpose() + unrest * unrest * Q;
}

void FeatureFilter::correct(double seen, double sigma)
{
  constexpr double kBelieved = 3; // standard deviations; what is farther off counts as no more
  const double variance = m_P(0, 0) + sigma * sigma, most = kBelieved * std::sqrt(variance);
  const Eigen::Vector2d gain = m_P.col(0) / variance;
  m_x += gain * std::clamp(seen - m_x(0), -most, most);
  m_P -= gain * m_P.row(0);
}

void FeatureFilter::correctDrift(double seen, double sigma)
{
  const Eigen::Vector2d gain = m_P.col(1) / (m_P(1, 1) + sigma * sigma);
  m_x += gain * (seen - m_x(1));
  m_P -= gain * m_P.row(1);
}
} // namespace bole
