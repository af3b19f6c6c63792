// SPDX-License-Identifier: GPL-2.0-or-later
#include "files.h"
#include "support/test.h"

#include "ardrone/drone_link.h"
#include "ardrone/navdata_odometry.h"
#include "emulator/wire_format.h"
#include "geometry/so3.h"

using namespace bole;

namespace
{
constexpr float kQuarter_mdeg = 90'000;

/// A packet with the drone's own axes and units: angles [mdeg], velocity [mm/s], rates [deg/s].
Navdata packet(Eigen::Vector3f roll_pitch_yaw_mdeg, Eigen::Vector3f velocity_mm_s, int altitude_mm = 1000,
               Eigen::Vector3f rate_deg_s = {0, 0, 0})
{
  Navdata navdata;
  navdata.demo = Navdata::Demo{3u << 16, 80, roll_pitch_yaw_mdeg, altitude_mm, velocity_mm_s};
  navdata.physical = Navdata::Physical{{0, 0, -1000}, rate_deg_s};
  return navdata;
}

Navdata example()
{
  Navdata navdata;
  navdata.state = 0x4f8000d1;
  navdata.sequence = 77;
  navdata.vision_defined = true;
  navdata.demo = Navdata::Demo{3u << 16, 61, {1000, -2000, 90000}, 1234, {100, -200, 30}};
  navdata.time = 362u << 21 | 979125u;
  navdata.physical = Navdata::Physical{{10, 20, -980}, {1.5f, -2.5f, 3.5f}};
  navdata.options[26] = {1, 2, 3, 4};
  return navdata;
}

std::int64_t seconds(double s) { return static_cast<std::int64_t>(std::llround(s * 1e9)); }
} // namespace

TEST(NavdataOdometry, TurningTheDroneAboutEachAxisTurnsTheBodyTheRightWay)
{
  const double angle = 0.3;
  const Eigen::Vector3d left = Eigen::Vector3d::UnitY(), ahead = Eigen::Vector3d::UnitX();
  // Roll: positive is right side down, so the left side points up.
  EXPECT_NEAR((attitudeFromDrone(angle, 0, 0) * left).z(), std::sin(angle), 1e-12);
  // Pitch: positive is nose up.
  EXPECT_NEAR((attitudeFromDrone(0, angle, 0) * ahead).z(), std::sin(angle), 1e-12);
  // Yaw: positive is clockwise seen from above, towards the right, which is -y.
  EXPECT_NEAR((attitudeFromDrone(0, 0, angle) * ahead).y(), -std::sin(angle), 1e-12);
}

TEST(NavdataOdometry, AttitudeComesBackFromItsAngles)
{
  for (const Eigen::Vector3d &angles : {Eigen::Vector3d(0.1, -0.4, 2.9), Eigen::Vector3d(-1.2, 0.7, -3.0)}) {
    const Eigen::Matrix3d wRb = attitudeFromDrone(angles.x(), angles.y(), angles.z());
    const Eigen::Vector3d back(std::atan2(wRb(2, 1), wRb(2, 2)), std::asin(wRb(2, 0)),
                               -std::atan2(wRb(1, 0), wRb(0, 0)));
    EXPECT_LT((back - angles).norm(), 1e-12);
  }
}

TEST(NavdataOdometry, GyroAndAttitudeAgreeAboutEachAxis)
{
  for (int axis = 0; axis < 3; ++axis) {
    NavdataOdometry odometry;
    for (int i = 0; i <= 100; ++i) { // 10 deg/s about one of the drone's axes
      Eigen::Vector3f angles = Eigen::Vector3f::Zero(), rate = Eigen::Vector3f::Zero();
      angles[axis] = static_cast<float>(i) * 50;
      rate[axis] = 10;
      odometry.add(seconds(i * 0.005), packet(angles, {0, 0, 0}, 1000, rate));
    }
    Eigen::Matrix3d turned = odometry.at(0)->wMb.R;
    for (const GyroSample &sample : odometry.gyro(0, seconds(0.5)))
      turned = turned * expSo3(sample.rate * 0.005);
    EXPECT_LT(logSo3(turned.transpose() * odometry.newest()->wMb.R).norm(), 1e-5) << "axis " << axis;
    EXPECT_NEAR(logSo3(odometry.newest()->wMb.R).norm(), 5 * M_PI / 180, 1e-5);
  }
}

