// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_bark.h"
#include "support/test.h"

#include "pipeline/texture_tracker.h"

namespace
{
using namespace bole;
using test::kCamera;

/// A camera that flies to the left past a trunk, 5 cm from image to image, and is told so or not.
class FollowedBark : public testing::Test
{
protected:
  FollowedBark()
  {
    MapTrunk known;
    known.trunk = m_trunk;
    known.status = TrunkStatus::confirmed;
    m_map = TrunkMap(MapOptions(), {known});
  }
  Pose real(int frame) const { return test::lookingAlongX(0, 0.05 * frame, 1.3); }
  RelativeTrunk realTrunk(int frame) const { return relativeTrunk(real(frame), Pose(), m_trunk); }

  /// The prediction from the image before, whose pose is right, with a step that is wrong by \p wrong_m.
  PredictedTrunk predict(int frame, double wrong_m, const test::Bark &bark = {})
  {
    Viewpoint view;
    view.camera = kCamera;
    view.wMc = real(frame);
    view.wMc.t.y() += wrong_m;
    PredictedTrunk one;
    one.tracking.relative = relativeTrunk(view.wMc, Pose(), m_trunk);
    one.tracking.range = {-0.3, 0.4};
    one.tracking.covariance = 1e-4 * Matrix4d::Identity(); // two pixels
    std::vector<PredictedTrunk> predicted{one};
    m_tracker.predict(test::drawBark(real(frame), m_trunk, bark), static_cast<std::size_t>(frame) + 1, real(frame - 1),
                      view, m_map, predicted);
    return predicted.front();
  }
  void read(const PredictedTrunk &predicted, const RelativeTrunk &borders, TrackingStatus status)
  {
    TrackedTrunk one;
    one.predicted = predicted;
    one.result.status = status;
    one.result.optimum = borders;
    m_tracker.correct({one}, kCamera);
  }
  double off_px(const PredictedTrunk &predicted, int frame) const
  {
    return kCamera.fx * predicted.tracking.relative.minus(realTrunk(frame))(2);
  }
  double sigma_px(const PredictedTrunk &predicted) const
  {
    return kCamera.fx * std::sqrt(predicted.tracking.covariance(2, 2));
  }

  Trunk m_trunk{{2.0, 0.2}, std::log(0.15)};
  TrunkMap m_map{MapOptions(), {}};
  TextureTracker m_tracker;
};

TEST_F(FollowedBark, MendsThePredictionOfAWrongStep)
{
  for (int frame = 0; frame < 12; ++frame) {
    const double wrong_m = frame % 2 ? 0.03 : -0.02; // 3 px and 2
    const PredictedTrunk predicted = predict(frame, wrong_m);
    if (frame == 0) {
      EXPECT_GT(std::abs(off_px(predicted, frame)), 1.5);
      EXPECT_NEAR(sigma_px(predicted), 2, 0.01);
    }
    if (frame > 3) {
      EXPECT_LT(std::abs(off_px(predicted, frame)), 0.6) << frame;
      EXPECT_LT(sigma_px(predicted), 0.6);
    }
    read(predicted, realTrunk(frame), TrackingStatus::tracked);
  }
}

TEST_F(FollowedBark, IsNotDrawnAlongByABorderThatSlips)
{
  constexpr double kSlip_px = 2;
  double off = 0;
  for (int frame = 0; frame < 16; ++frame) {
    const PredictedTrunk predicted = predict(frame, 0);
    off = off_px(predicted, frame);
    const double slipped_px = frame < 10 ? 0 : kSlip_px * (frame - 9);
    read(predicted, realTrunk(frame).plus(Vector4d(0, 0, slipped_px / kCamera.fx, 0)), TrackingStatus::tracked);
  }
  EXPECT_LT(std::abs(off), 4); // of 12 px: farther from the borders than their gate
}

TEST_F(FollowedBark, CarriesATrunkThatIsNotReadUntilItIsNoLongerSure)
{
  double before = 0;
  int carried = 0;
  for (int frame = 0; frame < 14; ++frame) {
    const PredictedTrunk predicted = predict(frame, 0.03);
    if (frame > 6) {
      EXPECT_LT(std::abs(off_px(predicted, frame)), 1) << frame;
      EXPECT_GT(sigma_px(predicted), before);
      ++carried;
    }
    before = sigma_px(predicted);
    read(predicted, realTrunk(frame), frame < 6 ? TrackingStatus::tracked : TrackingStatus::sign_changed);
  }
  EXPECT_EQ(carried, 7);
}

TEST_F(FollowedBark, LeavesACandidateToItsBorders)
{
  MapTrunk known = m_map.trunks().front();
  known.status = TrunkStatus::candidate;
  m_map = TrunkMap(MapOptions(), {known});
  for (int frame = 0; frame < 4; ++frame) {
    const PredictedTrunk predicted = predict(frame, 0.02);
    EXPECT_LT(off_px(predicted, frame), -1.5);
    read(predicted, realTrunk(frame), TrackingStatus::tracked);
  }
}

TEST_F(FollowedBark, LeavesThePredictionWhereTheBarkShowsNothing)
{
  const test::Bark plain{0, false};
  for (int frame = 0; frame < 4; ++frame) {
    const PredictedTrunk predicted = predict(frame, 0.02, plain);
    EXPECT_LT(off_px(predicted, frame), -1.5);
    read(predicted, realTrunk(frame), TrackingStatus::tracked);
  }
}
} // namespace
