// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include <bole/flight_laws.h>

using namespace bole;

namespace
{
using Kind = FlightOrder::Kind;
const Eigen::Vector4d kAhead(0.8, 0, 0, 0.1);

OwnState at(double x, double y, double yaw = 0, double height = 1.2) { return {{x, y}, yaw, {0, 0, 0}, height, 1}; }

TEST(FlightLaws, WhatBreaksNoneIsFlownAsItIs)
{
  FlightLaws laws;
  laws.takeOff(0);
  const FlightOrder order = laws.apply(0.1, kAhead, at(3, -2));
  EXPECT_EQ(order.kind, Kind::flies);
  EXPECT_EQ(order.velocity, kAhead);
  EXPECT_STREQ(order.law, "");
  EXPECT_EQ(laws.apply(0.2, {}, at(3, -2)).kind, Kind::hovers);
}

TEST(FlightLaws, WithoutCommandsItHoversAndThenLands)
{
  FlightLaws laws;
  laws.takeOff(0);
  laws.renew(10);
  EXPECT_EQ(laws.apply(10.4, kAhead, at(0, 0)).kind, Kind::flies);
  EXPECT_EQ(laws.apply(10.6, kAhead, at(0, 0)).kind, Kind::hovers);
  EXPECT_EQ(laws.apply(12.9, kAhead, at(0, 0)).kind, Kind::hovers);
  EXPECT_EQ(laws.apply(13.1, kAhead, at(0, 0)).kind, Kind::lands);
  EXPECT_EQ(laws.apply(13.1, {}, at(0, 0)).kind, Kind::lands); // a program that died while it hovered
}

TEST(FlightLaws, WithoutNavdataItHoversAtOnceAndThenLands)
{
  FlightLaws laws;
  laws.takeOff(0);
  laws.apply(1, kAhead, at(0, 0));
  FlightOrder order;
  for (double t = 1.03; t < 3.9; t += 0.03) {
    laws.renew(t);
    order = laws.apply(t, kAhead, {});
    ASSERT_EQ(order.kind, Kind::hovers) << t;
  }
  EXPECT_STREQ(order.law, "no navdata");
  laws.renew(4.1);
  EXPECT_EQ(laws.apply(4.1, kAhead, {}).kind, Kind::lands);
}

TEST(FlightLaws, ALowBatteryLandsAlsoADroneThatHovers)
{
  FlightLaws laws;
  laws.takeOff(0);
  OwnState own = at(0, 0);
  own.battery = 0.11;
  EXPECT_EQ(laws.apply(0.1, kAhead, own).kind, Kind::flies);
  own.battery = 0.09;
  EXPECT_EQ(laws.apply(0.2, kAhead, own).kind, Kind::lands);
  EXPECT_EQ(laws.apply(0.2, {}, own).kind, Kind::lands);
}

/// A drone whose velocity follows the order with a lag of \p lag_s and that hears it \p delay_s late.
Eigen::Vector2d flown(FlightLaws &laws, const Eigen::Vector4d &wanted, double yaw, double seconds, double &farthest)
{
  constexpr double kDt = 0.03, kLag = 0.5;
  constexpr int kLate = 4;
  Eigen::Vector2d p(0, 0), v(0, 0);
  std::vector<Eigen::Vector2d> sent(kLate, Eigen::Vector2d::Zero());
  farthest = 0;
  for (double t = 0; t < seconds; t += kDt) {
    laws.renew(t);
    OwnState own = at(p.x(), p.y(), yaw);
    own.velocity.head<2>() = Eigen::Rotation2Dd(-yaw) * v;
    const FlightOrder order = laws.apply(t, wanted, own);
    sent.push_back(Eigen::Rotation2Dd(yaw) * order.velocity.head<2>());
    v += kDt / kLag * (sent[sent.size() - kLate] - v);
    p += kDt * v;
    farthest = std::max(farthest, p.norm());
  }
  return p;
}

TEST(FlightLaws, ItStopsBeforeTheFenceWhereverItHeads)
{
  FlightLawOptions options;
  options.fence = 5;
  for (const double yaw : {0.0, 2.0, -1.3}) {
    FlightLaws laws(options);
    laws.takeOff(0);
    double farthest = 0;
    const Eigen::Vector2d end = flown(laws, {1, 0.4, 0, 0}, yaw, 60, farthest);
    EXPECT_LT(farthest, 5.02);
    EXPECT_GT(end.norm(), 4.8); // and it does fly up to it
  }
}

TEST(FlightLaws, TheFenceStandsRoundThePlaceOfTakeOffAndBringsBackWhatIsBeyond)
{
  FlightLawOptions options;
  options.fence = 5;
  FlightLaws laws(options);
  laws.takeOff(0);
  laws.apply(0, {}, at(100, 20));
  EXPECT_EQ(laws.apply(0.1, kAhead, at(103, 20)).velocity, kAhead);
  const FlightOrder back = laws.apply(0.2, kAhead, at(106, 20));
  EXPECT_LT(back.velocity.x(), 0);
  EXPECT_STREQ(back.law, "fence");
  EXPECT_EQ(back.velocity.w(), kAhead.w());
  EXPECT_EQ(laws.apply(0.3, Eigen::Vector4d(-0.8, 0, 0, 0), at(106, 20)).velocity.x(), -0.8);
}

TEST(FlightLaws, ItKeepsToTheBandOfHeights)
{
  const FlightLawOptions options;
  FlightLaws laws(options);
  laws.takeOff(0);
  const auto climbed = [&](double height, double climb) {
    return laws.apply(0.1, Eigen::Vector4d(0, 0, climb, 0), at(0, 0, 0, height)).velocity.z();
  };
  EXPECT_EQ(climbed(1.2, 0.4), 0.4);
  EXPECT_NEAR(climbed(options.highest - 0.1, 0.4), 0.1 / options.coast_s, 1e-12);
  EXPECT_LT(climbed(options.highest + 0.3, 0.4), 0);
  EXPECT_NEAR(climbed(options.lowest + 0.1, -0.4), -0.1 / options.coast_s, 1e-12);
  EXPECT_GT(climbed(options.lowest - 0.1, -0.4), 0);
  EXPECT_GT(climbed(options.lowest - 0.1, 0), 0);
  EXPECT_EQ(climbed(0, 0.4), 0); // the sonar is blind: neither up nor down
  EXPECT_EQ(climbed(0, -0.4), 0);
}

TEST(FlightLaws, RefusesOptionsOutOfRange)
{
  FlightLawOptions options;
  options.land_after_s = 0.1;
  EXPECT_THROW(FlightLaws{options}, vpException);
  options = {};
  options.highest = 0.2;
  EXPECT_THROW(FlightLaws{options}, vpException);
}
} // namespace
