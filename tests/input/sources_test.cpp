// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight_folder.h"
#include "support/test.h"

#include "geometry/so3.h"
#include "input/recorded_source.h"
#include "input/trajectory.h"
#include <bole/open_source.h>
#include <opencv2/videoio.hpp>

using namespace bole;
using bole::test::FlightFolder;
using bole::test::messageOf;
using bole::test::readAll;
using bole::test::textOf;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

namespace
{
constexpr std::size_t kTicks = 28; ///< in the header of an AVI's stream: ticks a frame, then ticks a second

cv::Mat picture(std::size_t index, int width = 96, int height = 64)
{
  cv::Mat image(height, width, CV_8UC3);
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const auto value = static_cast<unsigned char>(128 + 60 * std::sin(0.2 * u + 0.7 * static_cast<double>(index)) *
                                                              std::cos(0.1 * v));
      image.at<cv::Vec3b>(v, u) = {value, value, value};
    }
  return image;
}

/// A folder of its own with what tests put into it.
class Sources : public testing::Test
{
protected:
  Sources() : m_flight(1) {}
  std::string path(const std::string &name) const { return m_flight / name; }

  void writeImages(const std::string &pattern, const std::vector<int> &numbers) const
  {
    for (const int number : numbers)
      cv::imwrite(path(cv::format(pattern.c_str(), number)), picture(static_cast<std::size_t>(number)));
  }
  void writeVideo(const std::string &name, std::size_t frames, double rate) const
  {
    cv::VideoWriter writer(path(name), cv::VideoWriter::fourcc('M', 'J', 'P', 'G'), rate, cv::Size(96, 64));
    ASSERT_TRUE(writer.isOpened());
    for (std::size_t i = 0; i < frames; ++i)
      writer.write(picture(i));
  }
  /// Other bytes in the place of those of a file.
  void overwrite(const std::string &name, std::size_t at, const std::string &bytes) const
  {
    std::string all = textOf(path(name));
    m_flight.write(name, all.replace(at, bytes.size(), bytes));
  }
  FlightFolder m_flight;
};
} // namespace

TEST_F(Sources, ASequenceWithoutARateHasThatOfItsCameraFile)
{
  writeImages("image%04d.png", {0, 1});
  m_flight.write("camera.yaml",
                 "rate_hz: 8\nresolution: [96, 64]\ncamera_model: pinhole\nintrinsics: [80, 80, 47.5, 31.5]\n"
                 "distortion_model: radial-tangential\ndistortion_coefficients: [0, 0, 0, 0]\n");
  SourceOptions options;
  const auto secondStamp = [&] {
    SequenceSource source(path("image%04d.png"), options);
    return readAll(source).at(1).stamp_ns;
  };
  EXPECT_EQ(secondStamp(), 40000000);
  options.camera_path = path("camera.yaml");
  EXPECT_EQ(secondStamp(), 125000000);
  options.frame_rate_hz = 20;
  EXPECT_EQ(secondStamp(), 50000000);
}

TEST_F(Sources, ASequenceKeepsThePlaceOfImagesThatAreMissingOrTruncated)
{
  writeImages("image%04d.jpg", {3, 4, 6, 7, 8});
  m_flight.write("image0005.txt", "no image");
  std::filesystem::resize_file(path("image0007.jpg"), std::filesystem::file_size(path("image0007.jpg")) / 2);
  SourceOptions options;
  options.frame_rate_hz = 20;
  SequenceSource source(path("image%04d.jpg"), options);
  const auto frames = readAll(source);

  ASSERT_EQ(frames.size(), 6u);
  EXPECT_EQ(source.size(), 6u);
  const FrameStatus expected[] = {FrameStatus::ok, FrameStatus::ok,      FrameStatus::missing,
                                  FrameStatus::ok, FrameStatus::corrupt, FrameStatus::ok};
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(frames[i].status, expected[i]) << i;
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 50000000);
    EXPECT_EQ(frames[i].index, i);
  }
}

