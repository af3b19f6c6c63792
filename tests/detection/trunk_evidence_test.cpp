// SPDX-License-Identifier: GPL-2.0-or-later
// What all frames of a flight say of places where a trunk may stand, before a wall with a pattern.
#include "drawn_trunks.h"

#include "detection/trunk_evidence.h"

#include <gtest/gtest.h>

#include <cmath>

namespace bole
{
namespace
{
constexpr double kWall = 11; ///< x of the wall [m]

/// A pattern with patches of about a unit, 0 to 1.
double pattern(double a, double b)
{
  const auto at = [](int i, int k) {
    auto h = static_cast<std::uint32_t>(i * 374761393 + k * 668265263);
    h = (h ^ (h >> 13)) * 1274126177U;
    return static_cast<double>((h ^ (h >> 16)) & 0xffffU) / 65535;
  };
  const int i = static_cast<int>(std::floor(a)), k = static_cast<int>(std::floor(b));
  const double u = a - i, v = b - k;
  return (1 - v) * ((1 - u) * at(i, k) + u * at(i + 1, k)) + v * ((1 - u) * at(i, k + 1) + u * at(i + 1, k + 1));
}

/// Grey of what a ray meets: bark, darker beyond \p shadow of the way from the left to the right border, or the wall.
double greyAlong(const Eigen::Vector3d &from, const Eigen::Vector3d &ray, const std::vector<Trunk> &trunks,
                 double shadow)
{
  double nearest = (kWall - from.x()) / std::max(ray.x(), 1e-6);
  const Eigen::Vector3d wall = from + nearest * ray;
  double grey = 120 + 120 * pattern(4 * wall.y(), 2 * wall.z());
  for (const Trunk &trunk : trunks) {
    const Eigen::Vector2d offset = from.head<2>() - trunk.xy, d = ray.head<2>();
    const double b = offset.dot(d) / d.squaredNorm();
    const double c = (offset.squaredNorm() - trunk.radius() * trunk.radius()) / d.squaredNorm();
    if (b * b < c)
      continue;
    const double s = -b - std::sqrt(b * b - c);
    if (s <= 0 || s >= nearest)
      continue;
    nearest = s;
    const Eigen::Vector3d p = from + s * ray;
    const double y = (p.y() - trunk.xy.y()) / trunk.radius(); // left is positive
    grey = (0.5 * (1 - y) > shadow ? 0.5 : 1.0) * (30 + 60 * pattern(30 * p.y(), 8 * p.z()));
  }
  return grey;
}

vpImage<unsigned char> photograph(const Pose &wMc, const PinholeCamera &camera, const std::vector<Trunk> &trunks,
                                  double shadow)
{
  vpImage<unsigned char> image(static_cast<unsigned>(camera.height), static_cast<unsigned>(camera.width));
  for (int v = 0; v < camera.height; ++v)
    for (int u = 0; u < camera.width; ++u)
      image[static_cast<unsigned>(v)][static_cast<unsigned>(u)] =
          static_cast<unsigned char>(greyAlong(wMc.t, wMc.R * camera.ray(Eigen::Vector2d(u, v)), trunks, shadow));
  return image;
}

Trunk standing(double x, double y, double radius)
{
  Trunk trunk;
  trunk.xy = {x, y};
  trunk.log_radius = std::log(radius);
  return trunk;
}

class Evidence : public testing::Test
{
protected:
  /// A flight sideways past \p trunks.
  void fly(const std::vector<Trunk> &trunks, double shadow = 2)
  {
    const PinholeCamera camera;
    LevelGrid grid;
    grid.column_step = 1 / camera.fx;
    std::vector<LevelImage> images;
    for (const Pose &wMc : test::sweep(12, 1.5))
      images.emplace_back(photograph(wMc, camera, trunks, shadow), camera, wMc, grid);
    m_views = evidenceViews(images, 0.5, m_sweep);
  }
  TrunkEvidence at(const Trunk &trunk) const { return evidenceOf(trunk, m_views, m_sweep, {}); }

  DepthSweep m_sweep;
  std::vector<EvidenceView> m_views;
};

TEST_F(Evidence, ATrunkIsToldFromAGapBetweenTwo)
{
  const std::vector<Trunk> trunks = {standing(4, 0.5, 0.2), standing(4, -0.5, 0.2)};
  fly(trunks);
  const TrunkEvidence trunk = at(trunks.front()), gap = at(standing(4, 0, 0.3));
  EXPECT_EQ(trunk.views, 6);
  EXPECT_GT(trunk.inside, 0.05);
  EXPECT_GT(std::min(trunk.left, trunk.right), 0.05);
  EXPECT_LT(gap.inside, 0);
  EXPECT_GT(logOdds(trunk), 0);
  EXPECT_LT(logOdds(gap), 0);
}

TEST_F(Evidence, ATrunkAtTheWrongRangeIsNone)
{
  fly({standing(4, 0, 0.2)});
  EXPECT_GT(logOdds(at(standing(4, 0, 0.2))), 0);
  EXPECT_LT(logOdds(at(standing(6, 0, 0.3))), 0);
  EXPECT_LT(logOdds(at(standing(2.8, 0, 0.14))), 0);
}

TEST_F(Evidence, BeyondTheEdgeOfAShadowTheBarkGoesOn)
{
  const double shadow = 0.6; // of the width is in the sun, on the left
  fly({standing(4, 0, 0.2)}, shadow);
  const Trunk sunny = standing(4, 0.2 * (1 - shadow), 0.2 * shadow);
  const TrunkEvidence whole = at(standing(4, 0, 0.2)), part = at(sunny);
  EXPECT_GT(whole.right, 0.05);
  EXPECT_LT(part.right, 0);
  EXPECT_GT(part.left, 0.05);
  EXPECT_GT(logOdds(whole), logOdds(part) + 1);
}
} // namespace
} // namespace bole
