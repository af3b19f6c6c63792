// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/flight_folder.h"
#include "input/recorded_source.h"

#include "flight.h"

#include <cmath>
#include <filesystem>
#include <gtest/gtest.h>
#include <visp3/core/vpException.h>

using namespace bole;

TEST(FlightFolder, IsReadBackAsTheFlightThatWasWritten)
{
  std::string name = (std::filesystem::temp_directory_path() / "bole_flight_XXXXXX").string();
  const std::string folder = mkdtemp(name.data());
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
  std::filesystem::remove_all(folder);
}