TEST_F(Sources, AFolderOfNumberedImagesIsASequence)
{
  std::filesystem::create_directories(path("tree.d"));
  writeImages("tree.d/v2_%05d.jpg", {0, 1, 2});
  const auto source = openSource(path("tree.d"));
  EXPECT_EQ(readAll(*source).size(), 3u);
  EXPECT_THAT(source->name(), HasSubstr("v2_%05d.jpg"));

  std::filesystem::create_directories(path("plain"));
  writeImages("plain/a%d.ppm", {8, 9, 10, 11});
  EXPECT_EQ(readAll(*openSource(path("plain"))).size(), 4u);
  EXPECT_EQ(readAll(*openSource(path("plain/a%d.ppm"))).size(), 4u);
}

TEST_F(Sources, AHoleOfManyNumbersIsRefused)
{
  m_flight.write("big99999999999999999999.png", "no number of an image");
  EXPECT_REFUSED("no such image", SequenceSource(path("big%d.png")));
  writeImages("hole%d.png", {1, 500000});
  EXPECT_REFUSED("no image from number 2 to 499999, must be at most 10000 in a row",
                 SequenceSource(path("hole%d.png")));
}

TEST_F(Sources, AVideoGivesEveryFrameWithItsTime)
{
  writeVideo("v.avi", 12, 8);
  VideoSource source(path("v.avi"));
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 12u);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].status, FrameStatus::ok);
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 125000000);
    const cv::Mat truth = picture(i);
    EXPECT_NEAR(frames[i].image[20][30], truth.at<cv::Vec3b>(20, 30)[0], 8);
  }
}

TEST_F(Sources, DamagedFramesOfAVideoAreReportedInTheirPlace)
{
  writeVideo("v.avi", 12, 10);
  const std::string bytes = textOf(path("v.avi"));
  std::size_t at = bytes.find("movi");
  for (int i = 0; i <= 5; ++i)
    at = bytes.find("00dc", at + 4);
  overwrite("v.avi", at + 8, std::string(400, '\0')); // the compressed picture of one frame in the middle
  VideoSource source(path("v.avi"));
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 12u);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].status, i == 5 ? FrameStatus::corrupt : FrameStatus::ok) << i << frames[i].message;
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 100000000);
  }
}

TEST_F(Sources, AVideoThatWasCutOffReportsTheRestAsMissing)
{
  writeVideo("v.avi", 12, 10);
  const std::string bytes = textOf(path("v.avi"));
  std::size_t cut = bytes.find("movi"); // in the middle of the eighth picture
  for (int i = 0; i < 8; ++i)
    cut = bytes.find("00dc", cut + 4);
  std::filesystem::resize_file(path("v.avi"), cut + 200);
  VideoSource source(path("v.avi"));
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 12u);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].status, i < 7    ? FrameStatus::ok
                                : i == 7 ? FrameStatus::corrupt
                                         : FrameStatus::missing)
        << i << ": " << frames[i].message;
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 100000000);
    EXPECT_EQ(frames[i].index, i);
  }
  EXPECT_THAT(frames[11].message, HasSubstr("12 frames by its container"));
}

TEST_F(Sources, RefusesOdometryThatBeginsAfterTheVideoOrIsOverBeforeIt)
{
  writeVideo("v.avi", 12, 10); // 1.2 s
  m_flight.write("late.tum", "500 0 0 0 0 0 0 1\n501 0 0 0 0 0 0 1\n");
  m_flight.write("early.tum", "-9 0 0 0 0 0 0 1\n-8 0 0 0 0 0 0 1\n");
  for (const char *name : {"late.tum", "early.tum"}) {
    SourceOptions options;
    options.odometry_path = path(name);
    EXPECT_THAT(messageOf([&] { openSource(path("v.avi"), options); }),
                testing::AllOf(HasSubstr(path(name)), HasSubstr("never meet"), HasSubstr("--odometry-offset")));
  }
}

