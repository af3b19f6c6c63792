// SPDX-License-Identifier: GPL-2.0-or-later
// The mapper as a ViSP user calls it, on the demonstration flight.
#include "input/recorded_source.h"
#include "map/trunk_map.h"
#include "mbt/cao_reader.h"
#include <bole/options.h>
#include <bole/vpMbTrunkTracker.h>
#include <bole/vpTrunkMapper.h>

#include <gmock/gmock.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <visp3/core/vpTrackingException.h>

using namespace bole;

namespace
{
const std::string kFlight = BOLE_SOURCE_DIR "/data/park-forward";

vpTrunkMapper demonstrationMapper()
{
  return vpTrunkMapper(PinholeCamera().toVisp(), AslSource(kFlight).bMc().toVisp());
}

/// The demonstration flight through a mapper, once for all tests.
class TrunkMapper : public testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    s_mapper = std::make_unique<vpTrunkMapper>(demonstrationMapper());
    AslSource source(kFlight);
    Frame frame;
    for (int k = 0; source.next(frame); ++k) {
      s_mapper->track(frame.image, 1e-9 * static_cast<double>(frame.stamp_ns), frame.wMb_odometry->toVisp(),
                      frame.gyro);
      s_image = frame.image;
      s_truth = *frame.wMb_truth;
      frame = Frame();
    }
    s_mapper->finish();
  }
  static void TearDownTestSuite() { s_mapper.reset(); }

  inline static std::unique_ptr<vpTrunkMapper> s_mapper;
  inline static vpImage<unsigned char> s_image; ///< the last one
  inline static Pose s_truth;
};

TEST_F(TrunkMapper, MapsTheDemonstrationFlightAndKnowsWhereItIs)
{
  EXPECT_GE(s_mapper->getTrunks().size(), 6u);
  const double least = Options().map.confirm_probability;
  for (const TrunkRecord &trunk : s_mapper->getTrunks()) {
    EXPECT_EQ(trunk.status, TrunkStatus::confirmed);
    EXPECT_GE(trunk.probability, least) << trunk.id;
  }
  EXPECT_LT((Pose::fromVisp(s_mapper->getPose()).t - s_truth.t).norm(), 1);
  vpHomogeneousMatrix wMb;
  s_mapper->getPose(wMb);
  EXPECT_EQ(wMb, s_mapper->getPose());
  EXPECT_NO_THROW(s_mapper->testTracking());
}

TEST_F(TrunkMapper, TheTrackerLocalisesInTheModelThatTheMapperSaved)
{
  const std::string model = testing::TempDir() + "bole_map.cao";
  s_mapper->saveModel(model);
  vpMbTrunkTracker tracker;
  tracker.loadModel(model);
  tracker.setCameraParameters(PinholeCamera().toVisp());
  vpHomogeneousMatrix cMw;
  s_mapper->getCameraPose(cMw);
  tracker.initFromPose(s_image, cMw);
  vpImage<unsigned char> again = s_image; // the same view with a little noise: it is not taken for a frozen camera
  for (unsigned int i = 0; i < again.getSize(); ++i)
    again.bitmap[i] = static_cast<unsigned char>(std::min(255u, again.bitmap[i] + (i * 7919u >> 3) % 3));
  ASSERT_NO_THROW(tracker.track(again));
  const Pose moved = Pose::fromVisp(tracker.getPose()) * Pose::fromVisp(cMw).inverse();
  EXPECT_LT(moved.t.norm(), 0.3);
  EXPECT_EQ(readCao(model).size(), s_mapper->getTrunks().size());
}

TEST_F(TrunkMapper, RefusesSettingsThatComeTooLate)
{
  EXPECT_THROW(s_mapper->setCameraHeight(1.5), vpException);
  EXPECT_THROW(s_mapper->loadConfigFile(BOLE_SOURCE_DIR "/config/default.yaml"), vpException);
}

TEST(TrunkMapperOfNothing, SaysSo)
{
  vpTrunkMapper mapper = demonstrationMapper();
  EXPECT_TRUE(mapper.getTrunks().empty());
  EXPECT_THROW(mapper.testTracking(), vpTrackingException);
  EXPECT_THROW(mapper.saveModel(testing::TempDir() + "bole_none.cao"), vpException);
  EXPECT_THROW(mapper.track(vpImage<unsigned char>()), vpException);
  EXPECT_THROW(mapper.setCameraHeight(-1), vpException);
}

TEST(TrunkMapperFrames, OneThatCannotBeTrustedThrowsWhenAskedAndTheNextGoesOn)
{
  AslSource source(kFlight);
  vpTrunkMapper mapper = demonstrationMapper();
  Frame frame;
  ASSERT_TRUE(source.next(frame));
  mapper.track(frame.image, 0);
  EXPECT_NO_THROW(mapper.testTracking());
  mapper.track(vpImage<unsigned char>(100, 100, 90), 0.1);
  EXPECT_THROW(mapper.testTracking(), vpTrackingException);
  Frame next;
  ASSERT_TRUE(source.next(next));
  mapper.track(next.image, 0.2);
  EXPECT_NO_THROW(mapper.testTracking());
}
} // namespace
