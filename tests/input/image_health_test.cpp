// SPDX-License-Identifier: GPL-2.0-or-later
// Whether an image can be believed, before a trunk is looked for in it.
#include "support/drawn_trunks.h"

#include "input/gyro_agreement.h"
#include "input/image_health.h"

#include <algorithm>
#include <gtest/gtest.h>
#include <random>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using test::cameraAt;

vpImage<unsigned char> wood(const Pose &cMo, unsigned seed)
{
  return test::drawTrunks(PinholeCamera(), cMo, test::smallWood(), seed);
}

TEST(ImageHealth, BelievesImagesOfAFlight)
{
  ImageHealth health;
  health.start(wood(cameraAt({0, 0, 1.2}), 1));
  for (unsigned k = 1; k < 5; ++k)
    EXPECT_EQ(health.check(wood(cameraAt({0.05 * k, 0, 1.2}), k + 1)), ImageFault::none);
}

TEST(ImageHealth, TheFirstImageMayComeTwiceAndThenNotAgain)
{
  const vpImage<unsigned char> I = wood(cameraAt({0, 0, 1.2}), 1);
  ImageHealth health;
  health.start(I);
  EXPECT_EQ(health.check(I), ImageFault::none);
  EXPECT_EQ(health.check(I), ImageFault::frozen);
}

TEST(ImageHealth, NamesWhatTheImageItselfShows)
{
  const auto image = [](unsigned k) { return wood(cameraAt({0.05 * k, 0, 1.2}), k + 1); };
  const auto faultOf = [&](const auto &spoil) {
    ImageHealth health;
    health.start(image(0));
    for (unsigned k = 1; k < 6; ++k)
      EXPECT_EQ(health.check(image(k)), ImageFault::none) << health.reason();
    vpImage<unsigned char> I = image(6);
    spoil(I);
    const ImageFault fault = health.check(I);
    EXPECT_EQ(health.reason().empty(), fault == ImageFault::none);
    EXPECT_EQ(health.check(image(7)), ImageFault::none) << health.reason(); // and the flight goes on
    return fault;
  };
  const auto each = [](vpImage<unsigned char> &I, const auto &change) {
    for (unsigned i = 0; i < I.getSize(); ++i)
      I.bitmap[i] = static_cast<unsigned char>(std::clamp(change(double(I.bitmap[i])), 0.0, 255.0));
  };
  std::mt19937 random(4);
  EXPECT_EQ(faultOf([](auto &) {}), ImageFault::none);
  EXPECT_EQ(faultOf([&](auto &I) { each(I, [](double) { return 0.0; }); }), ImageFault::black);
  EXPECT_EQ(faultOf([&](auto &I) { each(I, [](double g) { return 4 * g + 100; }); }), ImageFault::saturated);
  EXPECT_EQ(faultOf([&](auto &I) { each(I, [](double g) { return 0.7 * g; }); }), ImageFault::none); // exposure
  EXPECT_EQ(faultOf([&](auto &I) {
              std::uniform_real_distribution<double> level(0, 255);
              each(I, [&](double) { return level(random); });
            }),
            ImageFault::noise);
  EXPECT_EQ(faultOf([&](auto &I) {
              for (unsigned v = 0; v < I.getHeight(); ++v)
                std::fill(I[v] + I.getWidth() / 2, I[v] + I.getWidth(), I[v][I.getWidth() / 2]);
            }),
            ImageFault::smeared);
}

TEST(ImageHealth, AFrozenImageIsNamedUnderFreshNoiseAndWithAClockInItsCorner)
{
  const auto image = [](unsigned k) { return wood(cameraAt({0.1 * k, 0, 1.2}), k + 1); };
  ImageHealth health;
  health.start(image(0));
  for (unsigned k = 1; k < 6; ++k)
    EXPECT_EQ(health.check(image(k)), ImageFault::none) << health.reason();
  vpImage<unsigned char> again = image(5);
  again[0][7] = static_cast<unsigned char>(again[0][7] ^ 1);
  EXPECT_EQ(health.check(again), ImageFault::frozen);
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0, 2);
  for (unsigned i = 0; i < again.getSize(); ++i)
    again.bitmap[i] = static_cast<unsigned char>(std::clamp(again.bitmap[i] + noise(random), 0.0, 255.0));
  EXPECT_EQ(health.check(again), ImageFault::frozen);
  EXPECT_EQ(health.check(image(7)), ImageFault::none) << health.reason();
}

/// A flight that turns about two axes; \p late: frames by which the images lag, \p sign: of the horizontal shift.
GyroAgreement::Verdict verdictOf(int late, double sign, int frames = 40)
{
  GyroAgreement agreement;
  GyroAgreement::Verdict last = GyroAgreement::Verdict::agrees;
  const auto rotation = [](int k) { return Eigen::Vector2d(0.03 * std::sin(0.9 * k), 0.02 * std::sin(1.7 * k + 1)); };
  for (int k = 0; k < frames; ++k) {
    const Eigen::Vector2d seen = rotation(k - late);
    last = agreement.add({{sign * seen.x() + 0.004, seen.y() + 0.001 * std::sin(5.0 * k)}, rotation(k), {}, true});
  }
  return last;
}

TEST(GyroAgreement, TellsLateAndMirroredImagesFromGoodOnes)
{
  EXPECT_EQ(verdictOf(0, 1), GyroAgreement::Verdict::agrees);
  EXPECT_EQ(verdictOf(1, 1), GyroAgreement::Verdict::late);
  EXPECT_EQ(verdictOf(-2, 1), GyroAgreement::Verdict::late);
  EXPECT_EQ(verdictOf(0, -1), GyroAgreement::Verdict::mirrored);
}
} // namespace