/// A header that says a frame lasts 68 years.
TEST_F(Sources, ARateThatNoCameraHasIsNotBelieved)
{
  writeVideo("v.avi", 5, 10);
  overwrite("v.avi", textOf(path("v.avi")).find("strh") + kTicks, std::string("\xff\xff\xff\x7f\1\0\0\0", 8));
  VideoSource source(path("v.avi"));
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 5u);
  for (std::size_t i = 0; i < frames.size(); ++i)
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 40000000) << "25 frames a second";
}

TEST_F(Sources, RandomDamageNeverThrowsAndNeverTurnsBackTime)
{
  writeVideo("v.avi", 10, 10);
  const std::string good = textOf(path("v.avi"));
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    std::string bytes = good;
    for (int i = 0; i < 30; ++i)
      bytes[6000 + random() % (good.size() - 6000)] = static_cast<char>(random());
    m_flight.write("w.avi", bytes);
    VideoSource source(path("w.avi"));
    std::int64_t last_ns = -1;
    for (const Frame &frame : readAll(source)) {
      EXPECT_GT(frame.stamp_ns, last_ns);
      last_ns = frame.stamp_ns;
    }
  }
}

TEST_F(Sources, AVideoWhoseTimesGoBackGoesOnAtItsRate)
{
  {
    cv::VideoWriter writer(path("v.ts"), cv::CAP_FFMPEG, cv::VideoWriter::fourcc('m', 'p', 'g', '2'), 25,
                           cv::Size(96, 64));
    ASSERT_TRUE(writer.isOpened());
    for (std::size_t i = 0; i < 20; ++i)
      writer.write(picture(i));
  }
  const std::string once = textOf(path("v.ts"));
  m_flight.write("twice.ts", once + once); // as a recorder that was started anew
  VideoSource source(path("twice.ts"));
  const std::vector<Frame> frames = readAll(source);
  ASSERT_GE(frames.size(), 38u);
  for (std::size_t i = 1; i < frames.size(); ++i)
    EXPECT_NEAR(1e-9 * static_cast<double>(frames[i].stamp_ns - frames[i - 1].stamp_ns), 0.04, 0.005) << i;
}

TEST_F(Sources, OdometryOfATumFileIsInterpolatedWithItsOffset)
{
  writeVideo("v.avi", 5, 10);
  m_flight.write("odometry.tum", "# t x y z q\n100.0 0 0 1 0 0 0 1\n100.2 2 0 1 0 0 0 1\n1.004e2 4 0 1 0 0 0 1\n");
  SourceOptions options;
  options.odometry_path = path("odometry.tum");
  options.odometry_offset_s = -100;
  const auto source = openSource(path("v.avi"), options);
  EXPECT_TRUE(source->hasOdometry());
  const auto frames = readAll(*source);
  for (std::size_t i = 0; i < 5; ++i) {
    ASSERT_TRUE(frames[i].wMb_odometry);
    EXPECT_NEAR(frames[i].wMb_odometry->t.x(), static_cast<double>(i), 1e-9);
  }
}

