// SPDX-License-Identifier: GPL-2.0-or-later
// The life of a trunk: what it must show before it is confirmed, and what loses it.
#include "support/test.h"

#include "map/trunk_map.h"

namespace
{
using namespace bole;

Trunk trunkAt(double x, double y, double radius = 0.15) { return {{x, y}, std::log(radius)}; }

/// A map in which trunks are added and seen as the pipeline would.
class Life : public testing::Test
{
protected:
  int add(const Trunk &trunk)
  {
    NewTrunk found;
    found.smoother_id = m_next++;
    found.trunk = trunk;
    found.covariance = 1e-4 * Matrix5d::Identity();
    found.found_s = m_time_s;
    return m_map.add(found);
  }
  const MapTrunk &at(int id) const { return m_map.trunk(id); }
  double evidence(int id) const { return m_map.evidence(at(id)); }
  void see(int id, const TrunkView &view)
  {
    TrunkMeasurement measurement;
    measurement.id = id;
    measurement.kind = TrunkMeasurement::Kind::seen;
    measurement.view = view;
    m_map.record(measurement);
  }
  /// \p views more views, the bearing sweeping \p parallax in all of them.
  void see(int id, int views, double parallax = 0.2, double innovation2 = 0.1)
  {
    for (int i = 0; i < views; ++i, m_time_s += 0.1)
      see(id, viewAt(m_time_s, 0.5 + parallax * i / std::max(1, views - 1), -0.1, 0.1, 0.9, innovation2));
  }
  static TrunkView viewAt(double time_s, double bearing, double left, double right, double evenness, double innovation2)
  {
    TrunkView view;
    view.time_s = time_s;
    view.bearing = bearing;
    view.left_contrast = left;
    view.right_contrast = right;
    view.evenness = evenness;
    view.innovation2 = innovation2;
    return view;
  }
  void miss(int id, int frames)
  {
    TrunkMeasurement measurement;
    measurement.id = id;
    for (int i = 0; i < frames; ++i)
      m_map.record(measurement);
  }
  int confirmed(const Trunk &place, int views = 20)
  {
    const int trunk = add(place);
    see(trunk, views);
    review();
    EXPECT_EQ(at(trunk).status, TrunkStatus::confirmed);
    return trunk;
  }
  /// Adds trunks that are in sight together, for two seconds from now on. \return their ids.
  std::vector<int> seeTogether(const std::vector<Trunk> &trunks)
  {
    std::vector<int> ids;
    const double began_s = m_time_s;
    for (const Trunk &trunk : trunks) {
      m_time_s = began_s;
      ids.push_back(add(trunk));
      see(ids.back(), 20);
    }
    return ids;
  }
  /// As if its history had been another.
  void change(int id, const std::function<void(MapTrunk &)> &spoil)
  {
    std::vector<MapTrunk> trunks = m_map.trunks();
    spoil(trunks[static_cast<std::size_t>(id)]);
    m_map = TrunkMap(m_options, trunks);
  }
  MapUpdate review(bool has_ranges = true) { return m_map.review(0, has_ranges); } // nothing becomes inactive

  MapOptions m_options;
  TrunkMap m_map{m_options};
  std::size_t m_next = 0;
  double m_time_s = 0;
};
} // namespace

