// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "geometry/so3.h"
#include "gradient/gradient.h"
#include "tracking/border_profile.h"

namespace
{
using namespace bole;
using testing::SizeIs;

/// Smooth vertical steps at the columns \p x, dark and bright in turn, each over some two pixels.
vpImage<unsigned char> steps(const std::vector<double> &x, double slope = 0)
{
  vpImage<unsigned char> image(60, 80);
  for (int v = 0; v < 60; ++v)
    for (int u = 0; u < 80; ++u) {
      double grey = 60;
      for (std::size_t k = 0; k < x.size(); ++k)
        grey += (k % 2 == 0 ? 120 : -120) * 0.5 * (1 + std::erf((u - x[k] - slope * v) / std::sqrt(2.0)));
      image[v][u] = static_cast<unsigned char>(std::lround(grey));
    }
  return image;
}

BorderLine lineAt(double x_top, double slope = 0)
{
  BorderLine line;
  line.x_top = x_top, line.slope = slope, line.row_begin = 5, line.row_end = 55;
  return line;
}

TEST(BorderProfile, MeanAcrossIsTheMeanAlongTheMovedLine)
{
  for (const double x : {38.3, 3.2, 77.6}) {  // the last two scan beyond the image, where samples count as zero
    const double other_end = x > 60 ? 1 : 30; // where a row that is read too far goes on
    const vpImage<float> g = computeGradient(steps({other_end, 44}, 0.1)).signed_x;
    const BorderLine line = lineAt(x, 0.02);
    const std::vector<float> profile = meanAcross(g, line, 6.4);
    ASSERT_THAT(profile, SizeIs(27));
    for (int k = -13; k <= 13; ++k) {
      const double offset = 0.5 * k;
      EXPECT_NEAR(profile[std::size_t(k + 13)], meanAlongOnly(g, line.moved(offset, offset)), 1e-6) << x << ' ' << k;
    }
  }
}

TEST(BorderProfile, GreyLevelsAndTheGradientImageGiveTheSamePeak)
{
  const vpImage<unsigned char> image = steps({30, 44}, 0.1);
  const Gradient gradient = computeGradient(image);
  const BorderLine line = lineAt(41, 0.1);
  ImageBorder border;
  border.line = line;
  std::vector<float> sum(31, 0.f), contrast;
  for (int row = line.row_begin; row < line.row_end; ++row)
    addAcross(image, border, row, 15, sum.data());
  for (float &v : sum)
    v /= 255 * float(line.rows());
  differentiate(sum, contrast);
  const auto grey = peaksOf(contrast, 1, 0.05);
  const auto scanned = scanBorder(gradient.signed_x, line, 6, 0.05);
  ASSERT_THAT(grey, SizeIs(2));
  ASSERT_THAT(scanned, SizeIs(1));
  EXPECT_NEAR(grey[1].offset_px, scanned[0].offset_px, 0.1);
  EXPECT_NEAR(grey[1].contrast, scanned[0].contrast, 0.1 * std::abs(scanned[0].contrast));
}

TEST(BorderProfile, AFlatBorderIsReadByColumns)
{
  const vpImage<unsigned char> image = steps({30, 44}, 0.1);
  vpImage<unsigned char> turned(80, 60);
  for (unsigned v = 0; v < 60; ++v)
    for (unsigned u = 0; u < 80; ++u)
      turned[u][v] = image[v][u];
  ImageBorder steep, flat;
  steep.line = flat.line = lineAt(36, 0.1);
  flat.is_flat = true;
  for (const int half : {5, 50}) { // within the image and beyond it
    std::vector<float> a(std::size_t(2 * half + 1), 0.f), b = a;
    addAcross(image, steep, 20, half, a.data());
    addAcross(turned, flat, 20, half, b.data());
    EXPECT_EQ(a, b);
  }
  EXPECT_EQ(flat.at(20, 1.5), Eigen::Vector2d(20, steep.at(20).x() + 1.5));
}

TEST(BorderProfile, BordersOfAnyDirectionAreLines)
{
  const PinholeCamera camera;
  for (int k = 0; k < 12; ++k) { // a segment 4 m ahead, turned about the optical axis
    const Eigen::Matrix3d R = expSo3({0, 0, (k + 0.2) * M_PI / 12});
    const Eigen::Vector3d foot = R * Eigen::Vector3d(0.3, 1, 4), top = R * Eigen::Vector3d(0.3, -1, 4);
    const ImageBorder border = imageBorder(camera, foot.cross(top).normalized(), foot, top, 4);
    EXPECT_EQ(border.is_flat, k >= 3 && k <= 8) << k;
    EXPECT_NEAR(border.length(), 100, 2) << k;
    for (const int row : {border.line.row_begin, border.line.row_end - 1})
      EXPECT_NEAR(foot.cross(top).normalized().dot(camera.ray(border.at(row))), 0, 1e-9) << k;
  }
}

TEST(BorderScan, FindsTheStepsAroundTheLineStrongestFirstWithTheirSigns)
{
  vpImage<unsigned char> image = steps({35.3, 44.8});
  for (int v = 0; v < 60; ++v)
    for (int u = 40; u < 80; ++u)
      image[v][u] = static_cast<unsigned char>(60 + (image[v][u] - 60) / 2 + 60); // the second step is half as strong
  const auto peaks = scanBorder(computeGradient(image).signed_x, lineAt(40), 8, 0.02);
  ASSERT_GE(peaks.size(), 2u);
  EXPECT_NEAR(peaks[0].offset_px, -4.7, 0.25);
  EXPECT_GT(peaks[0].contrast, 0);
  EXPECT_NEAR(peaks[1].offset_px, 4.8, 0.25);
  EXPECT_LT(peaks[1].contrast, 0);
  EXPECT_NEAR(peaks[1].contrast, -0.5 * peaks[0].contrast, 0.05 * peaks[0].contrast);
}

TEST(BorderScan, SeesNothingBeyondItsHalfWidthOrBelowTheLeastContrast)
{
  const vpImage<float> g = computeGradient(steps({35, 44})).signed_x;
  EXPECT_THAT(scanBorder(g, lineAt(40), 3, 0.02), SizeIs(0));
  EXPECT_THAT(scanBorder(g, lineAt(40), 8, 0.9), SizeIs(0));
  EXPECT_THAT(scanBorder(g, lineAt(40), 8, 0.02, 1), SizeIs(1));
}

TEST(ContrastCost, FallsWithTheContrastFrom4To0WhereNothingWasSeenBefore)
{
  EXPECT_EQ(contrastCost(0, {}), 4);
  EXPECT_NEAR(contrastCost(0.015, {}), 3, 1e-12);
  EXPECT_NEAR(contrastCost(-0.03, {}), 2, 1e-12); // either sign
  EXPECT_EQ(contrastCost(0.06, {}), 0);
  EXPECT_EQ(contrastCost(0.5, {}), 0);
}

TEST(PairPeaks, PrefersWhatThePredictionExpects)
{
  PairPrior prior;
  prior.covariance_px << 4, 3.9, 3.9, 4; // both borders move together
  const std::vector<BorderPeak> left = {{0, 0.1}, {3, 0.1}}, right = {{3.2, 0.1}, {-3, 0.1}};
  const auto pairs = pairPeaks(left, right, prior, 4);
  ASSERT_THAT(pairs, SizeIs(4));
  EXPECT_EQ(pairs[0].left.offset_px, 3);
  EXPECT_EQ(pairs[0].right.offset_px, 3.2);
  EXPECT_TRUE(std::is_sorted(pairs.begin(), pairs.end(), [](const auto &p, const auto &q) { return p.cost < q.cost; }));
}

TEST(PairPeaks, PrefersTheContrastOfTheFramesBeforeAndThenTheStrongest)
{
  PairPrior prior;
  prior.covariance_px *= 100;
  const std::vector<BorderPeak> left = {{0, -0.02}, {0, 0.1}}, right = {{0, 0.1}};
  EXPECT_EQ(pairPeaks(left, right, prior)[0].left.contrast, 0.1);
  prior.left_contrast = -0.025;
  EXPECT_EQ(pairPeaks(left, right, prior)[0].left.contrast, -0.02);
}

/// The sun comes round the trunk: its left border turns from dark to bright, and the line of its shade stands on the
/// bark with the contrast that the border had.
TEST(PairPeaks, LightAndShadeOnTheBarkAreNotFollowedAwayFromThePrediction)
{
  PairPrior prior;
  prior.covariance_px << 7, 6.5, 6.5, 7;
  prior.left_contrast = -0.1;
  prior.right_contrast = 0.1;
  const std::vector<BorderPeak> left = {{0.2, 0.1}, {9, -0.1}}, right = {{-0.1, 0.1}, {9, 0.02}};
  const PeakPair best = pairPeaks(left, right, prior)[0];
  EXPECT_EQ(best.left.offset_px, 0.2);
  EXPECT_EQ(best.right.offset_px, -0.1);
}

TEST(PairPeaks, ABorderWithoutPeaksLeavesTheOtherAlone)
{
  const std::vector<BorderPeak> found = {{1, 0.05}, {-0.5, 0.05}};
  const auto by_left = pairPeaks(found, {}, {}), by_right = pairPeaks({}, found, {});
  ASSERT_THAT(by_left, SizeIs(2));
  ASSERT_THAT(by_right, SizeIs(2));
  EXPECT_EQ(by_left[0].left.offset_px, -0.5);
  EXPECT_EQ(by_left[0].right.contrast, 0);
  EXPECT_EQ(by_right[0].right.offset_px, -0.5);
  EXPECT_TRUE(pairPeaks({}, {}, {}).empty());
}
} // namespace
