// SPDX-License-Identifier: GPL-2.0-or-later
// The life of a trunk: what it must show before it is confirmed, and what loses it.
#include "map/trunk_map.h"

#include <gmock/gmock.h>

#include <functional>
#include <random>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;

Trunk trunkAt(double x, double y, double radius = 0.15)
{
  Trunk trunk;
  trunk.xy = {x, y};
  trunk.log_radius = std::log(radius);
  return trunk;
}

/// A map in which trunks are added and seen as the pipeline would.
class Life : public testing::Test
{
protected:
  MapTrunk &add(const Trunk &trunk)
  {
    m_map.trunks().reserve(64); // references stay good
    MapTrunk &added = m_map.add(m_next++, trunk);
    added.covariance = 1e-4 * Matrix5d::Identity();
    return added;
  }
  /// \p views more views, the bearing sweeping \p parallax in all of them.
  void see(MapTrunk &trunk, int views, double parallax = 0.2, double innovation2 = 0.1)
  {
    for (int i = 0; i < views; ++i, m_time_s += 0.1)
      m_map.recordView(trunk, {m_time_s, 0.5 + parallax * i / std::max(1, views - 1), -0.1, 0.1, 0.9, innovation2});
  }
  void miss(MapTrunk &trunk, int frames)
  {
    for (int i = 0; i < frames; ++i)
      m_map.recordMiss(trunk);
  }
  MapTrunk &confirmed(const Trunk &at, int views = 20)
  {
    MapTrunk &trunk = add(at);
    see(trunk, views);
    m_map.review();
    EXPECT_EQ(trunk.status, TrunkStatus::confirmed);
    return trunk;
  }

  MapOptions m_options;
  TrunkMap m_map{m_options};
  std::size_t m_next = 0;
  double m_time_s = 0;
};
} // namespace

TEST_F(Life, AReadingThatCouldNotBeConfirmedItselfKeepsNoOtherBack)
{
  const auto seenWith = [this](MapTrunk &trunk, double least) { // the worst innovation that leaves so much evidence
    see(trunk, 20);
    for (trunk.innovation2 = 9; m_map.evidence(trunk) < least && trunk.innovation2 > 0;)
      trunk.innovation2 -= 0.005;
    EXPECT_GT(trunk.innovation2, 0);
  };
  MapTrunk &narrow = add(trunkAt(3, 1, 0.15)), &wide = add(trunkAt(3, 1, 0.22));
  seenWith(narrow, m_options.confirm_evidence + 0.2);
  seenWith(wide, m_options.confirm_evidence - 0.2); // and holds the other, which speaks for it by 1
  m_map.review();
  EXPECT_EQ(narrow.status, TrunkStatus::confirmed);
  EXPECT_NE(wide.status, TrunkStatus::confirmed);
}

TEST_F(Life, WithoutParallaxATrunkEarnsItsPlaceByEvenBordersAlone)
{
  MapTrunk &even = add(trunkAt(5, 0)), &uneven = add(trunkAt(5, 3)), &faint = add(trunkAt(5, -3));
  for (int i = 0; i < 20; ++i) {
    m_map.recordView(even, {0.1 * i, 0.5, -0.05, 0.05, 0.6, 0.1});
    m_map.recordView(uneven, {0.1 * i, 1.5, -0.05, 0.05, 0.2, 0.1});
    m_map.recordView(faint, {0.1 * i, 2.5, -0.003, 0.05, 0.6, 0.1});
  }
  m_map.review(false);
  EXPECT_EQ(even.status, TrunkStatus::confirmed);
  EXPECT_NE(uneven.status, TrunkStatus::confirmed);
  EXPECT_NE(faint.status, TrunkStatus::confirmed);
  EXPECT_EQ(m_map.removeAll().size(), m_map.trunks().size() - 2); // those two were given up before
  EXPECT_TRUE(m_map.active().empty());
}

TEST_F(Life, StartsAsACandidate)
{
  MapTrunk &trunk = add(trunkAt(3, 1));
  see(trunk, m_options.confirm_observations - 1);
  EXPECT_TRUE(m_map.review().empty());
  EXPECT_EQ(trunk.status, TrunkStatus::candidate);
}