TEST_F(Life, OfWhatIsGivenUpForGoodARecordRemains)
{
  for (const Memory memory : {Memory::all, Memory::undecided, Memory::in_sight}) {
    m_options.memory = memory;
    m_map = TrunkMap(m_options);
    m_time_s = 0;
    const int gone = add(trunkAt(3, 1)), left = add(trunkAt(6, -2)), stays = add(trunkAt(4, 3));
    see(left, 4);
    see(stays, 20);
    miss(gone, m_options.lost_misses);
    const double far_s = m_time_s + 2 * m_options.candidate_memory_s;
    see(stays, viewAt(far_s, 0.5, -0.1, 0.1, 0.9, 0.1));
    const std::vector<TrunkRecord> before = m_map.records();

    const MapUpdate update = m_map.review(far_s);

    const bool keeps_all = memory == Memory::all, keeps_left = memory != Memory::in_sight;
    EXPECT_EQ(m_map.trunks().size(), keeps_all ? 3u : keeps_left ? 2u : 1u);
    EXPECT_EQ(update.archived.size(), 3 - m_map.trunks().size());
    EXPECT_EQ(update.removed.size(), keeps_left ? 1u : 2u); // from the smoother
    EXPECT_TRUE(m_map.isActive(stays));
    EXPECT_FALSE(m_map.isActive(gone));
    EXPECT_FALSE(m_map.isActive(left));
    const std::vector<TrunkRecord> records = m_map.records();
    ASSERT_EQ(records.size(), before.size());
    for (std::size_t i = 0; i < records.size(); ++i) {
      EXPECT_EQ(records[i].id, static_cast<int>(i));
      EXPECT_LT((records[i].xy - before[i].xy).norm(), 1e-6);
      EXPECT_NEAR(records[i].radius, before[i].radius, 1e-7);
      EXPECT_NEAR(records[i].probability, before[i].probability, 1e-6);
      EXPECT_TRUE(records[i].covariance.isApprox(before[i].covariance, 1e-6));
      EXPECT_EQ(records[i].observations, before[i].observations);
      EXPECT_EQ(records[i].last_seen_s, before[i].last_seen_s);
    }
    EXPECT_EQ(records[0].reject_reason, RejectReason::missed);
    EXPECT_EQ(records[1].status, TrunkStatus::candidate);
    EXPECT_EQ(records[2].status, TrunkStatus::confirmed);
    EXPECT_EQ(add(trunkAt(9, 9)), 3); // no id is given twice
  }
}

/// Where trunks stand that make no pattern [m], and the same as a path sees them that has drifted by \p drift and \p
/// yaw.
std::vector<Trunk> constellation(double drift, double yaw)
{
  std::vector<Trunk> trunks;
  for (const Eigen::Vector3d &at :
       {Eigen::Vector3d(3, 1, .15), {6, -2, .11}, {4.5, 3.4, .2}, {8, 1.2, .13}, {9.3, -3.1, .17}, {7.1, 4.9, .24}}) {
    const Eigen::Vector2d xy = Eigen::Rotation2Dd(yaw) * at.head<2>() + Eigen::Vector2d(drift, -0.6 * drift);
    trunks.push_back(trunkAt(xy.x(), xy.y(), at.z()));
  }
  return trunks;
}

TEST_F(Life, TrunksAreRecognisedByTheirConstellationWhenThePathHasDrifted)
{
  seeTogether(constellation(0, 0));
  m_map.review(3);
  ASSERT_EQ(m_map.count(TrunkStatus::confirmed), 6);
  m_time_s = 60;
  const std::vector<int> again = seeTogether(constellation(1.4, 0.05));

  const MapUpdate update = m_map.review(63);

  EXPECT_EQ(m_map.count(TrunkStatus::confirmed), 6);
  ASSERT_EQ(update.merged.size(), 6u);
  for (const MapUpdate::Merge &merge : update.merged)
    EXPECT_EQ(merge.gone, merge.keep + 6);
  for (const int id : again)
    EXPECT_EQ(m_map.trunk(id).reject_reason, RejectReason::duplicate);
}

TEST_F(Life, OtherTrunksAreNotTakenForThoseOfAnEarlierVisit)
{
  seeTogether(constellation(0, 0));
  m_map.review(3);
  m_time_s = 60;
  seeTogether({trunkAt(23, 1, .15), trunkAt(25, -3, .11), trunkAt(26.5, 1.4, .2), trunkAt(29, 2.2, .13)});
  EXPECT_TRUE(m_map.review(63).merged.empty());
  EXPECT_EQ(m_map.count(TrunkStatus::confirmed), 10);
}

TEST_F(Life, AHypothesisThatCouldNotBeConfirmedItselfKeepsNoOtherBack)
{
  const auto seenWith = [this](int trunk, double least) { // the worst innovation that leaves so much evidence
    see(trunk, 20);
    change(trunk, [&](MapTrunk &t) {
      for (t.innovation2 = 9; m_map.evidence(t) < least && t.innovation2 > 0;)
        t.innovation2 -= 0.005;
      EXPECT_GT(t.innovation2, 0);
    });
  };
  const int narrow = add(trunkAt(3, 1, 0.15)), wide = add(trunkAt(3, 1, 0.22));
  seenWith(narrow, m_options.confirm_odds + 0.2);
  seenWith(wide, m_options.confirm_odds - 0.2); // and holds the other, which speaks for it by 1
  review();
  EXPECT_EQ(at(narrow).status, TrunkStatus::confirmed);
  EXPECT_NE(at(wide).status, TrunkStatus::confirmed);
}

