// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/silhouette.h"

#include <algorithm>
#include <cmath>

namespace bole
{
double silhouetteHalfWidth(double radius_m, double distance_m)
{
  return std::asin(std::min(0.99, radius_m / distance_m));
}

Silhouette::Silhouette(const RelativeTrunk &trunk, double margin_rad, double tan_low, double tan_high)
    : m_tRc(trunk.cRt.transpose()),
      m_tan_half_width(std::tan(silhouetteHalfWidth(trunk.ratio(), 1) + margin_rad)),
      m_tan_low(tan_low),
      m_tan_high(tan_high)
{
}

bool Silhouette::covers(const Eigen::Vector3d &ray) const
{
  const Eigen::Vector3d m = m_tRc * ray; // x towards the axis, y to the left, z along the axis
  return m.x() > 0 && std::abs(m.y()) < m_tan_half_width * m.x() && m.z() >= m_tan_low * m.x() &&
         m.z() <= m_tan_high * m.x();
}

HorizontalView horizontalView(const Pose &wMc, const Trunk &trunk)
{
  HorizontalView view;
  view.offset = trunk.axisAt(wMc.t.z()).head<2>() - wMc.t.head<2>();
  view.bearing = std::atan2(view.offset.y(), view.offset.x());
  view.range = view.offset.norm();
  view.half_angle = silhouetteHalfWidth(trunk.radius(), view.range);
  return view;
}
} // namespace bole