TEST_F(Sources, SaysWhatIsWrongInOneLine)
{
  writeImages("i%02d.png", {0, 1});
  m_flight.write("o.tum", "5 0 0 0 0 0 0 1\n4 0 0 0 0 0 0 1\n");
  m_flight.write("nan.tum", "0 0 0 nan 0 0 0 1\n");
  m_flight.write("video.mp4", "this is no video");
  m_flight.write("camera.yaml", "resolution: [640, 480]\nintrinsics: [500, 500, 320, 240]\n");
  std::filesystem::create_directories(path("empty"));
  const auto open = [&](const std::string &input, const std::string &odometry, const std::string &camera) {
    SourceOptions options;
    options.odometry_path = odometry.empty() ? odometry : path(odometry);
    options.camera_path = camera.empty() ? camera : path(camera);
    return messageOf([&] { openSource(path(input), options); });
  };
  EXPECT_THAT(open("none.mp4", "", ""), HasSubstr("none.mp4: no such file"));
  EXPECT_THAT(open("video.mp4", "", ""), HasSubstr("video.mp4: no video"));
  EXPECT_THAT(open("empty", "", ""), HasSubstr("empty: must be an ASL folder"));
  EXPECT_THAT(open("j%02d.png", "", ""), HasSubstr("j%02d.png: no such image"));
  EXPECT_THAT(open("i%02d%d.png", "", ""), HasSubstr("one number"));
  EXPECT_THAT(open("i%02d.png", "o.tum", ""), HasSubstr("o.tum:2: timestamp"));
  EXPECT_THAT(open("i%02d.png", "nan.tum", ""), HasSubstr("nan.tum:1: z = \"nan\""));
  EXPECT_THAT(open("i%02d.png", "", "camera.yaml"), HasSubstr("resolution = 640x480, must be 96x64"));
}

TEST_F(Sources, AFileThatExistsIsThatFileWhateverItsName)
{
  writeVideo("v.avi", 3, 10);
  const auto before = std::filesystem::current_path();
  std::filesystem::current_path(m_flight.path()); // a name without a slash might be an address
  for (const char *name : {"My Video 100%.AVI", "2026-11-28T10:00:05.avi", "rtsp:.avi", "%d.avi", "-[1]{a,b}*?.avi",
                           "no extension", "file:v.avi", "concat:a|b.avi"}) {
    std::filesystem::copy_file("v.avi", name);
    EXPECT_EQ(messageOf([&] { EXPECT_EQ(readAll(*openSource(name)).size(), 3u) << name; }), "") << name;
  }
  std::filesystem::current_path(before);
  std::filesystem::create_directories(path("12:30 %05d"));
  std::filesystem::copy_file(path("v.avi"), path("12:30 %05d/v.avi"));
  EXPECT_EQ(readAll(*openSource(path("12:30 %05d/v.avi"))).size(), 3u);
  writeImages("image%d.png", {7, 8});
  for (const int number : {7, 8})
    std::filesystem::rename(path(cv::format("image%d.png", number)),
                            path("12:30 %05d/") + cv::format("image%d.png", number));
  EXPECT_EQ(readAll(*openSource(path("12:30 %05d"))).size(), 2u);
  EXPECT_EQ(readAll(*openSource(path("12:30 %05d/image%d.png"))).size(), 2u);
  EXPECT_REFUSED("image7.png: is one picture, must be", openSource(path("12:30 %05d/image7.png")));
}

TEST_F(Sources, AnOptionWithoutEffectIsRefusedByItsName)
{
  writeVideo("v.avi", 3, 10);
  writeImages("i%02d.png", {0, 1});
  m_flight.write("o.tum", "0 0 0 1 0 0 0 1\n1 0 0 1 0 0 0 1\n");
  m_flight.write("camera.yaml", "resolution: [96, 64]\nintrinsics: [80, 80, 47.5, 31.5]\n");
  SourceOptions rate, view, offset, camera_and_view;
  rate.frame_rate_hz = 10;
  view.field_of_view_deg = 70;
  offset.odometry_offset_s = 1;
  camera_and_view.camera_path = path("camera.yaml");
  camera_and_view.field_of_view_deg = 70;
  struct Case
  {
    std::string input;
    SourceOptions options;
    const char *message;
  };
  const Case cases[] = {
      {path("v.avi"), rate, "v.avi: frame_rate_hz (--rate) has no effect: a video has stamps"},
      {m_flight.path(), rate, "frame_rate_hz (--rate) has no effect: an ASL folder has stamps"},
      {path("i%02d.png"), rate, nullptr},
      {path("v.avi"), view, nullptr},
      {m_flight.path(), view, "field_of_view_deg (--field-of-view) has no effect: the camera is known"},
      {path("v.avi"), camera_and_view, "field_of_view_deg (--field-of-view) has no effect: the camera"},
      {path("v.avi"), offset, "odometry_offset_s (--odometry-offset) has no effect: no odometry file"},
      {m_flight.path(), offset, "odometry_offset_s (--odometry-offset) has no effect: no odometry file"}};
  for (const Case &c : cases)
    EXPECT_THAT(messageOf([&] { openSource(c.input, c.options); }),
                c.message == nullptr ? testing::Eq("") : testing::Matcher<std::string>(HasSubstr(c.message)));
}