TEST_F(Life, WithoutParallaxATrunkEarnsItsPlaceByEvenBordersAlone)
{
  const int even = add(trunkAt(5, 0)), uneven = add(trunkAt(5, 3)), faint = add(trunkAt(5, -3));
  for (int i = 0; i < 20; ++i) {
    see(even, viewAt(0.1 * i, 0.5, -0.05, 0.05, 0.6, 0.1));
    see(uneven, viewAt(0.1 * i, 1.5, -0.05, 0.05, 0.2, 0.1));
    see(faint, viewAt(0.1 * i, 2.5, -0.003, 0.05, 0.6, 0.1));
  }
  review(false);
  EXPECT_EQ(at(even).status, TrunkStatus::confirmed);
  EXPECT_NE(at(uneven).status, TrunkStatus::confirmed);
  EXPECT_NE(at(faint).status, TrunkStatus::confirmed);
  EXPECT_EQ(m_map.removeUnranged().removed.size(), m_map.trunks().size() - 2); // those two were given up before
  EXPECT_EQ(at(even).reject_reason, RejectReason::unranged);
  EXPECT_TRUE(m_map.active().empty());
}

TEST_F(Life, NothingIsConfirmedThatFailsOneCondition)
{
  struct Case
  {
    const char *what;
    std::function<void(MapTrunk &)> spoil;
  };
  const std::vector<Case> cases = {
      {"views", [&](MapTrunk &t) { t.observations = m_options.confirm_observations - 1; }},
      {"parallax", [](MapTrunk &t) { t.left = t.right = {}; }},
      {"thin", [&](MapTrunk &t) { t.trunk.log_radius = std::log(0.9 * m_options.radius_min); }},
      {"thick", [&](MapTrunk &t) { t.trunk.log_radius = std::log(1.1 * m_options.radius_max); }},
      {"misses", [&](MapTrunk &t) { t.misses = 20 * t.hits; }},
      {"predictions", [&](MapTrunk &t) { t.hits = m_options.confirm_predicted - 1; }},
      {"innovation", [&](MapTrunk &t) { t.innovation2 = 9; }},
  };
  for (const Case &c : cases)
    for (const bool is_spoilt : {true, false}) { // and it was only that
      m_map = TrunkMap(m_options);
      const int trunk = add(trunkAt(3, 1));
      see(trunk, 20, 0.38, 1);
      if (is_spoilt)
        change(trunk, c.spoil);
      review();
      EXPECT_EQ(at(trunk).status == TrunkStatus::confirmed, !is_spoilt) << c.what;
    }
}

TEST_F(Life, WhereItStandsInTheWorldDecidesNothing)
{
  const int trunk = add(trunkAt(3, 1)), unsure = add(trunkAt(3, -4));
  see(trunk, 20);
  see(unsure, 20);
  const double before = m_map.logOdds(at(trunk));
  change(trunk, [](MapTrunk &t) { t.covariance.topLeftCorner<2, 2>() *= 1e6; }); // the path has drifted by 14 m
  change(unsure, [](MapTrunk &t) { t.place_covariance *= 1e4; });
  EXPECT_EQ(m_map.logOdds(at(trunk)), before);
  EXPECT_LT(m_map.logOdds(at(unsure)), before - 1);
  review();
  EXPECT_EQ(at(trunk).status, TrunkStatus::confirmed);
}

TEST_F(Life, APlaceThatIsKnownLessWellThanAskedForLeavesATrunkOutOfTheRecordsAlone)
{
  for (const double most : {0.0, 0.5, 2.0}) {
    m_options.most_place_sigma = most;
    m_map = TrunkMap(m_options);
    const int trunk = confirmed(trunkAt(3, 1));
    change(trunk, [](MapTrunk &t) { t.place_covariance = 0.5 * Eigen::Matrix2d::Identity(); }); // 1 m
    const bool is_left_out = most == 0.5;
    EXPECT_EQ(m_map.records()[0].status, is_left_out ? TrunkStatus::candidate : TrunkStatus::confirmed) << most;
    EXPECT_EQ(m_map.records([](const Eigen::Vector2d &) { return 0.0; }, kBreastHeight, false)[0].status,
              TrunkStatus::confirmed); // bearings have no place
    EXPECT_EQ(m_map.records()[0].reject_reason, is_left_out ? RejectReason::undecided : RejectReason::none) << most;
    EXPECT_EQ(at(trunk).status, TrunkStatus::confirmed);
  }
}

