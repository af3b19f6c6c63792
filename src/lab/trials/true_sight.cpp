// SPDX-License-Identifier: GPL-2.0-or-later
#include "trials/perception.h"

#include "simulation/random.h"

#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kReach = 12;        ///< [m]
constexpr double kLeastWidth_px = 5; ///< of a trunk in the image
constexpr double kSureLogOdds = 10;  ///< of what is surely a trunk
constexpr double kRaySigma = 0.01;   ///< of inverse distances [1/m]: that of a point seen a dozen times
constexpr int kRayColumns = 64, kRayRows = 5;

/// A trunk's silhouette at the height of the camera.
struct Silhouette
{
  std::size_t trunk;
  double left, right, distance; ///< tangents of the bearing, [m]
};

/// Distance along the horizontal unit vector \p u from \p from to the circle; infinite where it misses.
double toCircle(const Eigen::Vector2d &from, const Eigen::Vector2d &u, const Eigen::Vector2d &centre, double radius)
{
  const Eigen::Vector2d w = centre - from;
  const double along = w.dot(u), inside = radius * radius - (w.squaredNorm() - along * along);
  const double range = along - std::sqrt(std::max(inside, 0.0));
  return inside > 0 && range > 0 ? range : std::numeric_limits<double>::infinity();
}
} // namespace

TrueSight::TrueSight(const PinholeCamera &camera, const Pose &bMc, const Forest &forest, double missing,
                     const std::vector<int> &asked_for)
    : m_camera(camera), m_bMc(bMc), m_forest(forest), m_has_points_on_bark(missing <= 0)
{
  Random random(forest.options.seed, 900);
  for (const SimulatedTrunk &trunk : forest.trunks)
    m_known.push_back({trunk.cylinder(), 0, random.uniform() < missing});
  for (const int id : asked_for)
    m_known[static_cast<std::size_t>(id)].is_missing = false;
}

void TrueSight::look(const Pose &truth, const Pose &estimate, bool is_tracked, FrameReport &report)
{
  report.wMb = estimate;
  report.wMc = estimate * m_bMc;
  report.pose_covariance = 1e-8 * Matrix6d::Identity();
  report.is_translation_seen = true;
  std::vector<Silhouette> seen;
  for (std::size_t k = 0; k < m_known.size(); ++k) {
    const RelativeTrunk relative = relativeTrunk(truth, m_bMc, m_known[k].cylinder);
    const double distance = m_known[k].cylinder.radius() / relative.ratio();
    if (!relative.isFinite() || distance > kReach)
      continue;
    const Eigen::Vector3d left = relative.borderDirection(Border::left, 0),
                          right = relative.borderDirection(Border::right, 0);
    if (left.z() <= 0 || right.z() <= 0)
      continue;
    const double u_left = m_camera.project(left).x(), u_right = m_camera.project(right).x();
    if (u_left > 0 && u_right < m_camera.width - 1 && u_right - u_left > kLeastWidth_px)
      seen.push_back({k, left.x() / left.z(), right.x() / right.z(), distance});
  }
  for (const Silhouette &trunk : seen) {
    double hidden = 0;
    for (const Silhouette &other : seen)
      if (other.distance < trunk.distance)
        hidden += std::max(0.0, std::min(trunk.right, other.right) - std::max(trunk.left, other.left));
    if (hidden > 0.5 * (trunk.right - trunk.left) || m_known[trunk.trunk].is_missing)
      continue;
    ++m_known[trunk.trunk].views;
    TrunkInView view;
    view.id = static_cast<int>(trunk.trunk);
    view.status = TrunkStatus::confirmed;
    view.is_tracked = is_tracked;
    view.outcome = is_tracked ? "tracked" : "missed";
    view.relative = relativeTrunk(estimate, m_bMc, m_known[trunk.trunk].cylinder);
    view.tan_low = -0.4;
    view.tan_high = 0.4;
    view.distance = trunk.distance;
    if (view.relative.isFinite())
      report.trunks.push_back(view);
  }
  for (std::size_t k = 0; k < m_known.size(); ++k)
    if (m_known[k].views > 0) {
      KnownTrunk trunk;
      trunk.id = static_cast<int>(k);
      trunk.status = TrunkStatus::confirmed;
      trunk.trunk = m_known[k].cylinder;
      trunk.observations = m_known[k].views;
      trunk.log_odds = kSureLogOdds;
      report.map.push_back(trunk);
    }
  cast(truth * m_bMc, report);
}

/// Bark is where the cylinders are at the height of the camera: their lean over a ray's few metres is left out.
void TrueSight::cast(const Pose &wMc, FrameReport &report) const
{
  std::vector<std::pair<Eigen::Vector2d, double>> near;
  for (const Known &known : m_known) {
    const Eigen::Vector2d xy = known.cylinder.axisAt(wMc.t.z()).head<2>();
    if ((xy - wMc.t.head<2>()).norm() < kReach)
      near.emplace_back(xy, known.cylinder.radius());
  }
  for (int column = 0; column < kRayColumns; ++column)
    for (int row = 0; row < kRayRows; ++row) {
      const Eigen::Vector2d pixel((column + 0.5) * m_camera.width / kRayColumns,
                                  (row + 0.5) * m_camera.height / kRayRows);
      const Eigen::Vector3d ray = (wMc.R * m_camera.ray(pixel)).normalized();
      const double level = ray.head<2>().norm();
      double range = kReach / level;
      if (ray.z() < 0)
        range = std::min(range, (wMc.t.z() - m_forest.terrain.height(wMc.t.x(), wMc.t.y())) / -ray.z());
      double bark = std::numeric_limits<double>::infinity();
      for (const auto &[xy, radius] : near)
        bark = std::min(bark, toCircle(wMc.t.head<2>(), ray.head<2>() / level, xy, radius) / level);
      if (bark > range || m_has_points_on_bark)
        report.points.push_back({ray, 1 / std::min(range, bark), kRaySigma});
    }
}
} // namespace bole
