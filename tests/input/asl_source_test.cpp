// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight_folder.h"
#include "support/test.h"

#include "input/frame_builder.h"
#include "input/recorded_source.h"

using namespace bole;
using bole::test::FlightFolder;
using bole::test::messageOf;
using bole::test::readAll;
using testing::HasSubstr;

TEST(AslSource, DeliversEveryFrameWithStampPixelsOdometryAndGyro)
{
  const FlightFolder flight(5);
  AslSource source(flight.path());
  const auto frames = readAll(source);

  ASSERT_EQ(frames.size(), 5u);
  EXPECT_EQ(source.size(), 5u);
  EXPECT_TRUE(source.hasOdometry());
  EXPECT_TRUE(source.hasGyro());
  EXPECT_EQ(source.camera().width, 64);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    EXPECT_EQ(frames[i].status, FrameStatus::ok) << frames[i].message;
    EXPECT_EQ(frames[i].index, i);
    EXPECT_EQ(frames[i].stamp_ns, static_cast<std::int64_t>(i) * 100000000);
    EXPECT_EQ(frames[i].image.getWidth(), 64u);
    EXPECT_EQ(frames[i].image[3][5], FlightFolder::pixel(i, 3, 5));
    ASSERT_TRUE(frames[i].wMb_odometry);
    EXPECT_NEAR(frames[i].wMb_odometry->t.x(), 0.1 * static_cast<double>(i), 1e-9);
    EXPECT_EQ(frames[i].gyro.size(), i == 0 ? 0u : 10u);
  }
  EXPECT_EQ(frames[2].gyro.front().stamp_ns, 110000000);
  EXPECT_EQ(frames[2].gyro.back().stamp_ns, 200000000);
  ASSERT_TRUE(frames[2].gyro.front().force);
  EXPECT_EQ(*frames[2].gyro.front().force, Eigen::Vector3d(0, 0, 9.81));
}

TEST(AslSource, TakesTheMav0OfASequenceAndAGyroWithoutAnAccelerometerHasNoForce)
{
  const FlightFolder flight(2);
  flight.write("mav0/imu0/data.csv", "0,0,0,0.1\n50000000,0,0,0.1\n");
  AslSource source(flight.path() + "/mav0");
  const std::vector<Frame> frames = readAll(source);
  ASSERT_EQ(frames.size(), 2u);
  ASSERT_EQ(frames[1].gyro.size(), 1u);
  EXPECT_FALSE(frames[1].gyro.front().force);
}

TEST(AslSource, TurnsBrokenImagesIntoStatuses)
{
  FlightFolder flight(6);
  flight.removeImage(1);
  flight.truncateImage(2, 100);
  flight.writeImage(3, 32, 24);
  flight.copyImage(4, 5);
  AslSource source(flight.path());
  const auto frames = readAll(source);

  ASSERT_EQ(frames.size(), 6u);
  const FrameStatus expected[] = {FrameStatus::ok,      FrameStatus::missing, FrameStatus::corrupt,
                                  FrameStatus::resized, FrameStatus::ok,      FrameStatus::stale};
  for (std::size_t i = 0; i < 6; ++i)
    EXPECT_EQ(frames[i].status, expected[i]) << i << " " << frames[i].message;
  for (std::size_t i = 1; i <= 3; ++i) {
    EXPECT_EQ(frames[i].image.getSize(), 0u);
    EXPECT_FALSE(frames[i].message.empty());
    EXPECT_TRUE(frames[i].wMb_odometry);
  }
}

TEST(AslSource, EveryTruncationAndAFlippedByteOfAPngAreCorrupt)
{
  FlightFolder flight(10);
  const std::size_t sizes[] = {0, 1, 8, 20, 33, 60, 200, 400};
  for (std::size_t i = 0; i < 8; ++i)
    flight.truncateImage(1 + i, sizes[i]);
  flight.flipByte(9, 300);
  AslSource source(flight.path());
  const auto frames = readAll(source);
  for (std::size_t i = 1; i < 10; ++i)
    EXPECT_EQ(frames[i].status, FrameStatus::corrupt) << i;
}