TEST_F(Life, TheProbabilityThatIsToldIsTheOneThatDecides)
{
  const double least = 1 / (1 + std::exp(-m_options.confirm_odds));
  for (const double columns : {-0.1, 0.1}) {
    m_map = TrunkMap(m_options);
    const int trunk = add(trunkAt(3, 1));
    see(trunk, 20);
    EXPECT_GT(m_map.logOdds(at(trunk)), m_options.confirm_odds + 0.2);
    m_map.record(ConsistencyScore{trunk, m_options.confirm_odds + columns, 6, 0});
    review();
    EXPECT_EQ(at(trunk).status == TrunkStatus::confirmed, columns > 0);
    EXPECT_EQ(m_map.records()[0].probability >= least, columns > 0);
  }
  const int judged = confirmed(trunkAt(9, 1));
  m_map.applyDecisions({{judged, m_options.confirm_odds + 0.3, true, std::nullopt}});
  EXPECT_NEAR(m_map.records()[static_cast<std::size_t>(judged)].probability,
              1 / (1 + std::exp(-m_options.confirm_odds - 0.3)), 1e-9);
}

TEST_F(Life, RadiiAreExpectedToBeThoseOfTheTrunksThatAreConfirmed)
{
  const auto oddsOfThick = [this](int id) {
    MapTrunk thick = at(id);
    thick.trunk.log_radius = std::log(0.4);
    return m_map.evidence(thick) - evidence(id);
  };
  const int first = add(trunkAt(3, 1, 0.15));
  see(first, 20);
  const double before = oddsOfThick(first), unsure = m_map.radii().variance;
  EXPECT_NEAR(m_map.radii().log_mean, std::log(m_options.usual_radius), 1e-9);
  for (int i = 0; i < 4; ++i)
    see(add(trunkAt(3, -4 * (i + 1), 0.4)), 40);
  m_map.review(m_time_s);
  ASSERT_GT(m_map.count(TrunkStatus::confirmed), 3);
  EXPECT_GT(m_map.radii().log_mean, std::log(0.25));
  EXPECT_LT(m_map.radii().variance, unsure);
  EXPECT_GT(oddsOfThick(first), before + 0.5);
}

TEST_F(Life, TheOddsRiseWithWhatSpeaksForATrunkAndFallWithWhatSpeaksAgainst)
{
  const int trunk = add(trunkAt(3, 1));
  see(trunk, 20);
  const double odds = evidence(trunk);
  const auto after = [&](const std::function<void(MapTrunk &)> &change) {
    MapTrunk changed = at(trunk);
    change(changed);
    return m_map.evidence(changed);
  };
  EXPECT_GT(after([](MapTrunk &t) { t.redetections = 3; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.left.high += 0.2; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.contrast *= 2; }), odds);
  EXPECT_GT(after([](MapTrunk &t) { t.innovation2 /= 2; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.misses += 5; }), odds);
  EXPECT_EQ(after([](MapTrunk &t) { t.points.behind = 3; }), odds); // a slipped track or two
  EXPECT_LT(after([](MapTrunk &t) { t.points.behind = 10; }), odds - 1);
  EXPECT_GT(after([](MapTrunk &t) { t.points.behind = t.points.on = 10; }),
            after([](MapTrunk &t) { t.points.behind = 10; }) + 0.5);
  EXPECT_LT(after([](MapTrunk &t) { t.trunk.log_radius += 1; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.trunk.log_radius -= 1; }), odds);
  EXPECT_LT(after([](MapTrunk &t) { t.place_covariance *= 9; }), odds);
}

TEST_F(Life, ATrunkWhoseOddsAreBadIsGivenUp)
{
  const int trunk = add(trunkAt(3, 1));
  see(trunk, m_options.reject_observations - 1, 0.2, 9);
  review();
  EXPECT_EQ(at(trunk).status, TrunkStatus::candidate); // too early to say
  see(trunk, 1, 0, 9);
  miss(trunk, m_options.lost_misses - 1);
  ASSERT_LT(evidence(trunk), m_options.reject_candidate);
  const int known = confirmed(trunkAt(9, 1));
  change(known, [](MapTrunk &t) { t.innovation2 = 9; });
  ASSERT_LT(evidence(known), m_options.reject_confirmed);
  review();
  for (const int gone : {trunk, known}) {
    EXPECT_EQ(at(gone).status, TrunkStatus::lost);
    EXPECT_TRUE(at(gone).removed);
  }
}