TEST_F(Life, IsConfirmedByEnoughViewsThatFit)
{
  MapTrunk &trunk = add(trunkAt(3, 1));
  see(trunk, m_options.confirm_observations);
  const auto changes = m_map.review();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].id, trunk.id);
  EXPECT_EQ(changes[0].from, TrunkStatus::candidate);
  EXPECT_EQ(changes[0].to, TrunkStatus::confirmed);
  EXPECT_TRUE(m_map.review().empty()); // and stays so
  EXPECT_EQ(m_map.count(TrunkStatus::confirmed), 1);
}

TEST_F(Life, NothingIsConfirmedThatFailsOneCondition)
{
  struct Case
  {
    const char *what;
    std::function<void(MapTrunk &)> spoil;
  };
  const std::vector<Case> cases = {
      {"parallax", [](MapTrunk &t) { t.bearing_low = t.bearing_high = 0; }},
      {"place", [&](MapTrunk &t) { t.covariance.topLeftCorner<2, 2>() *= 1e4; }},
      {"thin", [&](MapTrunk &t) { t.trunk.log_radius = std::log(0.9 * m_options.radius_min); }},
      {"thick", [&](MapTrunk &t) { t.trunk.log_radius = std::log(1.1 * m_options.radius_max); }},
      {"misses", [&](MapTrunk &t) { t.misses = 20 * t.hits; }},
      {"predictions", [&](MapTrunk &t) { t.hits = m_options.confirm_predicted - 1; }},
      {"innovation", [&](MapTrunk &t) { t.innovation2 = 4; }},
  };
  for (const Case &c : cases)
    for (const bool is_spoilt : {true, false}) { // and it was only that
      TrunkMap map(m_options);
      MapTrunk &trunk = map.add(0, trunkAt(3, 1));
      trunk.covariance = 1e-4 * Matrix5d::Identity();
      for (int i = 0; i < 20; ++i)
        map.recordView(trunk, {0.1 * i, 0.02 * i, 0.1, -0.1, 0.9, 0.1});
      if (is_spoilt)
        c.spoil(trunk);
      map.review();
      EXPECT_EQ(trunk.status == TrunkStatus::confirmed, !is_spoilt) << c.what;
    }
}

TEST_F(Life, WhatDidNotMoveLikeSomethingNearLosesOdds)
{
  MapTrunk &still = add(trunkAt(3, 1)), &moved = add(trunkAt(3, -4)), &far = add(trunkAt(3, -8));
  for (MapTrunk *trunk : {&still, &moved, &far})
    see(*trunk, 20);
  const double unknown = m_map.evidence(far);
  for (int i = 0; i < 5; ++i) {
    m_map.recordForeground(still, m_options.near_range - 0.1, 0.05);
    m_map.recordForeground(moved, m_options.near_range - 0.1, 0.9);
    m_map.recordForeground(far, m_options.near_range + 0.1, 0.05); // says nothing that far away
  }
  EXPECT_LT(m_map.evidence(still), unknown - 0.5);
  EXPECT_GT(m_map.evidence(moved), unknown + 0.5);
  EXPECT_EQ(m_map.evidence(far), unknown);
}

TEST_F(Life, TheOddsRiseWithWhatSpeaksForATrunkAndFallWithWhatSpeaksAgainst)
{
  MapTrunk &trunk = add(trunkAt(3, 1));
  see(trunk, 20);
  const double odds = m_map.evidence(trunk);
  const auto after = [&](const std::function<void(MapTrunk &)> &change) {
    MapTrunk changed = trunk;
    change(changed);
    return m_map.evidence(changed);
  };
  EXPECT_GT(after([](MapTrunk &t) { t.found_again = 3; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.bearing_high += 0.2; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.contrast *= 2; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.innovation2 /= 2; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.misses += 5; }), odds);
  EXPECT_EQ(after([](MapTrunk &t) { t.points_behind = 3; }), odds); // a slipped track or two
  EXPECT_LT(after([](MapTrunk &t) { t.points_behind = 10; }), odds - 1);
  EXPECT_GT(after([](MapTrunk &t) { t.points_behind = t.points_on = 10; }),
            after([](MapTrunk &t) { t.points_behind = 10; }) + 0.5);
  EXPECT_LT(after([](MapTrunk &t) { t.trunk.log_radius += 1; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.trunk.log_radius -= 1; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.covariance *= 9; }), odds);
}

