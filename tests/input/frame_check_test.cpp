// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "input/camera_plausibility.h"
#include "input/frame_builder.h"
#include "input/frame_check.h"

using namespace bole;
using testing::HasSubstr;

namespace
{
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN(), kInfinity = std::numeric_limits<double>::infinity();
constexpr std::int64_t kStamp_ns = 5'900'000'000;

Frame soundFrame()
{
  Frame frame;
  frame.stamp_ns = kStamp_ns;
  frame.wMb_odometry = Pose(Eigen::Matrix3d::Identity(), {1, 2, 3});
  for (int i = 0; i < 4; ++i)
    frame.gyro.push_back({kStamp_ns - 10'000'000 * (3 - i), {0.1, 0.2, 0.3}, Eigen::Vector3d(0, 0, 9.81)});
  return frame;
}

/// What is said of soundFrame() once \p spoil has changed it; empty where it is taken.
std::string refusalOf(const std::function<void(Frame &)> &spoil, std::optional<std::int64_t> last_ns = {})
{
  Frame frame = soundFrame();
  spoil(frame);
  return test::messageOf([&] { requireSound(frame, 59, last_ns); });
}
} // namespace

TEST(FrameCheck, TakesWhatCamerasAndSensorsTell)
{
  EXPECT_EQ(refusalOf([](Frame &) {}), "");
  EXPECT_EQ(refusalOf([](Frame &) {}, kStamp_ns - 1), "");
  EXPECT_EQ(refusalOf([](Frame &f) { f.wMb_odometry->R *= 1.0001; }), "") << "a matrix with four digits";
  EXPECT_EQ(refusalOf([](Frame &f) { f.gyro[2].stamp_ns = f.gyro[1].stamp_ns; }), "") << "two of one stamp";
  EXPECT_EQ(refusalOf([](Frame &f) {
              f.gyro.clear();
              f.wMb_odometry.reset();
            }),
            "");
}

TEST(FrameCheck, NamesFrameStampAndValueOfWhatCannotBe)
{
  EXPECT_THAT(refusalOf([](Frame &) {}, kStamp_ns), HasSubstr("frame 59 at 5.9 s: its stamp must be later than 5.9 s"));
  EXPECT_THAT(refusalOf([](Frame &) {}, kStamp_ns + 1), HasSubstr("later than 5.900000001 s"));
  EXPECT_THAT(refusalOf([](Frame &f) { f.stamp_ns = std::numeric_limits<std::int64_t>::max(); }), HasSubstr("4e+09 s"));
  for (const double wrong : {kNaN, kInfinity, -kInfinity, 1e30}) {
    EXPECT_THAT(refusalOf([&](Frame &f) { f.wMb_odometry->t.y() = wrong; }), HasSubstr("frame 59 at 5.9 s: position"));
    EXPECT_THAT(refusalOf([&](Frame &f) { f.wMb_odometry->R(1, 2) = wrong; }), HasSubstr("must be a rotation"));
    if (std::isfinite(wrong))
      continue;
    EXPECT_THAT(refusalOf([&](Frame &f) { f.gyro[2].rate.z() = wrong; }),
                testing::AllOf(HasSubstr("sample 2 of the gyro, at 5.89 s: angular rate = (0.1, 0.2, "),
                               HasSubstr("must be finite")));
    EXPECT_THAT(refusalOf([&](Frame &f) { f.gyro[3].force->x() = wrong; }), HasSubstr("specific force = ("));
  }
  EXPECT_THAT(refusalOf([](Frame &f) { f.wMb_odometry->R *= 3; }), HasSubstr("(3, 0, 0), (0, 3, 0), (0, 0, 3)"));
  EXPECT_THAT(refusalOf([](Frame &f) { f.wMb_odometry->R *= 1.01; }), HasSubstr("must be a rotation"));
  EXPECT_THAT(refusalOf([](Frame &f) { f.wMb_odometry->R *= -1; }), HasSubstr("must be a rotation"));
  EXPECT_THAT(refusalOf([](Frame &f) { f.wMb_odometry->R.setZero(); }), HasSubstr("must be a rotation"));
  EXPECT_THAT(refusalOf([](Frame &f) { std::swap(f.gyro[1], f.gyro[2]); }),
              HasSubstr("sample 2 of the gyro, at 5.88 s: must not be earlier than the sample before, at 5.89 s"));
}

TEST(FrameCheck, SecondsBecomeAStampOnlyWhereTheyAreOne)
{
  EXPECT_EQ(stampOf(0.1, "stamp"), 100'000'000);
  EXPECT_EQ(stampOf(1.7e9 + 0.25, "stamp"), 1'700'000'000'250'000'000);
  for (const double stamp_s : {0.0, 0.1, 5.9, -2.5, 1.7e9 + 0.25, -3.9e9})
    EXPECT_EQ(secondsOfStamp(stampOf(stamp_s, "stamp")), stamp_s);
  for (const double wrong : {kNaN, kInfinity, -kInfinity, 1e12, -1e300})
    EXPECT_THROW(stampOf(wrong, "stamp"), vpException) << wrong;
}