/// What the columns of many frames speak against goes, also when its borders are tracked well.
TEST_F(Life, ATrunkWhoseColumnsSpeakAgainstItIsGivenUpOnceEnoughWereSeen)
{
  const int trunk = confirmed(trunkAt(3, 1)), other = confirmed(trunkAt(6, 1));
  m_map.record(ConsistencyScore{trunk, -2, 6});
  m_map.record(ConsistencyScore{other, 2, 30});
  review();
  EXPECT_FALSE(at(trunk).removed);
  m_map.record(ConsistencyScore{trunk, -2, 12});
  review();
  EXPECT_TRUE(at(trunk).removed);
  EXPECT_FALSE(at(other).removed);
}

/// Between other borders it is the same trunk of the map, and nothing that was seen between the former ones is left.
TEST_F(Life, AnotherReadingKeepsTheTrunkAndForgetsItsViews)
{
  const int trunk = confirmed(trunkAt(3, 1, 0.08));
  m_map.record(ConsistencyScore{trunk, 1, 20, 1});
  const std::size_t before = at(trunk).smoother_id;
  const double first_s = at(trunk).first_seen_s;
  NewTrunk wider;
  wider.smoother_id = 77;
  wider.trunk = trunkAt(3.02, 0.95, 0.15);
  wider.covariance = 4e-4 * Matrix5d::Identity();
  wider.views = {viewAt(m_time_s, 0.5, 0.2, -0.2, 0.9, 0.1), viewAt(m_time_s + 0.1, 0.52, 0.2, -0.2, 0.9, 0.1)};
  EXPECT_EQ(m_map.replaceHypothesis(trunk, wider), before);
  EXPECT_EQ(at(trunk).smoother_id, 77u);
  EXPECT_EQ(at(trunk).status, TrunkStatus::confirmed);
  EXPECT_NEAR(at(trunk).trunk.radius(), 0.15, 1e-12);
  EXPECT_EQ(at(trunk).observations, 2);
  EXPECT_EQ(at(trunk).consistency_views, 0);
  EXPECT_FALSE(at(trunk).is_silhouette);
  EXPECT_NEAR(at(trunk).left_contrast.value_or(0), 0.2, 1e-12); // not mixed with the former border's
  EXPECT_NEAR(at(trunk).left.high - at(trunk).left.low, 0.02, 1e-12);
  EXPECT_EQ(at(trunk).first_seen_s, first_s);
  EXPECT_EQ(at(trunk).last_seen_s, m_time_s + 0.1);
}

TEST_F(Life, AConfirmedTrunkThatIsLostKeepsItsPlaceAndComesBackUnderItsId)
{
  for (const bool is_hidden : {false, true}) { // missed, or where its place is not known any more
    m_map = TrunkMap(m_options);
    const int trunk = confirmed(trunkAt(3, 1), 200);
    miss(trunk, m_options.lost_misses - 1);
    see(trunk, 1);
    miss(trunk, m_options.lost_misses - 1);
    EXPECT_TRUE(review().changes.empty()) << "a view ends a row of misses";
    const int candidate = add(trunkAt(6, -2));
    see(candidate, 3);
    m_map.markOutOfSight(candidate);
    is_hidden ? m_map.markOutOfSight(trunk) : miss(trunk, 1);
    review();
    EXPECT_EQ(at(candidate).status, TrunkStatus::candidate);
    EXPECT_EQ(at(trunk).status, TrunkStatus::lost);
    EXPECT_TRUE(m_map.isActive(trunk)); // still predicted, so it can be found again
    EXPECT_EQ(m_map.records()[0].status, TrunkStatus::confirmed);
    EXPECT_EQ(m_map.records()[0].reject_reason, RejectReason::none);
    const double odds = evidence(trunk);
    miss(trunk, 500);
    EXPECT_EQ(evidence(trunk), odds) << "what hides it says nothing more against it";
    EXPECT_TRUE(m_map.review(1e6).changes.empty()) << "it is never left behind";
    see(trunk, 1);
    review();
    EXPECT_EQ(at(trunk).status, TrunkStatus::confirmed);
  }
}