TEST_F(Life, ACandidateWhoseOddsAreBadIsGivenUp)
{
  MapTrunk &trunk = add(trunkAt(3, 1));
  see(trunk, m_options.doubt_observations - 1, 0.2, 9);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::candidate); // too early to say
  see(trunk, 1, 0, 9);
  miss(trunk, m_options.lost_misses - 1);
  ASSERT_LT(m_map.evidence(trunk), m_options.doubt_candidate);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::lost);
  EXPECT_TRUE(trunk.removed);
}

TEST_F(Life, AConfirmedTrunkWhoseOddsTurnBadIsGivenUp)
{
  MapTrunk &trunk = confirmed(trunkAt(3, 1));
  trunk.innovation2 = 9;
  ASSERT_LT(m_map.evidence(trunk), m_options.doubt_confirmed);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::lost);
  EXPECT_TRUE(trunk.removed);
}

TEST_F(Life, WhatHidesALostTrunkSaysNothingMoreAgainstIt)
{
  MapTrunk &trunk = confirmed(trunkAt(3, 1), 200);
  miss(trunk, m_options.lost_misses);
  m_map.review();
  ASSERT_EQ(trunk.status, TrunkStatus::lost);
  const double odds = m_map.evidence(trunk);
  miss(trunk, 500);
  EXPECT_EQ(m_map.evidence(trunk), odds);
}

TEST_F(Life, ACandidateThatIsMissedForLongLeavesTheMap)
{
  MapTrunk &trunk = add(trunkAt(3, 1));
  see(trunk, 3);
  miss(trunk, m_options.lost_misses - 1);
  EXPECT_TRUE(m_map.review().empty());
  miss(trunk, 1);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::lost);
  EXPECT_TRUE(trunk.removed);
}

TEST_F(Life, AConfirmedTrunkThatIsLostKeepsItsPlaceAndComesBackUnderItsId)
{
  MapTrunk &trunk = confirmed(trunkAt(3, 1), 200);
  const int id = trunk.id;
  miss(trunk, m_options.lost_misses);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::lost);
  EXPECT_FALSE(trunk.removed); // still predicted, so it can be found again
  EXPECT_TRUE(m_map.review().empty());
  see(trunk, 1);
  m_map.review();
  EXPECT_EQ(trunk.status, TrunkStatus::confirmed);
  EXPECT_EQ(trunk.id, id);
}

TEST_F(Life, ABorderWhoseSignTurnsOverBeginsAnew)
{
  MapTrunk &trunk = m_map.add(0, trunkAt(3, 1));
  m_map.recordView(trunk, {1.0, 0.3, -0.2, 0.1, 1, 0});
  m_map.recordView(trunk, {1.1, 0.3, -0.1, 0.2, 1, 0});
  EXPECT_NEAR(*trunk.left_contrast, -0.17, 1e-12);

  m_map.recordView(trunk, {1.2, 0.3, 0.05, 0.2, 1, 0});

  EXPECT_NEAR(*trunk.left_contrast, 0.05, 1e-12);
  EXPECT_GT(*trunk.right_contrast, 0.1);
}

TEST_F(Life, ACandidateThatWasLeftBehindIsNotLookedForAnyMoreButKeepsWhatWasSeenOfIt)
{
  MapTrunk &candidate = m_map.add(0, trunkAt(3, 1));
  m_map.recordView(candidate, {10.0, 0.3, 0.2, 0.2, 1, 0});
  m_map.leaveBehind(10.0 + 0.99 * m_options.candidate_memory_s);
  EXPECT_EQ(m_map.active().size(), 1u);

  m_map.leaveBehind(10.0 + 1.01 * m_options.candidate_memory_s);

  EXPECT_TRUE(m_map.active().empty());
  EXPECT_FALSE(m_map.trunks().front().removed);
  EXPECT_EQ(m_map.records().size(), 1u);
}