TEST(NavdataOdometry, ADroneAtRestFeelsItsWeightUpwards)
{
  NavdataOdometry odometry;
  odometry.add(seconds(0.1), packet({0, 0, 0}, {0, 0, 0}));
  const std::vector<GyroSample> samples = odometry.gyro(0, seconds(1));
  ASSERT_EQ(samples.size(), 1u);
  ASSERT_TRUE(samples[0].force);
  EXPECT_LT((*samples[0].force - Eigen::Vector3d(0, 0, 9.81)).norm(), 1e-6);
}

TEST(NavdataOdometry, AheadAfterATurnToTheRightAndASlipToTheRightAreNegativeY)
{
  for (const auto &[yaw_mdeg, velocity_mm_s, y] :
       {std::tuple{kQuarter_mdeg, Eigen::Vector3f(2000, 0, 0), -2.0}, {0.f, Eigen::Vector3f(0, 1000, 0), -1.0}}) {
    NavdataOdometry odometry;
    for (int i = 0; i <= 200; ++i)
      odometry.add(seconds(i * 0.005), packet({0, 0, yaw_mdeg}, velocity_mm_s));
    EXPECT_LT((odometry.newest()->wMb.t - Eigen::Vector3d(0, y, 1)).norm(), 1e-6);
  }
}

TEST(NavdataOdometry, ACircleFlownInBurstsClosesInDroneTime)
{
  // One turn to the left in 10 s at 1 m/s; three packets of five are lost. Host time has no part in it.
  NavdataOdometry odometry;
  for (int i = 0; i <= 2000; ++i)
    if (i % 5 < 2 || i == 2000)
      odometry.add(seconds(i * 0.005), packet({0, 0, -static_cast<float>(i) * 180}, {1000, 0, 0}));
  EXPECT_LT((odometry.newest()->wMb.t - Eigen::Vector3d(0, 0, 1)).norm(), 2e-3);
  const auto half = odometry.at(seconds(5));
  ASSERT_TRUE(half);
  EXPECT_NEAR(half->wMb.t.y(), 10 / M_PI, 2e-3); // the far side of the circle, on the left
}

TEST(NavdataOdometry, HeightFollowsTheSonarButNotAStepInTheGround)
{
  NavdataOdometry odometry;
  for (int i = 0; i <= 400; ++i) { // climbs at 0.5 m/s; a bush of 0.4 m passes below
    const bool bush = i >= 100 && i < 200;
    odometry.add(seconds(i * 0.005),
                 packet({0, 0, 0}, {500, 0, -500}, 1000 + static_cast<int>(i * 2.5) - (bush ? 400 : 0)));
  }
  for (const double t : {0.25, 0.75, 1.5, 2.0}) {
    const auto state = odometry.at(seconds(t));
    ASSERT_TRUE(state);
    EXPECT_NEAR(state->wMb.t.z(), 1 + 0.5 * t, 0.01) << t;
  }
}