TEST(AslSource, AHugePictureAmongSmallOnesIsNotDecoded)
{
  FlightFolder flight(3);
  std::fstream file(flight.imagePath(1), std::ios::in | std::ios::out | std::ios::binary);
  const char header[] = {0, 0, 0x7D, 0, 0, 0, 0x7D, 0, 8, 0, 0, 0, 0}; // IHDR of 32000x32000, 8 bit, grey
  std::string chunk = std::string("IHDR") + std::string(header, sizeof header);
  std::uint32_t crc = 0xFFFFFFFFu;
  for (const char byte : chunk) {
    crc ^= static_cast<unsigned char>(byte);
    for (int k = 0; k < 8; ++k)
      crc = (crc & 1) ? 0xEDB88320u ^ (crc >> 1) : crc >> 1;
  }
  crc = ~crc;
  file.seekp(12);
  file.write(chunk.data(), static_cast<std::streamsize>(chunk.size()));
  for (int k = 3; k >= 0; --k)
    file.put(static_cast<char>(crc >> (8 * k)));
  file.close();
  AslSource source(flight.path());
  const auto frames = readAll(source);
  EXPECT_EQ(frames[1].status, FrameStatus::resized);
  EXPECT_THAT(frames[1].message, HasSubstr("image of 32000x32000 px, must be 64x48"));
  EXPECT_EQ(frames[2].status, FrameStatus::ok);
}

TEST(AslSource, AJpegOfTwoSizesIsCorrupt)
{
  FlightFolder flight(2);
  std::vector<unsigned char> jpeg;
  ASSERT_TRUE(cv::imencode(".jpg", cv::Mat(16, 32, CV_8UC1, cv::Scalar(90)), jpeg));
  const std::vector<unsigned char> header{0xFF, 0xC0, 0, 11, 8, 0, 48, 0, 64, 1, 1, 0x11, 0}; // of 64x48
  jpeg.insert(jpeg.begin() + 2, header.begin(), header.end());
  const std::string path = flight.path() + "/two.jpg";
  std::ofstream(path, std::ios::binary)
      .write(reinterpret_cast<const char *>(jpeg.data()), static_cast<std::streamsize>(jpeg.size()));
  const ImageFile file = readImageFile(path, 64, 48);
  EXPECT_EQ(file.status, FrameStatus::corrupt);
  EXPECT_THAT(file.message, HasSubstr("64x48 and 32x16 px"));
  EXPECT_EQ(file.image.getSize(), 0u);
}

TEST(AslSource, ATiffThatWasCutOffIsCorrupt)
{
  FlightFolder flight(2);
  const std::string path = flight.path() + "/whole.tiff";
  ASSERT_TRUE(cv::imwrite(path, cv::imread(flight.imagePath(1), cv::IMREAD_GRAYSCALE)));
  EXPECT_EQ(readImageFile(path).status, FrameStatus::ok) << readImageFile(path).message;
  const auto size = std::filesystem::file_size(path);
  for (const double share : {0.95, 0.5, 0.1}) {
    std::filesystem::resize_file(path, static_cast<std::uintmax_t>(share * static_cast<double>(size)));
    EXPECT_EQ(readImageFile(path).status, FrameStatus::corrupt) << share;
  }
}

TEST(AslSource, LeavesOdometryAbsentOutsideItsRangeAndInterpolatesWithin)
{
  FlightFolder flight(5);
  flight.write("mav0/odom0/data.csv", "160000000,0.16,0,1,1,0,0,0\n350000000,0.35,0,1,1,0,0,0\n");
  AslSource source(flight.path());
  const auto frames = readAll(source);

  EXPECT_FALSE(frames[0].wMb_odometry);
  EXPECT_FALSE(frames[1].wMb_odometry);
  ASSERT_TRUE(frames[2].wMb_odometry);
  EXPECT_NEAR(frames[2].wMb_odometry->t.x(), 0.2, 1e-12);
  EXPECT_FALSE(frames[4].wMb_odometry);
}

TEST(AslSource, AnOdometryThatBeginsAHairAfterTheFirstPictureBeginsWithIt)
{
  FlightFolder flight(5);
  flight.write("mav0/odom0/data.csv",
               "30000000,0.03,0,1,1,0,0,0\n130000000,0.13,0,1,1,0,0,0\n400000000,0.4,0,1,1,0,0,0\n");
  AslSource source(flight.path());
  for (const Frame &frame : readAll(source)) {
    ASSERT_TRUE(frame.wMb_odometry) << frame.index;
    EXPECT_NEAR(frame.wMb_odometry->t.x(), 1e-9 * static_cast<double>(frame.stamp_ns), 1e-9);
  }
}