TEST_F(Life, ABorderWhoseSignTurnsOverBeginsAnew)
{
  const int trunk = add(trunkAt(3, 1));
  see(trunk, viewAt(1.0, 0.3, -0.2, 0.1, 1, 0));
  see(trunk, viewAt(1.1, 0.3, -0.1, 0.2, 1, 0));
  EXPECT_NEAR(*at(trunk).left_contrast, -0.17, 1e-12);

  see(trunk, viewAt(1.2, 0.3, 0.05, 0.2, 1, 0));

  EXPECT_NEAR(*at(trunk).left_contrast, 0.05, 1e-12);
  EXPECT_GT(*at(trunk).right_contrast, 0.1);
}

TEST_F(Life, ACandidateThatIsLeftBehindKeepsWhatWasSeenOfItAndIsRemovedWhereThatIsNothing)
{
  m_time_s = 10;
  const int never_seen = add(trunkAt(3, 1)), seen = add(trunkAt(5, 1));
  see(seen, viewAt(10.0, 0.3, 0.2, 0.2, 1, 0));
  EXPECT_TRUE(m_map.review(10.0 + 0.99 * m_options.candidate_memory_s).removed.empty());
  EXPECT_EQ(m_map.active().size(), 2u);

  const MapUpdate update = m_map.review(10.0 + 1.01 * m_options.candidate_memory_s);

  EXPECT_EQ(update.removed, std::vector<std::size_t>{at(never_seen).smoother_id});
  EXPECT_EQ(at(never_seen).reject_reason, RejectReason::unseen);
  EXPECT_TRUE(at(never_seen).removed);
  EXPECT_FALSE(at(seen).removed);
  EXPECT_TRUE(m_map.active().empty());
  EXPECT_EQ(m_map.records()[1].reject_reason, RejectReason::undecided);
}

TEST_F(Life, ACandidateThatWasLeftBehindIsConfirmedInTheEndWhereItsEstimatesNowAllowIt)
{
  const int candidate = add(trunkAt(3, 1));
  see(candidate, 20);
  Trunk wide = trunkAt(3, 1);
  wide.log_radius = std::log(1.05 * m_options.radius_max); // as it is read for now
  m_map.refresh({candidate, wide, 1e-4 * Matrix5d::Identity()});
  m_map.review(100);
  ASSERT_TRUE(at(candidate).inactive);

  m_map.refresh({candidate, trunkAt(3.1, 1), 1e-4 * Matrix5d::Identity()});
  m_map.reviewAll();

  EXPECT_EQ(at(candidate).status, TrunkStatus::confirmed);
  EXPECT_EQ(m_map.records()[0].reject_reason, RejectReason::none);
}

TEST_F(Life, TwoTrunksInOnePlaceBecomeOneAndNeighboursWithEnoughBetweenThemStayTwo)
{
  confirmed(trunkAt(3 + 0.15 + 0.15 + m_options.merge_distance + 0.01, 1), 60);
  const int old = confirmed(trunkAt(3, 1), 60);
  ASSERT_EQ(m_map.count(TrunkStatus::confirmed), 2);
  const int duplicate = add(trunkAt(3 - 0.15 - 0.15 - m_options.merge_distance + 0.01, 1));
  see(duplicate, 3);
  const auto changes = review().changes;
  ASSERT_EQ(changes.size(), 1u);
  EXPECT_EQ(changes[0].id, at(duplicate).id);
  EXPECT_EQ(changes[0].into, at(old).id);
  EXPECT_EQ(at(duplicate).status, TrunkStatus::merged);
  EXPECT_TRUE(at(duplicate).removed);
  EXPECT_FALSE(at(old).removed);
  EXPECT_TRUE(review().changes.empty()); // a merged trunk merges no more
}

TEST_F(Life, ATrunkThatComesBackAsADuplicateHandsItsViewsOver)
{
  const int old = confirmed(trunkAt(3, 1), 60), known = at(old).observations;
  m_time_s += 30; // another visit
  const int duplicate = add(trunkAt(3.12, 1));
  see(duplicate, 3);
  EXPECT_TRUE(review().changes.empty()); // what moves the map must earn its place first
  see(duplicate, 17);
  const MapUpdate update = review();
  ASSERT_EQ(update.merged.size(), 1u);
  EXPECT_EQ(update.merged[0].keep, at(old).smoother_id);
  EXPECT_EQ(update.merged[0].gone, at(duplicate).smoother_id);
  EXPECT_TRUE(update.removed.empty());
  EXPECT_EQ(at(duplicate).reject_reason, RejectReason::duplicate);
  EXPECT_EQ(at(old).observations, known + 20);
  EXPECT_EQ(at(old).last_seen_s, at(duplicate).last_seen_s);
}