TEST(NavdataOdometry, InterpolatesBetweenPacketsAndRefusesGaps)
{
  NavdataOdometry odometry;
  odometry.add(seconds(1), packet({0, 0, 0}, {1000, 0, 0}));
  odometry.add(seconds(1.1), packet({0, 0, 10'000}, {1000, 0, 0}));
  odometry.add(seconds(3), packet({0, 0, 10'000}, {1000, 0, 0}));
  const auto middle = odometry.at(seconds(1.05));
  ASSERT_TRUE(middle);
  EXPECT_NEAR(logSo3(middle->wMb.R).z(), -5 * M_PI / 180, 1e-6);
  EXPECT_FALSE(odometry.at(seconds(0.9)));
  EXPECT_FALSE(odometry.at(seconds(2)));   // a gap of 1.9 s
  EXPECT_TRUE(odometry.at(seconds(3.05))); // a little ahead
  EXPECT_FALSE(odometry.at(seconds(3.5)));
}

TEST(NavdataOdometry, GoesOnWhereItWasAfterAReboot)
{
  NavdataOdometry odometry;
  for (int i = 0; i <= 100; ++i)
    odometry.add(seconds(100 + i * 0.01), packet({0, 0, 30'000}, {1000, 0, 0}));
  const Pose before = odometry.newest()->wMb;
  odometry.restart();
  odometry.add(seconds(0.01), packet({0, 0, -70'000}, {0, 0, 0}));
  const Pose after = odometry.newest()->wMb;
  EXPECT_LT((after.t - before.t).norm(), 1e-9);
  EXPECT_LT(logSo3(after.R.transpose() * before.R).norm(), 1e-6);
}

TEST(NavdataOdometry, ReadsTheSignsOfARealFlight)
{
  // AR.Drone 1, a step of the forward command: nose down (negative pitch) makes the drone fly forward.
  const std::string folder = std::string(BOLE_SHARED_DATA_DIR) + "/ardrone/ardrone1_telemetry/8sStepHalfMagNH1/";
  std::FILE *pitch_file = std::fopen((folder + "theta_dump.dat").c_str(), "r");
  std::FILE *speed_file = std::fopen((folder + "vx_dump.dat").c_str(), "r");
  if (pitch_file == nullptr || speed_file == nullptr)
    GTEST_SKIP() << "the recorded flight is not here";
  NavdataOdometry odometry;
  double stamp = 0, pitch_mdeg = 0, ignored = 0, speed_mm_s = 0, first = 0, travelled = 0, last = 0;
  double lowest_nose = 0;
  while (std::fscanf(pitch_file, "%lf %lf", &stamp, &pitch_mdeg) == 2 &&
         std::fscanf(speed_file, "%lf %lf", &ignored, &speed_mm_s) == 2) {
    if (first == 0)
      first = last = stamp;
    travelled += speed_mm_s * 1e-3 * (stamp - last);
    last = stamp;
    odometry.add(seconds(stamp - first + 1),
                 packet({0, static_cast<float>(pitch_mdeg), 0}, {static_cast<float>(speed_mm_s), 0, 0}));
    lowest_nose = std::min(lowest_nose, (odometry.newest()->wMb.R * Eigen::Vector3d::UnitX()).z());
  }
  std::fclose(pitch_file);
  std::fclose(speed_file);
  EXPECT_LT(lowest_nose, -0.15); // 10 degrees nose down
  EXPECT_GT(travelled, 4);
  EXPECT_NEAR(odometry.newest()->wMb.t.x(), travelled, 0.1 * travelled);
}

TEST(Navdata, ReadsEveryOptionOfAPacketThatADroneSent)
{
  const auto bytes = test::captured("navdata.bin");
  if (bytes.empty())
    GTEST_SKIP() << "the captured packet is not here";
  Navdata navdata;
  ASSERT_TRUE(parseNavdata(bytes.data(), bytes.size(), navdata));
  EXPECT_EQ(navdata.sequence, 300711u);
  EXPECT_EQ(navdata.state, 0x4f8000d0u);
  EXPECT_TRUE(navdata.has(DroneState::command_watchdog));
  EXPECT_FALSE(navdata.has(DroneState::flying));
  EXPECT_FALSE(navdata.has(DroneState::emergency));
  ASSERT_EQ(navdata.options.size(), 28u);
  ASSERT_TRUE(navdata.demo);
  EXPECT_EQ(navdata.flightPhase(), 2u); // landed
  EXPECT_EQ(navdata.demo->battery_percent, 50u);
  EXPECT_FLOAT_EQ(navdata.demo->phi_theta_psi_mdeg.x(), 550);
  EXPECT_FLOAT_EQ(navdata.demo->phi_theta_psi_mdeg.y(), 2974);
  EXPECT_FLOAT_EQ(navdata.demo->phi_theta_psi_mdeg.z(), 1933);
  EXPECT_FLOAT_EQ(navdata.demo->velocity_mm_s.y(), -0.8817979f);
  EXPECT_EQ(navdata.time, 362u << 21 | 979125u);
  ASSERT_TRUE(navdata.physical);
  EXPECT_FLOAT_EQ(navdata.physical->acceleration_mg.z(), -942.52832f);
}

TEST(Navdata, LeavesOutWhatNoDroneCanDo)
{
  const auto readBack = [](const Navdata &sent) {
    const auto bytes = encodeNavdata(sent);
    Navdata read;
    EXPECT_TRUE(parseNavdata(bytes.data(), bytes.size(), read));
    return read;
  };
  Navdata sent = example();
  sent.demo->velocity_mm_s.x() = 1e30f;
  EXPECT_FALSE(readBack(sent).demo);
  EXPECT_TRUE(readBack(sent).physical);
  sent = example();
  sent.demo->altitude_mm = 2'000'000'000;
  EXPECT_FALSE(readBack(sent).demo);
  sent = example();
  sent.physical->rate_deg_s.z() = -1e9f;
  EXPECT_FALSE(readBack(sent).physical);
  EXPECT_TRUE(readBack(sent).demo);
}

TEST(Navdata, ReadsBackWhatItEncodes)
{
  const Navdata sent = example();
  const auto bytes = encodeNavdata(sent);
  Navdata read;
  ASSERT_TRUE(parseNavdata(bytes.data(), bytes.size(), read));
  EXPECT_EQ(read.state, sent.state);
  EXPECT_EQ(read.sequence, sent.sequence);
  EXPECT_TRUE(read.vision_defined);
  ASSERT_TRUE(read.demo && read.physical);
  EXPECT_EQ(read.demo->phi_theta_psi_mdeg, sent.demo->phi_theta_psi_mdeg);
  EXPECT_EQ(read.demo->altitude_mm, sent.demo->altitude_mm);
  EXPECT_EQ(read.demo->velocity_mm_s, sent.demo->velocity_mm_s);
  EXPECT_EQ(read.time, sent.time);
  EXPECT_EQ(read.physical->rate_deg_s, sent.physical->rate_deg_s);
  EXPECT_EQ(read.options.at(26), sent.options.at(26));
}

TEST(Navdata, RefusesAPacketWithAnyByteChanged)
{
  const auto good = encodeNavdata(example());
  Navdata navdata;
  for (std::size_t at = 0; at < good.size(); ++at)
    for (const int change : {1, 0x40}) {
      auto bytes = good;
      bytes[at] = static_cast<std::uint8_t>(bytes[at] + change);
      EXPECT_FALSE(parseNavdata(bytes.data(), bytes.size(), navdata)) << "byte " << at;
    }
  for (std::size_t size = 0; size < good.size(); ++size)
    EXPECT_FALSE(parseNavdata(good.data(), size, navdata)) << "cut at " << size;
}

TEST(AtCommand, WritesFloatsAsTheDeveloperGuideDoes)
{
  EXPECT_EQ(atFloat(-0.8f), "-1085485875");
  EXPECT_EQ(atFloat(0), "0");
  EXPECT_EQ(atFloat(0.75f), "1061158912");
}

TEST(AtCommand, ReadsSeveralCommandsOfADatagram)
{
  const auto commands = parseAtCommands("AT*PCMD=21625,1,0,0,0,0\rAT*REF=21626,290717696\rrubbish\rAT*CONFIG=3,"
                                        "\"general:navdata_demo\",\"FALSE\"\r");
  ASSERT_EQ(commands.size(), 3u);
  EXPECT_EQ(commands[0].name, "PCMD");
  EXPECT_EQ(commands[0].sequence, 21625);
  EXPECT_EQ(commands[0].arguments.size(), 5u);
  EXPECT_EQ(commands[1].arguments[0], "290717696");
  EXPECT_EQ(commands[2].arguments[0], "general:navdata_demo");
  EXPECT_EQ(commands[2].arguments[1], "FALSE");
}

TEST(ArDroneAddress, ReadsHostPortsAndOptions)
{
  const auto plain = ArDroneAddress::parse("ardrone://");
  EXPECT_EQ(plain.host, "192.168.1.1");
  EXPECT_EQ(plain.video_port, 5555);
  const auto address =
      ArDroneAddress::parse("ardrone://127.0.0.1?offset=10000&at=7000&generation=1&camera=a/b.yaml&video_delay_ms=10");
  EXPECT_EQ(address.host, "127.0.0.1");
  EXPECT_EQ(address.navdata_port, 15554);
  EXPECT_EQ(address.video_port, 15555);
  EXPECT_EQ(address.at_port, 17000);
  EXPECT_EQ(address.generation, 1);
  EXPECT_EQ(address.camera_path, "a/b.yaml");
  EXPECT_DOUBLE_EQ(address.video_delay_s, 0.01);
  const auto again = ArDroneAddress::parse(address.toString());
  EXPECT_EQ(again.at_port, 17000);
  EXPECT_EQ(again.camera_path, "a/b.yaml");
}

TEST(ArDroneAddress, SaysWhatIsWrong)
{
  for (const char *wrong :
       {"ardrone://host:5555", "ardrone://h?video=70000", "ardrone://h?offset=x", "ardrone://h?generation=3",
        "ardrone://h?color=red", "tcp://h", "ardrone://h?video=60000&offset=59000"}) {
    EXPECT_REFUSED("must", ArDroneAddress::parse(wrong)) << wrong;
  }
}
