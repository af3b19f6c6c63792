// SPDX-License-Identifier: GPL-2.0-or-later
#include "rendered_walls.h"

#include "geometry/so3.h"
#include "motion/lucas_kanade.h"
#include "motion/window_loops.h"

#include <gtest/gtest.h>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace
{
using namespace bole;
using namespace bole::test;

const PinholeCamera kCamera;

cv::Mat pictureFrom(const Pose &wMc)
{
  const vpImage<unsigned char> image = drawWalls(kCamera, wMc);
  return cv::Mat(kCamera.height, kCamera.width, CV_8U, image.bitmap).clone();
}

TEST(LucasKanade, FindsWhatOpenCvFinds)
{
  const cv::Mat first = pictureFrom({}), second = pictureFrom({expSo3({0.004, 0.01, 0.003}), {0.06, 0.01, 0.05}});
  std::vector<cv::Point2f> from, theirs;
  cv::goodFeaturesToTrack(first, from, 150, 0.01, 8);
  ASSERT_GT(from.size(), 80u);
  theirs = from;
  std::vector<unsigned char> found;
  std::vector<float> error;
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, 10, 0.01);
  cv::calcOpticalFlowPyrLK(first, second, from, theirs, found, error, {kWindow_px, kWindow_px}, 3, stop,
                           cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
  GreyPyramid a, b;
  buildPyramid(first, 3, a);
  buildPyramid(second, 3, b);
  int same = 0, both = 0, one = 0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    if (roundness(a.front(), from[i]) < 1.2 * kLeastRoundness)
      continue; // OpenCV follows what slides along a line
    cv::Point2f ours = from[i];
    const bool is_found = followWindow(a, b, from[i], ours, 3);
    one += is_found != (found[i] != 0);
    both += is_found && found[i];
    same += is_found && found[i] && cv::norm(ours - theirs[i]) < 1e-3;
  }
  EXPECT_GT(both, 70);
  EXPECT_GE(same, both - 1);
  EXPECT_LE(one, 1);
}

TEST(LucasKanade, ALineHasNoRoundnessAndASpotAllOfIt)
{
  cv::Mat image(60, 60, CV_8U, cv::Scalar(40));
  cv::line(image, {0, 10}, {59, 22}, cv::Scalar(200), 2, cv::LINE_AA);
  cv::circle(image, {30, 45}, 3, cv::Scalar(200), cv::FILLED, cv::LINE_AA);
  cv::GaussianBlur(image, image, {}, 1);
  GreyPyramid pyramid;
  buildPyramid(image, 0, pyramid);
  EXPECT_LT(roundness(pyramid[0], {30, 16}), 0.02);
  EXPECT_GT(roundness(pyramid[0], {30, 45}), 0.8);
  EXPECT_EQ(roundness(pyramid[0], {50, 50}), 0);
}

TEST(LucasKanade, HasNoAnswerWhereThereIsNoTextureOrNoImage)
{
  const cv::Mat blank(kCamera.height, kCamera.width, CV_8U, cv::Scalar(90));
  GreyPyramid a;
  buildPyramid(blank, 3, a);
  for (const cv::Point2f from :
       {cv::Point2f(100, 80), cv::Point2f(-50, 80), cv::Point2f(1e9f, 3), cv::Point2f(NAN, 3)}) {
    cv::Point2f to = from;
    EXPECT_FALSE(followWindow(a, a, from, to, 3));
  }
}

TEST(Corners, HaveTheResponseThatOpenCvGivesThem)
{
  const cv::Mat image = pictureFrom({});
  cv::Mat theirs, ours(image.size(), CV_32F);
  cv::cornerMinEigenVal(image, theirs, 5, 3);
  CornerScratch scratch;
  const float most = cornerResponse(image.ptr(), image.cols, image.rows, scratch, ours.ptr<float>());
  const cv::Rect inner(kCornerMargin, kCornerMargin, image.cols - 2 * kCornerMargin, image.rows - 2 * kCornerMargin);
  double strongest = 0;
  cv::minMaxLoc(theirs(inner), nullptr, &strongest);
  EXPECT_NEAR(most, strongest, 1e-4 * strongest);
  EXPECT_LT(cv::norm(ours(inner), theirs(inner), cv::NORM_INF), 1e-4 * strongest);
}
} // namespace