/// A centimetre and a hundredth of the radius are known: tied to the other visit, its views would move the path to
/// where a trunk a quarter as wide again looks as wide.
TEST_F(Life, AVisitOfAnotherWidthOrPlaceTiesNothing)
{
  for (const Trunk &other : {trunkAt(3.05, 1, 0.19), trunkAt(3.3, 1, 0.15)}) {
    m_map = TrunkMap(m_options);
    const int old = confirmed(trunkAt(3, 1), 60);
    m_time_s += 30;
    const int visit = add(other);
    see(visit, 20);
    const MapUpdate update = review();
    EXPECT_TRUE(update.merged.empty());
    EXPECT_FALSE(at(old).removed || at(visit).removed); // the path may have drifted: the constellation may tie them
    m_map.reviewAll();
    EXPECT_TRUE(at(old).removed || at(visit).removed); // two do not stand in one place
  }
}

/// A track that slipped from its border was behind it for ten frames.
TEST_F(Life, ATrunkSeenLongIsNoGapForATrackThatSlipped)
{
  const int trunk = add(trunkAt(3, 1)), gap = add(trunkAt(6, -2));
  for (int frame = 0; frame < 100; ++frame) {
    see(trunk, 1);
    see(gap, 1);
    m_map.record(PointCount{trunk, 0, frame < 10 ? 1 : 0, 0, 0});
    m_map.record(PointCount{gap, 0, frame % 3 > 0 ? 1 : 0, 0, 0});
  }
  EXPECT_GT(at(trunk).seeThroughRatio(), 4);
  EXPECT_FALSE(at(trunk).isGap());
  EXPECT_TRUE(at(gap).isGap());
}

TEST_F(Life, WhatLeansFartherThanTrunksDoIsNone)
{
  const int trunk = confirmed(trunkAt(3, 1), 60);
  change(trunk, [&](MapTrunk &known) { known.trunk.lean = {0, 4.9 * m_options.lean_sigma}; });
  EXPECT_TRUE(review().changes.empty());
  change(trunk, [&](MapTrunk &known) { known.trunk.lean = {0, 5.1 * m_options.lean_sigma}; });
  review();
  EXPECT_EQ(at(trunk).reject_reason, RejectReason::doubted);
}

TEST_F(Life, ARivalSeenAtTheSameTimeTakesItsViewsWithIt)
{
  confirmed(trunkAt(3, 1), 60);
  m_time_s -= 1; // the same frames, and so the same lines of the image
  const int rival = add(trunkAt(3.3, 1));
  see(rival, 3);
  const MapUpdate update = review();
  EXPECT_TRUE(update.merged.empty());
  EXPECT_EQ(update.removed, std::vector<std::size_t>{at(rival).smoother_id});
  EXPECT_EQ(at(rival).reject_reason, RejectReason::outdone);
}

TEST_F(Life, HypothesesForOnePlaceCompeteUntilOneIsConfirmed)
{
  const int narrow = add(trunkAt(3, 1, 0.1)), &wide = add(trunkAt(3.05, 1, 0.2));
  see(narrow, m_options.confirm_observations - 1);
  see(wide, m_options.confirm_observations - 1);
  EXPECT_TRUE(review().changes.empty());
  EXPECT_EQ(m_map.count(TrunkStatus::candidate), 2);
  see(narrow, 1);
  see(wide, 1);
  review(); // equally sound: the wider is the silhouette
  EXPECT_EQ(at(wide).status, TrunkStatus::confirmed);
  EXPECT_EQ(at(narrow).status, TrunkStatus::merged);
}

TEST_F(Life, AWiderHypothesisThatIsSoundReplacesAConfirmedEdgeOnItsBark)
{
  const int edge = confirmed(trunkAt(3, 1, 0.1));
  const int silhouette = add(trunkAt(3.05, 1, 0.18)), &beside = add(trunkAt(3.3, 1, 0.12));
  see(silhouette, 5);
  see(beside, 5);
  review();
  EXPECT_EQ(at(silhouette).status, TrunkStatus::candidate); // may still turn out to be it
  EXPECT_EQ(at(beside).status, TrunkStatus::merged);        // cannot stand there
  see(silhouette, 15);
  review();
  EXPECT_EQ(at(edge).status, TrunkStatus::merged);
  review();
  EXPECT_EQ(at(silhouette).status, TrunkStatus::confirmed);
}