TEST_F(Sources, ASequenceInStepsHasAFrameAStep)
{
  writeImages("s%03d.png", {10, 15, 20, 30});
  EXPECT_REFUSED("s%03d.png: the numbers go in steps of 5: frame_rate_hz (--rate) must tell",
                 SequenceSource(path("s%03d.png")));
  SourceOptions options;
  options.frame_rate_hz = 50;
  SequenceSource source(path("s%03d.png"), options);
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 5u);
  EXPECT_EQ(frames[1].stamp_ns, 100000000);
  EXPECT_EQ(frames[1].status, FrameStatus::ok);
  EXPECT_EQ(frames[3].status, FrameStatus::missing);
}

TEST_F(Sources, PixelsOfAVideoMayBeWiderThanHigh)
{
  writeVideo("square.avi", 3, 10);
  const std::string make =
      "ffmpeg -loglevel error -y -i " + path("square.avi") + " -c copy -aspect 2:1 " + path("wide.mp4");
  if (std::system(make.c_str()) != 0)
    GTEST_SKIP() << "no ffmpeg";
  const PinholeCamera square = openSource(path("square.avi"))->camera(), wide = openSource(path("wide.mp4"))->camera();
  EXPECT_DOUBLE_EQ(square.fy, square.fx);
  EXPECT_DOUBLE_EQ(wide.fx, square.fx);
  EXPECT_NEAR(wide.fy / wide.fx, 4.0 / 3, 1e-6) << "96x64 pixels shown as 2:1";
}

TEST_F(Sources, ARecordingWithoutItsIndexAndARateOfNoCameraAreNamed)
{
  m_flight.write("cut.mp4", std::string("\0\0\0 ftypisom", 12) + std::string(4000, 'x'));
  EXPECT_REFUSED("cut.mp4: no video: its index is missing (moov)", openSource(path("cut.mp4")));
  writeVideo("fast.avi", 5, 10);
  overwrite("fast.avi", textOf(path("fast.avi")).find("strh") + kTicks, std::string("\1\0\0\0\xe8\3\0\0", 8));
  EXPECT_REFUSED("1000 pictures a second by its container", openSource(path("fast.avi")));
}

TEST_F(Sources, PicturesOfAFewPixelsAreRefused)
{
  for (const cv::Size size : {cv::Size(1, 1), cv::Size(320, 1), cv::Size(8, 200)}) {
    cv::imwrite(path("tiny1.png"), cv::Mat(size, CV_8UC1, cv::Scalar(128)));
    EXPECT_REFUSED("must be 16 to", SequenceSource(path("tiny%d.png")));
  }
}

TEST_F(Sources, SaysThatTheCameraIsAssumed)
{
  writeImages("i%02d.png", {0, 1});
  SourceOptions options;
  options.field_of_view_deg = 90;
  const auto source = openSource(path("i%02d.png"), options);
  EXPECT_THAT(source->note(), HasSubstr("assuming a field of view of 90 degrees"));
  EXPECT_NEAR(source->camera().fx, 48, 1e-9);
}

TEST_F(Sources, SaysThatTheRateOfNumberedImagesIsAssumedAndWhatTellsAnother)
{
  writeImages("i%02d.png", {0, 1});
  SourceOptions options;
  EXPECT_THAT(openSource(path("i%02d.png"), options)->note(),
              AllOf(HasSubstr("25 frames a second"), HasSubstr("(--rate)")));
  EXPECT_FALSE(openSource(path("i%02d.png"), options)->isCameraKnown());
  options.frame_rate_hz = 10;
  EXPECT_THAT(openSource(path("i%02d.png"), options)->note(), Not(HasSubstr("a second")));
}

