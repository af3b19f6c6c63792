// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/differences.h"

#include "geometry/so3.h"
#include "gradient/border_line.h"
#include "gradient/gradient.h"

namespace
{
using namespace bole;

vpImage<unsigned char> painted(unsigned rows, unsigned cols, const std::function<double(int, int)> &value)
{
  vpImage<unsigned char> image(rows, cols);
  for (unsigned v = 0; v < rows; ++v)
    for (unsigned u = 0; u < cols; ++u)
      image[v][u] = static_cast<unsigned char>(std::lround(value(static_cast<int>(u), static_cast<int>(v))));
  return image;
}

vpImage<unsigned char> noise(unsigned rows, unsigned cols)
{
  std::mt19937 random(7);
  std::uniform_int_distribution<int> grey(0, 255);
  return painted(rows, cols, [&](int, int) { return grey(random); });
}

/// The convolution by its definition, pixel by pixel: Gaussian down, derivative of a Gaussian across.
double bruteForce(const vpImage<unsigned char> &I, int u, int v, double sigma)
{
  const int radius = static_cast<int>(std::ceil(3 * sigma));
  double sum = 0, weight = 0, ramp = 0;
  for (int i = -radius; i <= radius; ++i) {
    weight += std::exp(-0.5 * i * i / (sigma * sigma));
    ramp += i * i * std::exp(-0.5 * i * i / (sigma * sigma));
  }
  for (int dv = -radius; dv <= radius; ++dv)
    for (int du = -radius; du <= radius; ++du)
      sum += du * std::exp(-0.5 * (du * du + dv * dv) / (sigma * sigma)) / (weight * ramp) *
             I[std::clamp(v + dv, 0, static_cast<int>(I.getRows()) - 1)]
              [std::clamp(u + du, 0, static_cast<int>(I.getCols()) - 1)];
  return sum / 255;
}

TEST(Gradient, IsTheConvolutionByItsDefinitionUpToTheEdges)
{
  const auto I = noise(31, 43);
  for (const double sigma : {0.7, 1.0, 2.2}) {
    const Gradient gradient = computeGradient(I, {sigma});
    for (int v = 0; v < 31; ++v)
      for (int u = 0; u < 43; ++u)
        ASSERT_NEAR(gradient.signed_x[v][u], bruteForce(I, u, v, sigma), 2e-6) << u << "," << v << " sigma " << sigma;
  }
}

const PinholeCamera kCamera;
const Pose kForward((Eigen::Matrix3d() << 0, 0, 1, -1, 0, 0, 0, -1, 0).finished(), {0, 0, 1.2});

RelativeTrunk seen(double roll = 0, double x = 4, double y = 0.4)
{
  const Trunk trunk{{x, y}, std::log(0.2)};
  return relativeTrunk(Pose(kForward.R * expSo3({0, 0, roll}), kForward.t), Pose(), trunk);
}

vpImage<float> field(const std::function<double(double, double)> &value)
{
  vpImage<float> g(240, 320);
  for (int v = 0; v < 240; ++v)
    for (int u = 0; u < 320; ++u)
      g[v][u] = static_cast<float>(value(u, v));
  return g;
}

/// Curved across and down, so that both derivatives differ from row to row.
double wave(double u, double v) { return std::sin(0.13 * u + 0.02 * v) + 0.3 * std::cos(0.05 * v); }

TEST(BorderLine, RunsThroughTheProjectedDirectionsOfItsBorder)
{
  for (const double roll : {-0.4, 0.0, 0.25})
    for (const Border border : {Border::left, Border::right}) {
      const ElevationRange range;
      const RelativeTrunk trunk = seen(roll);
      const BorderLine line = borderLine(kCamera, trunk, border, range);
      ASSERT_GT(line.rows(), 80);
      for (const double tangent : {range.low, 0.1, range.high}) {
        const Eigen::Vector2d u = kCamera.project(trunk.borderDirection(border, tangent));
        EXPECT_NEAR(line.xAt(u.y()), u.x(), 1e-9);
      }
      const double top = kCamera.project(trunk.borderDirection(border, range.high)).y();
      const double foot = kCamera.project(trunk.borderDirection(border, range.low)).y();
      EXPECT_EQ(line.row_begin, std::ceil(std::max(top, 1.0)));
      EXPECT_EQ(line.row_end, std::floor(std::min(foot, 238.0)) + 1);
    }
}

TEST(BorderLine, StaysInsideTheImageLessItsMargin)
{
  // rolled so far that the line leaves through the side
  const BorderLine line = borderLine(kCamera, seen(0.6, 4, 2.4), Border::left, {-2, 2});
  ASSERT_GT(line.rows(), 0);
  for (int v = line.row_begin; v < line.row_end; ++v) {
    EXPECT_GE(line.xAt(v), 4 - 1e-9);
    EXPECT_LE(line.xAt(v), 315 + 1e-9);
  }
  EXPECT_GE(line.row_begin, 1);
  EXPECT_LE(line.row_end, 239);
}

TEST(BorderLine, HasNoRowsWhereThereIsNothingToSee)
{
  EXPECT_EQ(borderLine(kCamera, seen(0, -4, 0.4), Border::left, {}).rows(), 0); // behind the camera
  EXPECT_EQ(borderLine(kCamera, seen(0, 2, 4), Border::left, {}).rows(), 0);    // beside the image
  EXPECT_EQ(borderLine(kCamera, seen(1.3), Border::left, {}).rows(), 0);        // nearly level
}

TEST(BorderLine, HasRowsInABankOf57Degrees)
{
  const BorderLine line = borderLine(kCamera, seen(1.0), Border::left, {});
  EXPECT_GT(line.rows(), 30);
  EXPECT_NEAR(std::abs(line.slope), std::tan(1.0), 0.2);
}

TEST(BorderLine, MovesItsEndsByWhatItIsTold)
{
  const BorderLine line = borderLine(kCamera, seen(0.2), Border::left, {}), moved = line.moved(1.5, -0.75);
  EXPECT_NEAR(moved.xAt(line.row_begin), line.xAt(line.row_begin) + 1.5, 1e-9);
  EXPECT_NEAR(moved.xAt(line.row_end - 1), line.xAt(line.row_end - 1) - 0.75, 1e-9);
}

TEST(BorderLine, JacobianAgreesWithCentralDifferences)
{
  for (const Border border : {Border::left, Border::right}) {
    const RelativeTrunk trunk = seen(0.2).plus({0, 0.15, 0, 0.3});
    const BorderLine line = borderLine(kCamera, trunk, border, {});
    const auto J = borderJacobian(kCamera, trunk, border, line);
    const auto ends = [&](const Vector4d &xi) {
      const BorderLine moved = borderLine(kCamera, trunk.plus(xi), border, {});
      return Eigen::Vector2d(moved.xAt(line.row_begin), moved.xAt(line.row_end - 1));
    };
    test::expectDerivative(ends, J, 2e-3, 1e-4 * J.norm());
  }
}

TEST(MeanGradient, OfASmoothFieldIsTheMeanOfItsValuesOnTheLine)
{
  const auto g = field(wave);
  const BorderLine line = borderLine(kCamera, seen(0.2), Border::right, {});
  double mean = 0;
  for (int v = line.row_begin; v < line.row_end; ++v)
    mean += wave(line.xAt(v), v) / line.rows();
  EXPECT_NEAR(meanAlong(g, line).mean, mean, 1e-5);
  EXPECT_NEAR(meanAlongOnly(g, line), mean, 3e-3); // linear between columns
}

TEST(MeanGradient, DerivativesAgreeWithCentralDifferences)
{
  const auto g = field(wave);
  const BorderLine line = borderLine(kCamera, seen(0.2), Border::right, {});
  const MeanGradient at = meanAlong(g, line);
  const double h = 1e-3;
  EXPECT_NEAR(at.by_top, (meanAlong(g, line.moved(h, 0)).mean - meanAlong(g, line.moved(-h, 0)).mean) / (2 * h), 1e-6);
  EXPECT_NEAR(at.by_bottom, (meanAlong(g, line.moved(0, h)).mean - meanAlong(g, line.moved(0, -h)).mean) / (2 * h),
              1e-6);
  EXPECT_GT(std::abs(at.by_top), 1e-3);
}

/// Of an upright line the interpolation is the same in every row: nothing averages its faults away.
TEST(MeanGradient, OfAnUprightLineIsASmoothFunctionOfItsPlace)
{
  const auto g = field([](double u, double) { return std::exp(-0.5 * std::pow((u - 150.3) / 1.4, 2)); });
  BorderLine line{140, 0, 60, 160};
  double best = 0, best_x = 0;
  for (double x = 148; x < 153; x += 0.01) {
    line.x_top = x;
    const double mean = meanAlong(g, line).mean;
    if (mean > best) {
      best = mean;
      best_x = x;
    }
  }
  EXPECT_NEAR(best_x, 150.3, 0.1); // linear interpolation gives 150
}

TEST(MeanGradient, SamplesOutsideTheImageCountAsZero)
{
  const auto g = field([](double, double) { return 1.0; });
  const BorderLine line{-20, 40.0 / 99, 10, 110}; // the first half is left of the image
  EXPECT_NEAR(meanAlong(g, line).mean, 0.48, 0.02);
  EXPECT_NEAR(meanAlongOnly(g, line), 0.5, 0.02);
  EXPECT_EQ(meanAlong(g, BorderLine()).mean, 0);
}

TEST(Evenness, TellsABorderAlongTheWholeLineFromAPieceOfIt)
{
  BorderLine line;
  line.x_top = 20;
  line.slope = 0.05;
  line.row_begin = 10;
  line.row_end = 90;
  const auto borderOver = [&](int rows, float value) {
    vpImage<float> g(100, 60, 0.f);
    for (int v = line.row_begin; v < line.row_begin + rows; ++v)
      for (int shift = -2; shift <= 2; ++shift)
        g[v][static_cast<int>(line.xAt(v)) + shift] = value;
    return g;
  };
  EXPECT_NEAR(evennessAlong(borderOver(80, 0.1f), line, 1), 1, 1e-6);
  EXPECT_NEAR(evennessAlong(borderOver(40, 0.1f), line, 1), 0.5, 1e-6); // half of the line: 4^2 / (8 * 4)
  EXPECT_NEAR(evennessAlong(borderOver(10, 0.1f), line, 1), 1.0 / 8, 1e-6);
  EXPECT_EQ(evennessAlong(borderOver(80, -0.1f), line, 1), 0); // the other polarity
  EXPECT_NEAR(evennessAlong(borderOver(80, -0.1f), line, -1), 1, 1e-6);
  EXPECT_EQ(evennessAlong(borderOver(0, 0.f), line, 1), 0);
}
} // namespace
