// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "map/constellation.h"

using namespace bole;

namespace
{
constexpr double kSigma = 0.15; // [m], of a place in either map

std::vector<TrunkRecord> woodOf(int count, double side, std::mt19937 &random)
{
  std::uniform_real_distribution<double> place(0, side);
  std::normal_distribution<double> log_radius(std::log(0.15), 0.3);
  std::vector<TrunkRecord> wood;
  while (static_cast<int>(wood.size()) < count) {
    TrunkRecord trunk;
    trunk.id = static_cast<int>(wood.size());
    trunk.xy = {place(random), place(random)};
    trunk.radius = std::exp(log_radius(random));
    trunk.covariance.topLeftCorner<2, 2>() = 0.5 * kSigma * kSigma * Eigen::Matrix2d::Identity();
    trunk.covariance(2, 2) = 0.01 * 0.01;
    if (std::none_of(wood.begin(), wood.end(), [&](const TrunkRecord &t) { return (t.xy - trunk.xy).norm() < 1; }))
      wood.push_back(trunk);
  }
  return wood;
}

/// The trunks within \p range of \p centre as another flight maps them: one in four missed, one made up, noise, another
/// frame.
std::vector<TrunkRecord> flightOver(const std::vector<TrunkRecord> &wood, const Eigen::Vector2d &centre, double range,
                                    const Placement &placement, std::mt19937 &random)
{
  std::normal_distribution<double> noise(0, kSigma / std::sqrt(2));
  std::normal_distribution<double> width(0, 0.01);
  std::vector<TrunkRecord> seen;
  const auto add = [&](TrunkRecord trunk) {
    trunk.xy += Eigen::Vector2d(noise(random), noise(random));
    trunk.xy = Eigen::Rotation2Dd(-placement.yaw) * (trunk.xy - placement.t);
    trunk.radius += width(random);
    trunk.id = 100 + static_cast<int>(seen.size());
    seen.push_back(trunk);
  };
  for (const TrunkRecord &trunk : wood) {
    if ((trunk.xy - centre).norm() < range && random() % 4 != 0)
      add(trunk);
  }
  TrunkRecord made_up = wood.front();
  made_up.xy = centre + Eigen::Vector2d(0.5 * range, 0.3 * range);
  add(made_up);
  return seen;
}

TEST(Constellation, PlacesAFlightOverAPartOfTheMapAndIsNeverWrong)
{
  std::mt19937 random(1);
  int placed = 0;
  constexpr int kRuns = 40;
  for (int run = 0; run < kRuns; ++run) {
    const std::vector<TrunkRecord> wood = woodOf(40, 25, random);
    Placement truth;
    truth.yaw = 0.15 * run;
    truth.t = {3.0 - run, 0.5 * run};
    const Eigen::Vector2d centre(12, 13);
    const auto found = placeOnMap(flightOver(wood, centre, 8, truth, random), wood);
    if (!found)
      continue;
    ++placed;
    const Eigen::Vector2d local = Eigen::Rotation2Dd(-truth.yaw) * (centre - truth.t);
    EXPECT_LT((*found * local - centre).norm(), 0.3) << "run " << run;
    EXPECT_LT(std::abs(std::remainder(found->yaw - truth.yaw, 2 * M_PI)), 0.05) << "run " << run;
    EXPECT_GE(found->matches.size(), 3u);
  }
  EXPECT_GT(placed, 3 * kRuns / 4);
}

TEST(Constellation, DoesNotPlaceAFlightOverAnotherWood)
{
  std::mt19937 random(2);
  int placed = 0;
  for (int run = 0; run < 40; ++run) {
    const std::vector<TrunkRecord> wood = woodOf(40, 25, random), other = woodOf(40, 25, random);
    placed += placeOnMap(flightOver(other, {12, 13}, 8, Placement(), random), wood) ? 1 : 0;
  }
  EXPECT_EQ(placed, 0);
}

TEST(Constellation, DoesNotDecideInAPlantationThatRepeatsItself)
{
  std::vector<TrunkRecord> rows;
  for (int i = 0; i < 36; ++i) {
    TrunkRecord trunk;
    trunk.id = i;
    trunk.xy = {3.0 * (i % 6), 3.0 * (i / 6)};
    trunk.radius = 0.15;
    trunk.covariance = 1e-3 * TrunkRecord::Covariance::Identity();
    rows.push_back(trunk);
  }
  const std::vector<TrunkRecord> part(rows.begin() + 7, rows.begin() + 11);
  EXPECT_FALSE(placeOnMap(part, rows));
}

TEST(Constellation, TwoTrunksAreNotEnough)
{
  std::mt19937 random(3);
  const std::vector<TrunkRecord> wood = woodOf(10, 12, random);
  EXPECT_FALSE(placeOnMap({wood[0], wood[1]}, wood));
}
} // namespace
