// SPDX-License-Identifier: GPL-2.0-or-later
// The mapper as a ViSP user calls it, on the demonstration flight.
#include "support/test.h"

#include "input/recorded_source.h"
#include "map/trunk_map.h"
#include "mbt/model_files.h"
#include <bole/options.h>
#include <bole/vpMbTrunkTracker.h>
#include <bole/vpTrunkMapper.h>
#include <visp3/core/vpTrackingException.h>

using namespace bole;
using testing::HasSubstr;

namespace
{
const std::string kFlight = BOLE_SOURCE_DIR "/data/park-forward";

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kFrames = 24, kMiddle = 12; // of the demonstration flight

vpTrunkMapper demonstrationMapper() { return vpTrunkMapper(PinholeCamera().toVisp(), forwardCamera().toVisp()); }

/// What track() is given.
struct Step
{
  vpImage<unsigned char> I;
  double stamp_s = 0;
  vpHomogeneousMatrix wMb;
  std::vector<GyroSample> gyro;
};

const std::vector<Step> &demonstration()
{
  static const std::vector<Step> kSteps = [] {
    std::vector<Step> steps;
    AslSource source(kFlight);
    for (Frame frame; source.next(frame);)
      steps.push_back(
          {frame.image, 1e-9 * static_cast<double>(frame.stamp_ns), frame.wMb_odometry->toVisp(), frame.gyro});
    return steps;
  }();
  return kSteps;
}

void track(vpTrunkMapper &mapper, const Step &step, bool with_odometry = true)
{
  if (with_odometry)
    mapper.track(step.I, step.stamp_s, step.wMb, step.gyro);
  else
    mapper.track(step.I, step.stamp_s);
}

/// The demonstration flight through a mapper, once for all tests.
class TrunkMapper : public testing::Test
{
protected:
  static void SetUpTestSuite()
  {
    s_mapper = std::make_unique<vpTrunkMapper>(demonstrationMapper());
    for (const Step &step : demonstration())
      track(*s_mapper, step);
    s_mapper->finish();
  }
  static void TearDownTestSuite() { s_mapper.reset(); }