TEST_F(Life, ACandidateOfWhichNothingWasEverSeenIsRemovedWhenItIsLeftBehind)
{
  const int never_seen = m_map.add(0, trunkAt(3, 1)).id;
  m_map.trunks().front().last_seen_s = 10;
  MapTrunk &seen = m_map.add(1, trunkAt(5, 1));
  m_map.recordView(seen, {10.0, 0.3, 0.2, 0.2, 1, 0});
  EXPECT_TRUE(m_map.leaveBehind(10.0 + 0.99 * m_options.candidate_memory_s).empty());

  EXPECT_EQ(m_map.leaveBehind(10.0 + 1.01 * m_options.candidate_memory_s), std::vector<int>{never_seen});

  EXPECT_TRUE(m_map.trunks()[0].removed);
  EXPECT_FALSE(m_map.trunks()[1].removed);
}

TEST_F(Life, AConfirmedTrunkIsNeverLeftBehind)
{
  confirmed(trunkAt(3, 1), 200);
  m_map.leaveBehind(1e6);
  EXPECT_EQ(m_map.active().size(), 1u);
}

TEST_F(Life, AViewEndsARowOfMisses)
{
  MapTrunk &trunk = confirmed(trunkAt(3, 1), 200);
  for (int i = 0; i < 5; ++i) {
    miss(trunk, m_options.lost_misses - 1);
    see(trunk, 1);
    EXPECT_TRUE(m_map.review().empty());
  }
}

TEST_F(Life, TwoTrunksInOnePlaceBecomeOne)
{
  MapTrunk &old = confirmed(trunkAt(3, 1), 60);
  MapTrunk &duplicate = add(trunkAt(3 + 0.15 + 0.15 + m_options.merge_distance - 0.01, 1));
  see(duplicate, 3);
  const auto changes = m_map.review();
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].id, duplicate.id);
  EXPECT_EQ(changes[0].into, old.id);
  EXPECT_EQ(duplicate.status, TrunkStatus::merged);
  EXPECT_TRUE(duplicate.removed);
  EXPECT_FALSE(old.removed);
  EXPECT_TRUE(m_map.review().empty()); // a merged trunk merges no more
}

TEST_F(Life, NeighboursWithEnoughBetweenThemStayTwo)
{
  confirmed(trunkAt(3, 1));
  confirmed(trunkAt(3 + 0.15 + 0.15 + m_options.merge_distance + 0.01, 1));
  EXPECT_EQ(m_map.count(TrunkStatus::confirmed), 2);
}

TEST_F(Life, ReadingsOfOnePlaceCompeteUntilOneIsConfirmed)
{
  MapTrunk &narrow = add(trunkAt(3, 1, 0.1)), &wide = add(trunkAt(3.05, 1, 0.2));
  see(narrow, m_options.confirm_observations - 1);
  see(wide, m_options.confirm_observations - 1);
  EXPECT_TRUE(m_map.review().empty());
  EXPECT_EQ(m_map.count(TrunkStatus::candidate), 2);
  see(narrow, 1);
  see(wide, 1);
  m_map.review(); // equally sound: the wider is the silhouette
  EXPECT_EQ(wide.status, TrunkStatus::confirmed);
  EXPECT_EQ(narrow.status, TrunkStatus::merged);
}

TEST_F(Life, AWiderReadingThatIsSoundReplacesAConfirmedEdgeOnItsBark)
{
  MapTrunk &edge = confirmed(trunkAt(3, 1, 0.1));
  MapTrunk &silhouette = add(trunkAt(3.05, 1, 0.18)), &beside = add(trunkAt(3.3, 1, 0.12));
  see(silhouette, 5);
  see(beside, 5);
  m_map.review();
  EXPECT_EQ(silhouette.status, TrunkStatus::candidate); // may still turn out to be it
  EXPECT_EQ(beside.status, TrunkStatus::merged);        // cannot stand there
  see(silhouette, 15);
  m_map.review();
  EXPECT_EQ(edge.status, TrunkStatus::merged);
  m_map.review();
  EXPECT_EQ(silhouette.status, TrunkStatus::confirmed);
}