TEST(SourceOptions, NameTheValueThatIsOutOfRange)
{
  SourceOptions options;
  options.max_width_px = 10;
  EXPECT_REFUSED("max_width_px = 10, must be", options.validate());
  options = {};
  options.frame_rate_hz = 0;
  EXPECT_REFUSED("frame_rate_hz = 0, must be", options.validate());
}

TEST_F(Sources, NamesTheUnitOfStampsThatNoPoseFilterHasAndRefusesThoseOfNoClock)
{
  std::string asl, tum;
  for (int k = 0; k < 20; ++k) {
    asl += fmt::format("{},{},0,1,1,0,0,0\n", 100 * k, 0.1 * k); // milliseconds
    tum += fmt::format("{} {} 0 1 0 0 0 1\n", 100 * k, 0.1 * k); // too
  }
  m_flight.write("poses.csv", asl);
  m_flight.write("poses.tum", tum);
  EXPECT_REFUSED("stamps must be in nanoseconds", readTrajectory(path("poses.csv")));
  EXPECT_REFUSED("stamps must be in seconds", readTrajectory(path("poses.tum")));
  // differences of stamps are taken everywhere, and have to fit
  m_flight.write("poses.csv", "-9223372036854775808,0,0,1,1,0,0,0\n350000000,0,0,1,1,0,0,0\n");
  m_flight.write("poses.tum", "-9223372036854775808 0 0 1 0 0 0 1\n");
  m_flight.write("powers.tum", "1e300 0 0 1 0 0 0 1\n");
  for (const char *name : {"poses.csv", "poses.tum", "powers.tum"})
    EXPECT_THAT(messageOf([&] { readTrajectory(path(name)); }),
                testing::AllOf(HasSubstr(name), HasSubstr("must be at most 4e+09 s from the epoch")));
}

TEST(Trajectory, InterpolatesOnSe3)
{
  const Pose a(expSo3({0.1, 0.2, 0.3}), {1, 2, 3}), b(expSo3({0.4, -0.2, 1.3}), {2, 2, 5});
  const Trajectory trajectory = {{0, a}, {1000, b}, {5000000000, a}};
  EXPECT_LT(interpolate(trajectory, 0)->minus(a).norm(), 1e-12);
  EXPECT_LT(interpolate(trajectory, 1000)->minus(b).norm(), 1e-12);
  EXPECT_LT(interpolate(trajectory, 500)->minus(a.plus(b.minus(a) / 2)).norm(), 1e-12);
  EXPECT_FALSE(interpolate(trajectory, -1));
  EXPECT_FALSE(interpolate(trajectory, 5000000001));
  EXPECT_FALSE(interpolate(trajectory, 2000000000)); // the gap is 5 s
  EXPECT_TRUE(interpolate(trajectory, 2000000000, 6000000000));
}

TEST_F(Sources, TruthTrunksNearAndFar)
{
  m_flight.write("trees.csv", "id,x [m],y [m],radius [m],lean [deg]\n3,1.5,-2,0.2,9\n");
  m_flight.write("trees_far.csv", "id,x [m],y [m]\n10000,40,5\n");
  const auto trunks = readTruthTrunks(m_flight.path());
  ASSERT_EQ(trunks.size(), 2u);
  EXPECT_EQ(trunks[0].id, 3);
  EXPECT_NEAR(trunks[0].lean, M_PI / 20, 1e-12);
  EXPECT_EQ(trunks[1].radius, 0);
  m_flight.write("trees_far.csv", "id,x [m],y [m]\n3,40,5\n");
  EXPECT_REFUSED("trees_far.csv:2: id = 3", readTruthTrunks(m_flight.path()));
}
