// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/ground.h"

#include "geometry/constants.h"

#include <algorithm>
#include <cmath>

namespace bole
{
double GroundPlane::heightAt(const Eigen::Vector2d &xy) const
{
  constexpr double kKnown_m = 8; // from where points of the ground are seen
  const Eigen::Vector2d to = xy - at;
  return z + slope.dot(to) * std::min(1.0, kKnown_m / std::max(to.norm(), 1e-9));
}

const GroundPlane &GroundFilter::add(const std::vector<TriangulatedRay> &points, const Eigen::Vector3d &camera)
{
  moveTo(camera.head<2>());
  for (const TriangulatedRay &point : points)
    addPoint(point, camera);
  return m_plane;
}

/// What is under the camera now was before it, and the ground bends on the way.
void GroundFilter::moveTo(const Eigen::Vector2d &at)
{
  constexpr double kBump_m = 0.05, kBend = 0.03; // of the height and of the slope, in one metre
  const Eigen::Vector2d moved = at - m_plane.at;
  Eigen::Matrix3d F = Eigen::Matrix3d::Identity();
  F.topRightCorner<1, 2>() = moved.transpose();
  m_plane.z += m_plane.slope.dot(moved);
  m_plane.at = at;
  m_covariance = F * m_covariance * F.transpose();
  m_covariance.diagonal() += moved.norm() * Eigen::Vector3d(kBump_m * kBump_m, kBend * kBend, kBend * kBend);
}

void GroundFilter::addPoint(const TriangulatedRay &point, const Eigen::Vector3d &camera)
{
  constexpr double kNearest_m = 1, kFarthest_m = 8, kBelow_m = 0.3; // of points that may be ground
  constexpr double kSure = 0.15;                                    // largest error of a distance, relative
  constexpr double kRough_m = 0.1, kTilt = 1 * kDegree;             // of the ground; of the camera
  constexpr double kGround = 0.35, kPlants = 0.6, kWrong = 0.05;    // what a point is before it is measured,
  constexpr double kPlants_m = 3, kWrong_m = 20;                    // and how far from the ground it may be
  constexpr double kFrames = 10;                                    // in which one point comes again
  if (point.inverse_distance <= 0 || point.sigma > kSure * point.inverse_distance)
    return;
  const Eigen::Vector3d to = point.ray / point.inverse_distance;
  const double distance = to.head<2>().norm();
  if (distance < kNearest_m || distance > kFarthest_m || to.z() > -kBelow_m)
    return;
  const double sigma = point.sigma / point.inverse_distance * to.z();
  const double variance = sigma * sigma + std::pow(kTilt * distance, 2) + kRough_m * kRough_m;
  const Eigen::RowVector3d H(1, to.x(), to.y());
  const double above = camera.z() + to.z() - m_plane.z - m_plane.slope.dot(to.head<2>());
  const double spread = variance + H * m_covariance * H.transpose();
  const double ground = kGround * std::exp(-0.5 * above * above / spread) / std::sqrt(2 * M_PI * spread);
  const double other = (above > 0 && above < kPlants_m ? kPlants / kPlants_m : 0) + kWrong / kWrong_m;
  const double weight = ground / (ground + other) / kFrames;
  const Eigen::Vector3d PH = m_covariance * H.transpose();
  const Eigen::Vector3d K = PH * (weight / (variance + weight * H * PH));
  const Eigen::Vector3d step = K * above;
  m_plane.z += step(0);
  m_plane.slope += step.tail<2>();
  m_covariance -= K * PH.transpose();
}
} // namespace bole
