// SPDX-License-Identifier: GPL-2.0-or-later
#include "flight.h"
#include "support/test.h"

#include "ardrone/flight_folder.h"
#include "input/recorded_source.h"
#include <bole/ardrone_source.h>

using namespace bole;

TEST(FlightFolder, IsReadBackAsTheFlightThatWasWritten)
{
  const test::TemporaryFolder temporary;
  const std::string &folder = temporary.path();
  MountedCamera camera = publishedArDroneCamera(1, 320, 240);
  std::vector<LiveFrame> sent;
  {
    FlightFolder writer(folder, camera);
    for (int i = 0; i < 5; ++i) {
      LiveFrame frame;
      frame.stamp_ns = 7'000'000'000 + i * 100'000'000;
      frame.status = i == 2 ? FrameStatus::corrupt : FrameStatus::ok;
      frame.picture.width = 320;
      frame.picture.height = 240;
      for (int v = 0; v < 240; ++v)
        for (int u = 0; u < 320; ++u)
          frame.picture.y.push_back(
              static_cast<std::uint8_t>(128 + 80 * std::sin(0.06 * (u - 4 * i)) * std::cos(0.05 * v)));
      frame.body = BodyState{};
      frame.body->wMb = test::MadeUpFlight::pose(0.1 * i);
      frame.gyro = {{frame.stamp_ns - 50'000'000, {0.1, 0.2, 0.3}}, {frame.stamp_ns, {0.4, 0.5, 0.6}}};
      writer.write(frame);
      sent.push_back(frame);
    }
    const std::filesystem::directory_iterator images(folder + "/mav0/cam0/data");
    EXPECT_EQ(std::distance(begin(images), end(images)), 4);
    EXPECT_THROW(FlightFolder(folder, camera), vpException);
  }
  AslSource source(folder);
  EXPECT_EQ(source.size(), 5u);
  EXPECT_TRUE(source.hasOdometry() && source.hasGyro());
  Frame frame;
  for (std::size_t i = 0; source.next(frame); ++i) {
    EXPECT_EQ(frame.status, i == 2 ? FrameStatus::missing : FrameStatus::ok);
    EXPECT_EQ(frame.stamp_ns, static_cast<std::int64_t>(i) * 100'000'000);
    ASSERT_TRUE(frame.wMb_odometry);
    EXPECT_LT(frame.wMb_odometry->minus(sent[i].body->wMb).norm(), 1e-5);
    EXPECT_EQ(frame.gyro.size(), i == 0 ? 0u : 2u);
  }
}

TEST(ArDroneCamera, TheFilesEqualThePublishedValuesInTheCode)
{
  for (const int generation : {1, 2}) {
    const auto file =
        readCamera(std::string(BOLE_SOURCE_DIR) + "/config/cameras/ardrone" + std::to_string(generation) + ".yaml");
    const auto code = generation == 1 ? publishedArDroneCamera(1, 320, 240) : publishedArDroneCamera(2, 640, 360);
    EXPECT_EQ(file.model.pinhole.fx, code.model.pinhole.fx);
    EXPECT_EQ(file.model.pinhole.fy, code.model.pinhole.fy);
    EXPECT_EQ(file.model.pinhole.cx, code.model.pinhole.cx);
    EXPECT_EQ(file.model.pinhole.cy, code.model.pinhole.cy);
    EXPECT_EQ(file.model.distortion, code.model.distortion);
    EXPECT_EQ(file.model.coefficients, code.model.coefficients);
    EXPECT_LT((file.bMc.R - code.bMc.R).norm() + (file.bMc.t - code.bMc.t).norm(), 1e-12);
  }
}

TEST(ArDroneCamera, IsScaledToImagesOfItsShapeAndRefusedForOthers)
{
  const auto half = publishedArDroneCamera(2, 320, 180);
  EXPECT_NEAR(half.model.pinhole.fx, 284.95, 1e-9);
  EXPECT_EQ(half.model.pinhole.width, 320);
  EXPECT_THROW(publishedArDroneCamera(2, 640, 480), vpException);
}