TEST(AslSource, NamesFileAndLineOfAFaultyRow)
{
  struct Case
  {
    const char *file, *text, *message;
  };
  const Case cases[] = {
      {"mav0/odom0/data.csv", "0,0,0,1,1,0,0,0\n0,0,0,1,1,0,0,0\n", "odom0/data.csv:2: timestamp = 0 ns"},
      {"mav0/odom0/data.csv", "0,0,0,1,1,1,0,0\n", "odom0/data.csv:1: norm of the quaternion"},
      {"mav0/odom0/data.csv", "0,0,0,1\n", "odom0/data.csv:1: 4 columns, must be 8"},
      {"mav0/odom0/data.csv", "0,0,0,1,1,0,0,0,7\n100000000,0,0,1,1,0,0,0\n", "odom0/data.csv:2: 8 columns, must be 9"},
      {"mav0/odom0/data.csv", "", "odom0/data.csv: no pose"},
      {"mav0/odom0/data.csv", "900000000000,0,0,1,1,0,0,0\n", "never meet"},
      {"mav0/imu0/data.csv", "0,0,0,inf\n", "imu0/data.csv:1: w_z = \"inf\""},
      {"mav0/imu0/data.csv", "900000000000,0,0,0\n", "never meet those of the images"},
      {"mav0/imu0/data.csv", "0,\x1B[2J,0,0\n", "imu0/data.csv:1: w_x = \"?[2J\", must be a finite number"},
      {"mav0/cam0/data.csv", "#nothing\n", "cam0/data.csv: no image"},
      {"mav0/cam0/sensor.yaml", "resolution: [64, 48]\nintrinsics: [50, 50, 31.5, 23.5]\nfoo: 1\n",
       "sensor.yaml:3: unknown key \"foo\""},
      {"mav0/cam0/sensor.yaml", "resolution: [64, 48]\nintrinsics: [50, 50, 31.5]\n",
       "sensor.yaml:2: intrinsics = [50, 50, 31.5], must be"},
      {"mav0/cam0/sensor.yaml", "resolution: [65, 48]\nintrinsics: [50, 50, 31.5, 23.5]\n",
       "image of 64x48 px, must be 65x48"},
      {"mav0/cam0/sensor.yaml", "resolution: [64, 48\n", "sensor.yaml:2:"},
  };
  for (const Case &c : cases) {
    FlightFolder flight(3);
    flight.write(c.file, c.text);
    EXPECT_REFUSED(c.message, AslSource source(flight.path())) << c.text;
  }
}

TEST(AslSource, ReadsAByteOrderMarkAndAHeaderWithoutItsSign)
{
  FlightFolder flight(3);
  flight.write("mav0/odom0/data.csv",
               "\xEF\xBB\xBFtimestamp,x,y,z,qw,qx,qy,qz\n0,0,0,1,1,0,0,0\n200000000,0.2,0,1,1,0,0,0\n");
  flight.write("mav0/imu0/data.csv", "\xEF\xBB\xBF#timestamp\n0,0,0,0\n100000000,0,0,0\n");
  AslSource source(flight.path());
  EXPECT_TRUE(readAll(source)[1].wMb_odometry);
}

/// imu0/data.csv of ten samples with this specific force.
std::string imuWith(const char *force)
{
  std::string text;
  for (int k = 0; k < 12; ++k)
    text += fmt::format("{},0,0,0.1,{}\n", 10000000 * k, force);
  return text;
}

TEST(AslSource, NamesTheUnitOfAnAccelerometerThatDoesNotFeelGravity)
{
  const std::pair<const char *, const char *> cases[] = {{"0,-998,0", "looks like thousandths of g"},
                                                         {"0.1,0,0.05", "gravity were taken out"},
                                                         {"0,0,981", "must be 4 to 25"}};
  for (const auto &[force, message] : cases) {
    FlightFolder flight(3);
    flight.write("mav0/imu0/data.csv", imuWith(force));
    EXPECT_REFUSED(message, AslSource source(flight.path())) << force;
  }
  FlightFolder without(3);
  without.write("mav0/imu0/data.csv", imuWith("0,0,0"));
  AslSource source(without.path());
  const auto frames = readAll(source);
  ASSERT_FALSE(frames[1].gyro.empty());
  EXPECT_FALSE(frames[1].gyro[0].force); // columns of zeros are no accelerometer
}

