// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/pipeline/pipeline.h>

#include <Eigen/Dense>

#include <algorithm>

namespace bole
{
namespace
{
constexpr int kBack = 8;             ///< frames between the two views of a point, at most
constexpr double kParallax = 0.06;   ///< least angle between its rays [rad]
constexpr double kMissed = 0.02;     ///< largest distance of the rays from one another, of the distance of the point
constexpr double kMiddle_px = 2;     ///< largest error in the frame half-way
} // namespace

std::vector<Eigen::Vector3d> Pipeline::scenePoints(double range) const
{
  std::vector<Eigen::Vector3d> points;
  if (m_smoother.poseCount() == 0 || m_points.framesBack() < 2 || isTurning())
    return points;
  std::vector<Pose> wMc; // by frames back
  for (int back = 0; back <= std::min(kBack, m_points.framesBack()); ++back)
    wMc.push_back(cameraAt(poseOf(m_points.frameIndex(back))));
  const Pose &now = wMc.front();
  for (const PointTrack &track : m_points.tracker().tracks()) {
    const int back = std::min<int>(track.age(), static_cast<int>(wMc.size()) - 1);
    if (back < 2)
      continue;
    const auto seen = [&track](int ago) { return *(track.positions_px.rbegin() + ago); };
    const Pose &before = wMc[static_cast<std::size_t>(back)];
    const Eigen::Vector3d a = (before.R * m_camera.ray(seen(back))).normalized(), b = (now.R * m_camera.ray(seen(0))).normalized();
    const double cosine = a.dot(b), sine2 = 1 - cosine * cosine;
    if (sine2 < kParallax * kParallax)
      continue;
    const Eigen::Vector3d ba = now.t - before.t; // along a by u, from the other along b by v
    const double u = (ba.dot(a) - cosine * ba.dot(b)) / sine2, v = (cosine * ba.dot(a) - ba.dot(b)) / sine2;
    const Eigen::Vector3d on_a = before.t + u * a, on_b = now.t + v * b, point = 0.5 * (on_a + on_b);
    if (u <= 0 || v <= 0 || v > range || (on_a - on_b).norm() > kMissed * v)
      continue;
    const Eigen::Vector3d half_way = wMc[static_cast<std::size_t>(back / 2)].inverse() * point;
    if (half_way.z() > 0 && (m_camera.project(half_way) - seen(back / 2)).norm() < kMiddle_px)
      points.push_back(point);
  }
  return points;
}
} // namespace bole