TEST(FrameCheck, APictureOfAnotherSizeIsAStatus)
{
  Frame frame = soundFrame();
  frame.image.resize(240, 320);
  judgePicture(frame, 320, 240);
  EXPECT_EQ(frame.status, FrameStatus::ok);
  judgePicture(frame, 240, 320);
  EXPECT_EQ(frame.status, FrameStatus::resized);
  EXPECT_EQ(frame.message, "image of 320x240 px, must be 240x320");
  EXPECT_EQ(frame.image.getSize(), 0u);
  Frame empty = soundFrame();
  judgePicture(empty, 320, 240);
  EXPECT_EQ(empty.status, FrameStatus::missing);
}

TEST(FrameCheck, ACameraThatAProgramHandsOverIsCheckedAsOneOfAFile)
{
  MountedCamera good;
  good.bMc = forwardCamera();
  const auto with = [&](const std::function<void(MountedCamera &)> &spoil) {
    MountedCamera camera = good;
    spoil(camera);
    return test::messageOf([&] { requirePlausible(camera); });
  };
  EXPECT_EQ(with([](MountedCamera &) {}), "");
  for (const double wrong : {0.0, -200.0, kNaN, kInfinity, 1e9}) {
    EXPECT_THAT(with([&](MountedCamera &c) { c.model.pinhole.fx = wrong; }), HasSubstr("camera: ")) << wrong;
    EXPECT_THAT(with([&](MountedCamera &c) { c.model.pinhole.fy = wrong; }), HasSubstr("camera: ")) << wrong;
  }
  EXPECT_THAT(with([](MountedCamera &c) { c.model.pinhole.cx = kNaN; }), HasSubstr("principal point"));
  EXPECT_THAT(with([](MountedCamera &c) { c.model.pinhole.cy = 1e9; }), HasSubstr("principal point"));
  for (const int wrong : {-320, 0, 1, 15, 20000})
    EXPECT_THAT(with([&](MountedCamera &c) { c.model.pinhole.height = wrong; }), HasSubstr("must be 16 to 16384 px"));
  EXPECT_THAT(with([](MountedCamera &c) { c.bMc.t.x() = kNaN; }), HasSubstr("from the body"));
  EXPECT_THAT(with([](MountedCamera &c) { c.bMc.R(0, 0) = kNaN; }), HasSubstr("rigid motion"));
  EXPECT_THAT(with([](MountedCamera &c) { c.bMc.R *= 2; }), HasSubstr("rigid motion"));
  EXPECT_THAT(with([](MountedCamera &c) { c.bMc.R.setIdentity(); }), HasSubstr("no rotation in the body"));
}

namespace
{
/// The gaps that are told of frames that come after these intervals [s].
std::vector<double> gapsOf(const std::vector<double> &intervals_s, FrameStatus status = FrameStatus::ok)
{
  PinholeCamera camera;
  camera.fx = camera.fy = 50;
  FrameJudge health(camera, Pose());
  std::vector<double> gaps;
  double time_s = 7;
  for (std::size_t i = 0; i <= intervals_s.size(); ++i) {
    Frame frame;
    time_s += i > 0 ? intervals_s[i - 1] : 0;
    frame.stamp_ns = std::llround(1e9 * time_s);
    frame.status = status;
    frame.image.resize(48, 64);
    for (int v = 0; v < 48; ++v)
      for (int u = 0; u < 64; ++u)
        frame.image[v][u] = static_cast<unsigned char>(128 + 60 * std::sin(0.3 * u + time_s) * std::cos(0.2 * v));
    health.judge(frame);
    if (frame.gap_s > 0)
      gaps.push_back(frame.gap_s);
    EXPECT_EQ(frame.gap_s > 0, frame.message.rfind("no picture for", 0) == 0) << frame.message;
  }
  return gaps;
}

std::vector<double> steady(std::size_t count, double interval_s) { return std::vector<double>(count, interval_s); }
} // namespace

TEST(FrameJudge, TellsOfATimeWithoutAPicture)
{
  std::vector<double> once = steady(40, 0.1), bursts = steady(60, 0.1);
  once[20] = 2.1;
  bursts[20] = bursts[30] = bursts[40] = bursts[50] = 1;
  EXPECT_THAT(gapsOf(once), testing::ElementsAre(testing::DoubleNear(2.1, 1e-9)));
  EXPECT_EQ(gapsOf(bursts).size(), 4u) << "a pause after each";
  EXPECT_TRUE(gapsOf(once, FrameStatus::missing).empty()) << "the source fills it with missing frames";
}

TEST(FrameJudge, ACameraOfAnyRateThatVariesHasNoGap)
{
  std::mt19937 random(1);
  for (const double usual_s : {0.01, 0.033, 0.1, 0.4, 1.0, 5.0}) {
    std::vector<double> intervals;
    for (int i = 0; i < 500; ++i) // between the usual rate and a third more than twice as slow
      intervals.push_back(usual_s * std::uniform_real_distribution<double>(1, 2.3)(random));
    EXPECT_TRUE(gapsOf(intervals).empty()) << usual_s;
  }
}

TEST(FrameJudge, ACameraThatGoesOnAtAnotherRateIsToldOnlyWhereItIsVerySlowAndUntilThatIsUsual)
{
  const auto gapsFrom = [](double slow_s) {
    std::vector<double> intervals = steady(20, 0.1);
    intervals.resize(120, slow_s);
    return gapsOf(intervals).size();
  };
  EXPECT_EQ(gapsFrom(0.4), 0u);
  EXPECT_GE(gapsFrom(1), 1u);
  EXPECT_LE(gapsFrom(1), 8u);
}
