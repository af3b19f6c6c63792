// SPDX-License-Identifier: GPL-2.0-or-later
// Whether an image can be believed, before a trunk is looked for in it.
#include "support/drawn_trunks.h"
#include "support/test.h"

#include "input/frame_builder.h"
#include "input/gyro_agreement.h"
#include "input/image_health.h"
#include <opencv2/imgproc.hpp>

namespace
{
using namespace bole;
using test::cameraAt;

vpImage<unsigned char> wood(const Pose &cMo, unsigned seed)
{
  return test::drawTrunks(PinholeCamera(), cMo, test::smallWood(), seed);
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

TEST(ImageHealth, NamesWhatStandsOtherwiseUntilOneFollowsTheLastGoodImageAgain)
{
  using Spoil = std::function<cv::Mat(const cv::Mat &)>;
  const auto flipped = [](int code) {
    return [code](const cv::Mat &I) {
      cv::Mat out;
      cv::flip(I, out, code);
      return out;
    };
  };
  const std::pair<ImageFault, Spoil> cases[] = {
      {ImageFault::mirrored, flipped(1)},
      {ImageFault::upside_down, flipped(-1)},
      {ImageFault::negative, [](const cv::Mat &I) { return cv::Mat(255 - I); }},
      {ImageFault::cropped,
       [](const cv::Mat &I) {
         cv::Mat out;
         cv::resize(I({I.cols / 6, I.rows / 6, I.cols * 2 / 3, I.rows * 2 / 3}), out, I.size());
         return out;
       }},
      {ImageFault::torn,
       [](const cv::Mat &I) {
         cv::Mat out = I.clone(), other;
         cv::flip(I, other, -1);
         other.rowRange(I.rows / 2, I.rows).copyTo(out.rowRange(I.rows / 2, I.rows));
         return out;
       }},
  };
  const auto image = [](unsigned k) { // of the demonstration flight: drawn woods are too much alike
    const ImageFile file = readImageFile(
        fmt::format("{}/data/park-forward/mav0/cam0/data/{:013}.png", BOLE_SOURCE_DIR, 100'000'000LL * (45 + k)));
    EXPECT_EQ(file.status, FrameStatus::ok) << file.message;
    return file.image;
  };
  for (const auto &[fault, spoil] : cases) {
    ImageHealth health;
    health.start(image(0));
    for (unsigned k = 1; k < 10; ++k) {
      vpImage<unsigned char> I = image(k);
      const bool is_spoilt = k >= 4 && k < 8;
      if (is_spoilt) {
        const cv::Mat now(static_cast<int>(I.getHeight()), static_cast<int>(I.getWidth()), CV_8UC1, I.bitmap);
        spoil(now.clone()).copyTo(now);
      }
      EXPECT_EQ(health.check(I), is_spoilt ? fault : ImageFault::none)
          << toString(fault) << " " << k << health.reason();
    }
  }
}

/// A flight that turns about two axes.
Eigen::Vector2d turnAt(int k) { return {0.03 * std::sin(0.9 * k), 0.02 * std::sin(1.7 * k + 1)}; }

/// What the images show of it, with the slow shift of a translation and a little noise.
Eigen::Vector2d shownAt(int k) { return turnAt(k) + Eigen::Vector2d(0.004, 0.002 * std::sin(5.0 * k)); }

TEST(GyroAgreement, TellsInASecondThatImagesBecameLate)
{
  for (const int late : {-2, 1, 3}) {
    GyroAgreement agreement;
    int named_after = -1;
    for (int k = 0; k < 60; ++k) {
      const bool is_late = k >= 30 && k < 45;
      const auto verdict = agreement.add({shownAt(is_late ? k - late : k), turnAt(k), {}, false, true});
      EXPECT_TRUE(k >= 30 || verdict == GyroAgreement::Verdict::agrees);
      if (verdict == GyroAgreement::Verdict::late && named_after < 0) {
        named_after = k - 30;
        EXPECT_EQ(agreement.lag(), late);
      }
      EXPECT_TRUE(k < 55 || verdict == GyroAgreement::Verdict::agrees) << k; // and that they are not any more
    }
    EXPECT_GE(named_after, 0) << late;
    EXPECT_LE(named_after, 10) << late;
  }
}

TEST(GyroAgreement, TellsTheOneImageThatDoesNotFollow)
{
  GyroAgreement agreement;
  for (int k = 0; k < 40; ++k) {
    const Eigen::Vector2d off(k == 30 ? 0.03 : 0, 0);
    EXPECT_EQ(agreement.add({shownAt(k) + off, turnAt(k), {}, true, true}),
              k == 30 ? GyroAgreement::Verdict::jumped : GyroAgreement::Verdict::agrees)
        << k;
  }
}

TEST(GyroAgreement, SaysNothingOfACameraThatHardlyTurns)
{
  GyroAgreement agreement;
  for (int k = 0; k < 60; ++k) // the images wander by parallax alone
    EXPECT_EQ(
        agreement.add({0.02 * Eigen::Vector2d(std::sin(0.2 * k), std::cos(0.31 * k)), 0.05 * turnAt(k), {}, true}),
        GyroAgreement::Verdict::agrees)
        << k;
}

TEST(GyroAgreement, TellsMirroredImages)
{
  GyroAgreement agreement;
  GyroAgreement::Verdict last = GyroAgreement::Verdict::agrees;
  for (int k = 0; k < 40; ++k)
    last = agreement.add({{-shownAt(k).x(), shownAt(k).y()}, turnAt(k), {}, true});
  EXPECT_EQ(last, GyroAgreement::Verdict::mirrored);
}
} // namespace
