// SPDX-License-Identifier: GPL-2.0-or-later
#include "gradient/gradient.h"

#include <gmock/gmock.h>

#include <cmath>
#include <functional>
#include <random>
#include <visp3/core/vpException.h>

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

TEST(Gradient, OfARampIsItsSlopeInFullScaleAPixel)
{
  const auto I = painted(40, 80, [](int u, int) { return 20 + 2.0 * u; });
  const Gradient gradient = computeGradient(I);
  EXPECT_NEAR(gradient.signed_x[20][40], 2.0 / 255, 1e-6);
}

TEST(Gradient, KnowsNothingOfWhatChangesDownwardsOnly)
{
  const auto I = painted(40, 80, [](int, int v) { return 5.0 * v; });
  const Gradient gradient = computeGradient(I);
  for (int v = 0; v < 40; ++v)
    for (int u = 0; u < 80; ++u)
      EXPECT_NEAR(gradient.signed_x[v][u], 0, 1e-6);
}

TEST(Gradient, PeaksAtAStepWithTheSignOfItsBrightness)
{
  const auto I = painted(30, 60, [](int u, int) { return u < 30 ? 200 : 40; });
  const Gradient gradient = computeGradient(I);
  for (int u = 0; u < 60; ++u)
    EXPECT_GE(gradient.signed_x[15][u] + 1e-6f, std::min(gradient.signed_x[15][29], gradient.signed_x[15][30]));
  EXPECT_NEAR(gradient.signed_x[15][29], gradient.signed_x[15][30], 1e-6); // the step is between the two
  EXPECT_LT(gradient.signed_x[15][29], -0.1);
}
} // namespace