  inline static std::unique_ptr<vpTrunkMapper> s_mapper;
};

TEST_F(TrunkMapper, MapsTheDemonstrationFlightAndKnowsWhereItIs)
{
  EXPECT_GE(s_mapper->getTrunks().size(), 6u);
  const double least = Options().map.confirm_probability;
  for (const TrunkRecord &trunk : s_mapper->getTrunks()) {
    EXPECT_EQ(trunk.status, TrunkStatus::confirmed);
    EXPECT_GE(trunk.probability, least) << trunk.id;
  }
  EXPECT_LT((Pose::fromVisp(s_mapper->getPose()).t - AslSource(kFlight).truth().back().wMb.t).norm(), 1);
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
  const vpImage<unsigned char> &last = demonstration().back().I;
  tracker.initFromPose(last, cMw);
  vpImage<unsigned char> again = last; // the same view with a little noise: it is not taken for a frozen camera
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
/// What testTracking() says, empty where it is content.
std::string complaintOf(const vpTrunkMapper &mapper)
{
  try {
    mapper.testTracking();
  }
  catch (const vpTrackingException &error) {
    return error.getStringMessage();
  }
  return "";
}

/// What a ViSP user's loop may hand to the mapper by mistake.
struct Oddity
{
  const char *name, *message; ///< \p message: a part of it
  std::function<void(Step &)> spoil;
  bool concerns_odometry = true; ///< pose or gyro
};

/// What no frame may hold; the stamps are those of a frame after the first.
std::vector<Oddity> oddities()
{
  return {{"NaN stamp", "stamp = nan s", [](Step &s) { s.stamp_s = kNaN; }, false},
          {"infinite stamp", "stamp = inf s", [](Step &s) { s.stamp_s = INFINITY; }, false},
          {"milliseconds", "stamp = 1e+12 s", [](Step &s) { s.stamp_s = 1e12; }, false},
          {"the stamp before", "must be later than", [](Step &s) { s.stamp_s -= 0.1; }, false},
          {"an earlier stamp", "must be later than", [](Step &s) { s.stamp_s -= 5; }, false},
          {"NaN pose", "position of the odometry", [](Step &s) { s.wMb[0][3] = kNaN; }},
          {"NaN rotation", "must be a rotation", [](Step &s) { s.wMb[1][1] = kNaN; }},
          {"scaled rotation", "must be a rotation", [](Step &s) { s.wMb[0][0] *= 3; }},
          {"mirrored rotation", "must be a rotation",
           [](Step &s) {
             for (int i = 0; i < 3; ++i)
               s.wMb[i][1] *= -1;
           }},
          {"NaN gyro", "angular rate", [](Step &s) { s.gyro.at(2).rate.x() = kNaN; }},
          {"NaN accelerometer", "specific force", [](Step &s) { s.gyro.at(2).force = Eigen::Vector3d(0, 0, kNaN); }},
          {"gyro out of order", "earlier than the sample", [](Step &s) { std::swap(s.gyro.at(1), s.gyro.at(2)); }}};
}

/// Offers a frame spoilt in every way, and expects that it is refused.
void offerOddFrames(vpTrunkMapper &mapper, std::size_t k, bool with_odometry)
{
  for (const Oddity &odd : oddities()) {
    const bool is_order = std::string(odd.message) == "must be later than"; // nothing was before the first frame
    if ((k == 0 && is_order) || (odd.concerns_odometry && !with_odometry))
      continue;
    Step step = demonstration()[k];
    if (step.gyro.empty())
      step.gyro = demonstration()[k + 1].gyro;
    odd.spoil(step);
    try {
      track(mapper, step, with_odometry);
      ADD_FAILURE() << odd.name << " is taken as frame " << k;
    }
    catch (const vpException &error) {
      EXPECT_THAT(error.getStringMessage(), HasSubstr(odd.message)) << odd.name;
      EXPECT_THAT(error.getStringMessage(), HasSubstr("frame " + std::to_string(k))) << odd.name;
    }
  }
}

/// All that a flight tells, as numbers.
std::vector<double> flown(bool with_odometry, bool offers_odd_frames)
{
  vpTrunkMapper mapper = demonstrationMapper();
  std::vector<double> all;
  const auto addPose = [&] {
    const vpHomogeneousMatrix wMb = mapper.getPose();
    all.insert(all.end(), wMb.data, wMb.data + 16);
  };
  for (std::size_t k = 0; k < kFrames; ++k) {
    if (offers_odd_frames && (k == 0 || k == kMiddle || k == kFrames - 1))
      offerOddFrames(mapper, k, with_odometry);
    track(mapper, demonstration()[k], with_odometry);
    EXPECT_EQ(complaintOf(mapper), "") << k;
    addPose();
  }
  if (offers_odd_frames)
    offerOddFrames(mapper, kFrames, with_odometry);
  mapper.finish();
  addPose();
  for (const TrunkRecord &trunk : mapper.getTrunks())
    all.insert(all.end(), {trunk.xy.x(), trunk.xy.y(), trunk.radius, trunk.probability, double(trunk.observations)});
  return all;
}

TEST(OddFramesOfAMapper, LeaveNoTraceInAFlightWithOdometryAndGyro) { EXPECT_EQ(flown(true, true), flown(true, false)); }

TEST(OddFramesOfAMapper, LeaveNoTraceInAFlightOfImagesAlone) { EXPECT_EQ(flown(false, true), flown(false, false)); }

TEST(OddFramesOfAMapper, ARefusedFirstFrameStartsNothing)
{
  vpTrunkMapper mapper = demonstrationMapper();
  offerOddFrames(mapper, 0, true);
  EXPECT_THROW(mapper.track(vpImage<unsigned char>(), 0), vpException) << "an empty image tells no size";
  EXPECT_THROW(mapper.track(vpImage<unsigned char>(100, 100, 90), 0), vpException) << "its middle is not the camera's";
  EXPECT_NO_THROW(mapper.setCameraHeight(1.5));
  EXPECT_THAT(complaintOf(mapper), HasSubstr("no image was tracked yet"));
  track(mapper, demonstration()[0]);
  EXPECT_EQ(complaintOf(mapper), "");
}

TEST(OddFramesOfAMapper, AnImageOfAnotherSizeOrNoneIsToldOfAndTheFlightGoesOn)
{
  for (const std::size_t at : {std::size_t{1}, kMiddle, kFrames - 2}) {
    vpTrunkMapper mapper = demonstrationMapper();
    for (std::size_t k = 0; k < kFrames; ++k) {
      Step step = demonstration()[k];
      if (k == at)
        step.I.resize(100, 100);
      if (k == at + 1)
        step.I.resize(0, 0);
      track(mapper, step);
      EXPECT_THAT(complaintOf(mapper), k == at       ? HasSubstr("frame is resized: image of 100x100 px")
                                       : k == at + 1 ? HasSubstr("frame is missing: the image is empty")
                                                     : HasSubstr(""));
      EXPECT_LT((Pose::fromVisp(mapper.getPose()).t - Pose::fromVisp(step.wMb).t).norm(), 0.2) << k;
    }
    EXPECT_EQ(complaintOf(mapper), at + 1 == kFrames - 1 ? "vpTrunkMapper: frame is missing: the image is empty" : "");
  }
}

TEST(OddFramesOfAMapper, ALateFrameIsAGapAndNotRefused)
{
  vpTrunkMapper mapper = demonstrationMapper();
  for (std::size_t k = 0; k < kFrames; ++k) {
    Step step = demonstration()[k];
    const double late_s = k >= kMiddle ? 5 : 0; // the drone hovered, and nothing came
    step.stamp_s += late_s;
    for (GyroSample &sample : step.gyro)
      sample.stamp_ns += std::llround(1e9 * late_s);
    EXPECT_NO_THROW(track(mapper, step));
  }
  EXPECT_LT((Pose::fromVisp(mapper.getPose()).t - Pose::fromVisp(demonstration()[kFrames - 1].wMb).t).norm(), 0.3);
}

TEST(MapperOfImages, TakesAHoveringDroneForNoFrozenCamera)
{
  vpTrunkMapper mapper = demonstrationMapper();
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0, 2);
  const Step &there = demonstration()[40];
  for (int k = 0; k < 60; ++k) {
    Step step = there;
    step.stamp_s = 0.1 * k;
    for (unsigned i = 0; i < step.I.getSize(); ++i)
      step.I.bitmap[i] = static_cast<unsigned char>(std::clamp(there.I.bitmap[i] + noise(random), 0.0, 255.0));
    step.gyro.clear();
    for (int i = 0; i < 5; ++i)
      step.gyro.push_back({std::llround(1e9 * step.stamp_s) - (4 - i) * 20'000'000,
                           1e-3 * Eigen::Vector3d(noise(random), noise(random), noise(random)),
                           {}});
    track(mapper, step);
    EXPECT_EQ(complaintOf(mapper), "") << k;
  }
}

TEST(MapperOfSensors, TellsWhichContradictsTheOthersAndThrowsWhereThePoseRestsOnIt)
{
  for (const bool spoils_odometry : {true, false}) {
    vpTrunkMapper mapper = demonstrationMapper();
    std::size_t complaints = 0;
    for (std::size_t k = 0; k < 80; ++k) {
      Step step = demonstration()[k];
      if (k >= 30 && spoils_odometry)
        step.wMb = demonstration()[30].wMb; // frozen
      if (k >= 30 && !spoils_odometry)
        for (GyroSample &sample : step.gyro)
          sample.rate += Eigen::Vector3d(0.06, -0.08, 0.1);
      track(mapper, step);
      complaints += !complaintOf(mapper).empty();
    }
    std::set<std::string> liars;
    for (const SensorVerdict &verdict : mapper.getVerdicts()) {
      liars.insert(verdict.sensor);
      EXPECT_NEAR(verdict.since_s, 3, 1.5);
    }
    EXPECT_EQ(liars, std::set<std::string>{spoils_odometry ? "odometry" : "gyro"});
    if (spoils_odometry) {
      EXPECT_GE(complaints, 49u);
      EXPECT_THAT(complaintOf(mapper), HasSubstr("odometry: frozen since 3.0 s"));
    }
    else {
      EXPECT_EQ(complaints, 0u) << "the images do without the gyro";
    }
  }
}
} // namespace