/// The background beside both borders: nothing wider can be that trunk, and two cannot stand in one place.
TEST_F(Life, NothingWiderIsHeldBesideATrunkWhoseSilhouetteWasSeen)
{
  const int trunk = confirmed(trunkAt(3, 1, 0.1)), round = add(trunkAt(3.05, 1, 0.18));
  see(round, 5);
  m_map.record(ConsistencyScore{trunk, 3, 11, 0.5}); // too few views
  review();
  EXPECT_EQ(at(round).status, TrunkStatus::candidate);
  m_map.record(ConsistencyScore{trunk, 3, 12, 0.1}); // nor is this the background
  review();
  EXPECT_EQ(at(round).status, TrunkStatus::candidate);
  EXPECT_FALSE(m_map.associate(trunkAt(3.05, 1, 0.25)));
  m_map.record(ConsistencyScore{trunk, 3, 12, 0.5});
  review();
  EXPECT_EQ(at(round).status, TrunkStatus::merged);
  EXPECT_TRUE(m_map.associate(trunkAt(3.05, 1, 0.25)));
  m_map.record(ConsistencyScore{trunk, 3, 20, -0.5}); // light that changes takes nothing back
  EXPECT_TRUE(m_map.associate(trunkAt(3.05, 1, 0.25)));
}

TEST_F(Life, TheSameHypothesisIsNotTakenInTwice)
{
  const int candidate = add(trunkAt(3, 1));
  EXPECT_TRUE(m_map.associate(trunkAt(3.05, 1)));
  EXPECT_EQ(at(candidate).redetections, 1);
  EXPECT_FALSE(m_map.associate(trunkAt(3.05, 1, 0.3))); // another hypothesis
  EXPECT_FALSE(m_map.associate(trunkAt(4, 1)));
  EXPECT_EQ(at(candidate).redetections, 1);
}

TEST_F(Life, ParallaxIsTheSpreadOfTheBearingsAlsoAcrossHalfATurn)
{
  const int trunk = add(trunkAt(-3, 0));
  for (const double bearing : {3.10, -3.10, 3.05})
    see(trunk, viewAt(0, bearing, 0, 0, 0.9, 0));
  EXPECT_NEAR(at(trunk).parallax(), 2 * M_PI - 6.2 + 0.05, 1e-12);
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
    const auto place = static_cast<std::size_t>(uniform(random) * static_cast<double>(m_map.trunks().size()));
    const MapTrunk &picked = m_map.trunks()[place];
    if (!picked.removed && uniform(random) < 0.7)
      see(picked.id, 1 + static_cast<int>(4 * uniform(random)), 0.1, 2 * uniform(random));
    else if (!picked.removed)
      miss(picked.id, 1 + static_cast<int>(4 * uniform(random)));
    std::vector<MapTrunk> before = m_map.trunks();
    for (const MapChange &change : review().changes) {
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
  const Trunk leaning{{3, 1}, std::log(0.15), {0.1, -0.05}};
  const int trunk = add(leaning);
  Matrix5d covariance = Matrix5d::Zero();
  covariance.diagonal() << 0.01, 0.02, 0.04, 1e-3, 2e-3;
  m_map.refresh({trunk, leaning, covariance});
  see(trunk, 4);
  const TrunkRecord record = m_map.records().at(0);
  EXPECT_LT((record.xy - Eigen::Vector2d(3 + 0.13, 1 - 0.065)).norm(), 1e-12);
  EXPECT_NEAR(record.covarianceXy()(0, 0), 0.01 + 1.3 * 1.3 * 1e-3, 1e-12);
  EXPECT_NEAR(record.covarianceXy()(1, 1), 0.02 + 1.3 * 1.3 * 2e-3, 1e-12);
  EXPECT_NEAR(record.covariance(2, 2), 0.04 * 0.15 * 0.15, 1e-12);
  EXPECT_EQ(record.observations, 4);
  EXPECT_NEAR(record.last_seen_s - record.first_seen_s, 0.3, 1e-12);
}
