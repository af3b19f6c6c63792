// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/navdata_odometry.h"
#include "emulator/wire_format.h"

#include "files.h"

#include <gtest/gtest.h>

using namespace bole;

namespace
{
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
} // namespace

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