TEST(AslSource, NamesASlowGyroInDegrees)
{
  const auto refusal = [](double unit) {
    constexpr std::size_t kFrames = 40;
    FlightFolder flight(kFrames);
    std::string poses, rates;
    for (std::size_t i = 0; i < kFrames; ++i) {
      const double yaw = 0.03 * std::sin(0.3 * static_cast<double>(i)); // at most 0.09 rad/s: 5.2 degrees a second
      poses += fmt::format("{},0,0,1,{:.9f},0,0,{:.9f}\n", i * 100000000, std::cos(yaw / 2), std::sin(yaw / 2));
    }
    for (std::size_t k = 1; k <= 10 * kFrames; ++k)
      rates += fmt::format("{},0,0,{:.6f}\n", k * 10000000,
                           unit * 0.09 * std::cos(0.3 * (static_cast<double>(k) - 0.5) / 10));
    flight.write("mav0/odom0/data.csv", poses);
    flight.write("mav0/imu0/data.csv", rates);
    return messageOf([&] { AslSource source(flight.path()); });
  };
  EXPECT_EQ(refusal(1), "");
  EXPECT_EQ(refusal(-1), "");
  EXPECT_THAT(refusal(180 / M_PI), HasSubstr("looks like degrees per second"));
}

TEST(AslSource, DecodesOnlyWhatTellsItsSize)
{
  FlightFolder flight(4);
  const auto replace = [&flight](std::size_t i, const std::string &bytes) {
    std::ofstream(flight.imagePath(i), std::ios::binary) << bytes;
  };
  replace(1, "P5 # a comment\n30000 30000 255\n");
  replace(2, "RIFF....WEBPVP8 ");
  AslSource source(flight.path());
  const auto frames = readAll(source);
  EXPECT_EQ(frames[1].status, FrameStatus::resized);
  EXPECT_THAT(frames[1].message, HasSubstr("image of 30000x30000 px, must be 64x48"));
  EXPECT_EQ(frames[2].status, FrameStatus::corrupt);
  EXPECT_THAT(frames[2].message, HasSubstr("must be a PNG, JPEG, PNM, BMP or TIFF"));
  EXPECT_EQ(frames[3].status, FrameStatus::ok);
}

TEST(AslSource, ReadsEveryKindOfImage)
{
  for (const char *kind : {".png", ".jpg", ".pgm", ".bmp", ".tiff"}) {
    FlightFolder flight(2);
    const cv::Mat image = cv::imread(flight.imagePath(1), cv::IMREAD_GRAYSCALE);
    const std::string path = testing::TempDir() + "bole_kind" + kind;
    cv::imwrite(path, image);
    std::filesystem::rename(path, flight.imagePath(1)); // what it is stands in its bytes, not in its name
    AslSource source(flight.path());
    EXPECT_EQ(readAll(source)[1].status, FrameStatus::ok) << kind;
  }
}

TEST(AslSource, RefusesFoldersThatAreNoFlight)
{
  const FlightFolder flight(1);
  EXPECT_REFUSED("no ASL folder", AslSource source(flight.path() + "/none"));
  FlightFolder blind(2);
  blind.removeImage(0);
  blind.removeImage(1);
  EXPECT_REFUSED("none of the 2 images", AslSource source(blind.path()));
}

TEST(AslSource, ReadsTheRenderedFlight)
{
  const std::string folder = BOLE_SHARED_DATA_DIR "/rendered/park-forward";
  if (!AslSource::accepts(folder))
    GTEST_SKIP() << folder << " is absent";
  AslSource source(folder);
  const auto frames = readAll(source);
  ASSERT_EQ(frames.size(), 120u);
  for (const Frame &frame : frames) {
    EXPECT_EQ(frame.status, FrameStatus::ok);
    ASSERT_TRUE(frame.wMb_odometry && frame.wMb_truth);
    EXPECT_LT((frame.wMb_odometry->t - frame.wMb_truth->t).norm(), 2);
    EXPECT_EQ(frame.gyro.size(), frame.index == 0 ? 0u : 20u);
  }
}