TEST_F(Life, TheSameReadingIsNotTakenInTwice)
{
  MapTrunk &candidate = add(trunkAt(3, 1));
  EXPECT_TRUE(m_map.holds(trunkAt(3.05, 1)));
  EXPECT_EQ(candidate.found_again, 1);
  EXPECT_FALSE(m_map.holds(trunkAt(3.05, 1, 0.3))); // another reading
  EXPECT_FALSE(m_map.holds(trunkAt(4, 1)));
  EXPECT_EQ(candidate.found_again, 1);
}

TEST_F(Life, ParallaxIsTheSpreadOfTheBearingsAlsoAcrossHalfATurn)
{
  MapTrunk &trunk = add(trunkAt(-3, 0));
  for (const double bearing : {3.10, -3.10, 3.05})
    m_map.recordView(trunk, {0, bearing, 0, 0, 0.9, 0});
  EXPECT_NEAR(trunk.parallax(), 2 * M_PI - 6.2 + 0.05, 1e-12);
}

TEST_F(Life, AnyHistoryKeepsItsLaws)
{
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform;
  for (int step = 0; step < 3000; ++step) {
    if (m_map.trunks().size() < 40 && uniform(random) < 0.05)
      add(trunkAt(6 * uniform(random), 6 * uniform(random), 0.06 + 0.3 * uniform(random)));
    if (m_map.trunks().empty())
      continue;
    MapTrunk &trunk =
        m_map.trunks()[static_cast<std::size_t>(uniform(random) * static_cast<double>(m_map.trunks().size()))];
    if (!trunk.removed && uniform(random) < 0.7)
      see(trunk, 1 + static_cast<int>(4 * uniform(random)), 0.1, 2 * uniform(random));
    else if (!trunk.removed)
      miss(trunk, 1 + static_cast<int>(4 * uniform(random)));
    std::vector<MapTrunk> before = m_map.trunks();
    for (const MapChange &change : m_map.review()) {
      const auto id = static_cast<std::size_t>(change.id);
      EXPECT_FALSE(before[id].removed) << "what left the map stays as it was";
      EXPECT_NE(change.to, TrunkStatus::candidate) << "nothing becomes a candidate again";
      EXPECT_EQ(change.to == TrunkStatus::merged, change.into >= 0);
      if (change.into >= 0) {
        EXPECT_NE(m_map.trunks()[static_cast<std::size_t>(change.into)].id, change.id);
        EXPECT_TRUE(m_map.trunks()[id].removed);
      }
    }
    int counted = 0;
    for (const TrunkStatus status :
         {TrunkStatus::candidate, TrunkStatus::confirmed, TrunkStatus::lost, TrunkStatus::merged})
      counted += m_map.count(status);
    ASSERT_EQ(counted, static_cast<int>(m_map.trunks().size()));
  }
  EXPECT_GT(m_map.count(TrunkStatus::merged), 0);
}

TEST_F(Life, RecordsTellThePlaceAtBreastHeight)
{
  Trunk leaning = trunkAt(3, 1);
  leaning.lean = {0.1, -0.05};
  MapTrunk &trunk = add(leaning);
  trunk.covariance.diagonal() << 0.01, 0.02, 0.04, 1e-3, 2e-3;
  see(trunk, 4);
  const TrunkRecord record = m_map.records().at(0);
  EXPECT_LT((record.xy - Eigen::Vector2d(3 + 0.13, 1 - 0.065)).norm(), 1e-12);
  EXPECT_NEAR(record.covariance_xy(0, 0), 0.01 + 1.3 * 1.3 * 1e-3, 1e-12);
  EXPECT_NEAR(record.covariance_xy(1, 1), 0.02 + 1.3 * 1.3 * 2e-3, 1e-12);
  EXPECT_NEAR(record.variance_radius, 0.04 * 0.15 * 0.15, 1e-12);
  EXPECT_EQ(record.observations, 4);
  EXPECT_NEAR(record.last_seen_s - record.first_seen_s, 0.3, 1e-12);
}

TEST(MapOptions, AnOptionOutOfRangeIsNamed)
{
  MapOptions options;
  options.lost_misses = 0;
  try {
    TrunkMap map(options);
    FAIL() << "no exception";
  }
  catch (const vpException &error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("map.lost_misses = 0, must be in [1, 1000]"));
  }
}
