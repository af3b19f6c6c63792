// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "baseline/comparison.h"
#include "support/units.h"
#include <bole/cylinder.h>
#include <bole/vpMbTrunkTracker.h>
#include <nlohmann/json.hpp>
#include <opencv2/videoio.hpp>

namespace
{
using namespace bole;
using test::cameraAt;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A short flight through drawn trunks; the odometry is the truth, or drifts by \p drift [m] a frame to the left.
TestFlight drawnFlight(int frames, double drift = 0)
{
  TestFlight flight;
  flight.name = "drawn";
  flight.trunks = test::smallWood();
  for (int k = 0; k < frames; ++k) {
    TestFrame frame;
    const Eigen::Vector3d at(0.04 * k, 0.01 * k, 1.2);
    // nose up a little: ViSP 3.5 puts no moving edges on a limb that is exactly vertical in the image
    frame.cMo = cameraAt(at, 0.004 * k, 0.02);
    frame.odometry = cameraAt(at + Eigen::Vector3d(0, drift * k, 0), 0.004 * k, 0.02);
    frame.image = test::drawTrunks(flight.camera, frame.cMo, flight.trunks, unsigned(k) + 1);
    flight.frames.push_back(std::move(frame));
  }
  flight.step_sigma << 0.02, 0.02, 0.03, 0.01, 0.01, 0.01;
  flight.absolute_sigma << 1e3, 1e3, 0.02, 0.01, 0.01, 1e3;
  return flight;
}

class Comparison : public testing::Test
{
protected:
  std::vector<Score> run(const TestFlight &flight, std::vector<Contender> contenders)
  {
    writeCao(m_cao, flight.trunks);
    return compare(flight, m_cao, contenders);
  }
  static std::vector<Contender> one(TrackerKind kind, Help help)
  {
    std::vector<Contender> contenders;
    contenders.emplace_back(kind, help, EdgeSettings());
    return contenders;
  }
  const test::TemporaryFolder m_folder;
  const std::string m_cao = m_folder / "wood.cao";
};

TEST(PoseError, IsTheDistanceOfTheCentresAndTheAngleBetweenTheAttitudes)
{
  const PoseError error = poseError(cameraAt({1, 2, 3}, 0.1), cameraAt({1, 2.3, 3.4}, 0.2));
  EXPECT_NEAR(error.position_m, 0.5, 1e-12);
  EXPECT_NEAR(error.rotation_deg, 0.1 * 180 / M_PI, 1e-9);
  Pose broken;
  broken.t.x() = std::nan("");
  EXPECT_GT(poseError(broken, Pose()).position_m, 1e6);
}

TEST(TestFlightOdometry, PredictsTheStepOnTheGivenPoseAndItsOwnHeightAndTilt)
{
  TestFlight flight = drawnFlight(3, 0.05);
  const Pose predicted = flight.predicted(2, flight.frames[1].cMo); // from the truth: only one step of drift
  const Eigen::Vector3d off = predicted.inverse().t - flight.frames[2].cMo.inverse().t;
  EXPECT_NEAR(off.x(), 0, 1e-9);
  EXPECT_NEAR(off.y(), 0.05, 1e-9);
  Pose low = flight.frames[1].cMo.inverse();
  low.t.z() = 0.7; // what the tracker believed of the height does not count
  EXPECT_NEAR(flight.predicted(2, low.inverse()).inverse().t.z(), 1.2, 1e-9);
}

TEST(TestFlightOdometry, TurnsTheStepWithTheYawOfTheGivenPoseAndTheCovarianceGrowsByTheStep)
{
  const TestFlight flight = drawnFlight(3);
  const Pose turned =
      (Pose(expSo3({0, 0, M_PI / 2}), Eigen::Vector3d::Zero()) * flight.frames[1].cMo.inverse()).inverse();
  const Eigen::Vector3d step = flight.frames[2].cMo.inverse().t - flight.frames[1].cMo.inverse().t;
  const Eigen::Vector3d predicted = flight.predicted(2, turned).inverse().t - turned.inverse().t;
  EXPECT_NEAR(predicted.x(), -step.y(), 1e-9);
  EXPECT_NEAR(predicted.y(), step.x(), 1e-9);
  const Pose cMo = flight.frames[1].cMo;
  const Matrix6d before = Matrix6d::Identity() * 1e-4;
  const Matrix6d covariance = flight.predictedCovariance(cMo, cMo, before);
  EXPECT_LT((covariance - covariance.transpose()).norm(), 1e-12);
  EXPECT_NEAR(covariance(0, 0), 1e-4 + 0.02 * 0.02, 1e-7); // x of a level camera is sideways
  EXPECT_NEAR(covariance(1, 1), 1 / (1 / (1e-4 + 0.03 * 0.03) + 1 / (0.02 * 0.02)), 1e-7);
}

TEST_F(Comparison, OursTracksADrawnFlightAndIsScoredRight)
{
  const TestFlight flight = drawnFlight(8, 0.01);
  const Score score = run(flight, one(TrackerKind::trunk, Help::prior))[0];
  EXPECT_EQ(score.frames, 7);
  EXPECT_EQ(score.until_loss, 7);
  EXPECT_EQ(score.silent_failures, 0);
  EXPECT_LT(score.position_rmse_m, 0.05);
  EXPECT_EQ(score.errors.size(), 7u);
  EXPECT_GT(score.median_ms, 0);
}

TEST_F(Comparison, ViSPsTrackersFollowTheSameFlight)
{
  const TestFlight flight = drawnFlight(6);
  for (const TrackerKind kind : {TrackerKind::visp_edge, TrackerKind::visp_generic_edge})
    for (const Help help : {Help::alone, Help::prior}) {
      const Score score = run(flight, one(kind, help))[0];
      EXPECT_EQ(score.until_loss, 5) << score.name; // plain trunks: they must manage, or they are used wrongly
      EXPECT_LT(score.all_position_rmse_m, 0.15) << score.name;
    }
}

TEST_F(Comparison, AWrongPoseWithoutComplaintIsASilentFailure)
{
  TestFlight flight = drawnFlight(8);
  for (int k = 5; k < 8; ++k) { // the "truth" jumps away from what the images show
    Pose w = flight.frames[std::size_t(k)].cMo.inverse();
    w.t.y() += 1;
    flight.frames[std::size_t(k)].cMo = w.inverse();
  }
  const Score score = run(flight, one(TrackerKind::trunk, Help::prior))[0];
  EXPECT_EQ(score.until_loss, 4);
  EXPECT_EQ(score.tracked, 4);
  EXPECT_EQ(score.silent_failures, 3);
  EXPECT_LT(score.position_rmse_m, 0.05); // until the loss
  EXPECT_GT(score.all_position_rmse_m, 0.5);
}

TEST_F(Comparison, AComplaintIsNoSilentFailureAndReinitialisationIsCounted)
{
  TestFlight flight = drawnFlight(8);
  for (int k = 4; k < 6; ++k)
    flight.frames[std::size_t(k)].image = static_cast<unsigned char>(0);
  const std::vector<Score> scores = run(flight, one(TrackerKind::trunk, Help::reinitialised));
  EXPECT_EQ(scores[0].silent_failures, 0);
  EXPECT_EQ(scores[0].reinitialisations, 2);
  EXPECT_EQ(scores[0].until_loss, 3);
  EXPECT_TRUE(scores[0].errors[3].complained);
}

TEST_F(Comparison, TheSweepReturnsTheBestOfWhatItTried)
{
  const TestFlight flight = drawnFlight(4);
  writeCao(m_cao, flight.trunks);
  const SweepResult result = sweep(flight, m_cao, TrackerKind::visp_generic_edge, Help::alone);
  EXPECT_GE(result.tried.size(), 10u);
  const Score *best = nullptr;
  int most = 0;
  for (const auto &[settings, score] : result.tried) {
    most = std::max(most, score.tracked);
    if (settings.text() == result.best.text())
      best = &score;
  }
  ASSERT_NE(best, nullptr);
  EXPECT_EQ(best->tracked, most);
}

TEST_F(Comparison, FaultsAreNoticedAndRecoveredFromWithoutHelp)
{
  const TestFlight flight = drawnFlight(24);
  writeCao(m_cao, flight.trunks);
  FaultRuns runs;
  runs.begins = {5};
  runs.lead = 3;
  runs.tail = 6;
  std::vector<Contender> contenders = one(TrackerKind::trunk, Help::alone);
  const std::vector<FaultRow> rows = faults(flight, m_cao, contenders, runs);
  ASSERT_EQ(rows.size(), allFaults().size());
  for (const FaultRow &row : rows) {
    EXPECT_EQ(row.runs, 1);
    EXPECT_EQ(row.noticed, row.fault_frames) << row.fault.text();
    EXPECT_EQ(row.silent_failures, 0) << row.fault.text();
    EXPECT_EQ(row.recovered, 1) << row.fault.text();
  }
}

TEST(Basin, APairIsTheSameSceneSeenAfterATurn)
{
  const TestFlight flight = drawnFlight(1);
  for (const bool has_clutter : {true, false}) {
    const TurnedPair pair = turnedPair(flight, 0, 12, has_clutter, {});
    EXPECT_LT((pair.before.cMo.inverse().t - pair.after.cMo.inverse().t).norm(), 1e-12);
    EXPECT_NEAR(poseError(pair.after.cMo, pair.before.cMo).rotation_deg, std::atan(12.0 / 200) * 180 / M_PI, 1e-6);
    // the nearest trunk is dark in the middle of where the model has it, in both
    for (const TestFrame *frame : {&pair.before, &pair.after}) {
      const Eigen::Vector2d u = pair.camera.project(frame->cMo * Eigen::Vector3d(4, 1.6, 1.5));
      EXPECT_LT(frame->image[unsigned(std::lround(u.y()))][unsigned(std::lround(u.x()))], 60);
    }
  }
}

TEST_F(Comparison, TheBasinOfOursOnPlainTrunksReachesSixteenPixels)
{
  const TestFlight flight = drawnFlight(1);
  writeCao(m_cao, flight.trunks);
  Contender ours(TrackerKind::trunk, Help::alone, EdgeSettings());
  BasinOptions options;
  options.steps_px = {2, 8, 16};
  const BasinRow row = basin(flight, m_cao, ours, false, options);
  EXPECT_EQ(row.pairs, 2);
  EXPECT_THAT(row.success, testing::Each(1.0));
}

TEST_F(Comparison, TheVideoShowsEveryTrackerWithAPriorInTheColourOfItsAnswer)
{
  const TestFlight flight = drawnFlight(5);
  std::vector<Contender> contenders;
  contenders.emplace_back(TrackerKind::trunk, Help::alone, EdgeSettings());
  contenders.emplace_back(TrackerKind::visp_edge, Help::prior, EdgeSettings());
  contenders.emplace_back(TrackerKind::trunk, Help::prior, EdgeSettings());
  std::vector<Score> scores = run(flight, std::move(contenders));
  for (FrameError &error : scores[1].errors)
    error.wrong = true, error.complained = false;
  const std::string path = m_folder / "comparison.mp4";
  writeComparisonVideo(path, flight, m_cao, scores);
  cv::VideoCapture video(path);
  cv::Mat picture;
  int pictures = 0, green[2] = {0, 0}, red[2] = {0, 0};
  for (; video.read(picture); ++pictures)
    for (int column = 0; column < picture.cols; ++column)
      for (int row = 0; row < picture.rows - 40; ++row) {
        const cv::Vec3b bgr = picture.at<cv::Vec3b>(row, column);
        green[column * 2 / picture.cols] += bgr[1] > bgr[2] + 80;
        red[column * 2 / picture.cols] += bgr[2] > bgr[1] + 80;
      }
  EXPECT_EQ(pictures, 4);
  EXPECT_GT(red[0], 500);
  EXPECT_EQ(green[0], 0);
  EXPECT_GT(green[1], 500);
  EXPECT_EQ(red[1], 0);
}

TEST_F(Comparison, TheReportTellsTheSameInBothForms)
{
  ComparisonReport report;
  const TestFlight flight = drawnFlight(4);
  report.sequence = "a <drawn> flight";
  report.frames = 4;
  report.trunks = 5;
  report.scores = run(flight, one(TrackerKind::trunk, Help::prior));
  BasinRow row;
  row.name = "x", row.steps_px = {1, 2}, row.success = {1, 0.5}, row.silent = {0, 0.5}, row.pairs = 4;
  report.basin = {row};
  FaultRow fault;
  fault.name = "x", fault.runs = 2, fault.recovered = 1;
  report.faults = {fault};
  const auto json = nlohmann::json::parse(toJson(report));
  EXPECT_EQ(json["trackers"][0]["frames_until_loss"], 3);
  EXPECT_EQ(json["trackers"][0]["errors"].size(), 3u);
  EXPECT_EQ(json["basin"][0]["success"][1], 0.5);
  EXPECT_EQ(json["faults"][0]["recovered"], 1);
  EXPECT_THAT(toTable(report), HasSubstr("vpMbTrunkTracker, prior"));
}

class Flights : public testing::Test
{
protected:
  const test::TemporaryFolder m_folder;
  const std::string m_cao = m_folder / "flight.cao";
};

TEST_F(Flights, WithThePriorOursIsNeverLostInTheRenderedForests)
{
  const fs::path rendered = fs::path(BOLE_SHARED_DATA_DIR) / "rendered";
  if (!fs::exists(rendered))
    GTEST_SKIP() << rendered << " is absent";
  for (const char *name : {"park-forward", "winter-weave", "pine-arc"}) {
    const TestFlight flight = readAslFlight((rendered / name).string());
    ASSERT_EQ(flight.frames.size(), 120u);
    writeCao(m_cao, flight.trunksWithin(25));
    EdgeSettings settings;
    settings.far_m = 25;
    std::vector<Contender> ours;
    ours.emplace_back(TrackerKind::trunk, Help::prior, settings);
    ours.emplace_back(TrackerKind::trunk, Help::alone, settings);
    const std::vector<Score> scores = compare(flight, m_cao, ours);
    EXPECT_EQ(scores[0].until_loss, 119) << name;
    EXPECT_EQ(scores[0].silent_failures, 0) << name;
    EXPECT_LT(scores[0].position_rmse_m, 0.1) << name;
    EXPECT_LE(scores[1].silent_failures, 6) << name; // alone it may lose the flight, but says so
  }
}

TEST_F(Flights, TheCubeIsAReferenceForTheCylinderBesideIt)
{
  const fs::path mbt = fs::path(BOLE_VISP_IMAGES_DIR) / "mbt";
  if (!fs::exists(mbt / "cube"))
    GTEST_SKIP() << mbt << " is absent: package visp-images-data";
  const TestFlight flight = readCubeFlight(mbt.string(), 25);
  ASSERT_EQ(flight.frames.size(), 25u);
  EXPECT_FALSE(flight.upright);
  writeCao(m_cao, flight.trunks);
  std::vector<Contender> ours;
  ours.emplace_back(TrackerKind::trunk, Help::prior, EdgeSettings(), BOLE_SOURCE_DIR "/models/cylinder.xml");
  const Score score = compare(flight, m_cao, ours)[0];
  EXPECT_EQ(score.until_loss, 24);
  EXPECT_LT(score.position_rmse_m, 0.03);
}

TEST_F(Flights, AFolderWithoutAFlightIsRefused)
{
  EXPECT_THROW(readAslFlight("/nowhere"), vpException);
  EXPECT_THROW(readCubeFlight("/nowhere"), vpException);
}
} // namespace
