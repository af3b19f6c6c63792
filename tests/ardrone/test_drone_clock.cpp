// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "ardrone/drone_clock.h"
#include "emulator/wire_format.h"

using namespace bole;

TEST(ClockUnwrapper, CountsOnWhereTheCounterWraps)
{
  ClockUnwrapper clock(kPaveTimePeriod_ms);
  const std::int64_t start = 4294967290;
  EXPECT_EQ(clock.unwrap(start), start);
  EXPECT_EQ(clock.unwrap(4), start + 10);
  EXPECT_EQ(clock.unwrap(4294967295), start + 5); // out of order across the wrap
  EXPECT_EQ(clock.unwrap(100), start + 106);
}

TEST(ClockUnwrapper, KeepsNavdataTimeGoingForThreeHours)
{
  ClockUnwrapper clock(kNavdataTimePeriod_us);
  std::int64_t first = 0;
  for (std::int64_t time_us = 0; time_us < 3LL * 3600 * 1'000'000; time_us += 777'777) {
    const std::int64_t seen = clock.unwrap(navdataTimeMicroseconds(navdataTimeWord(2'000'000'000 + time_us)));
    if (time_us == 0)
      first = seen;
    ASSERT_EQ(seen - first, time_us);
  }
}

TEST(ClockFit, FindsTheOffsetUnderJitterAndDrift)
{
  std::mt19937 random(3);
  std::exponential_distribution<double> delay(1 / 0.01);
  for (const double drift : {-50e-6, 0.0, 50e-6}) {
    ClockFit fit;
    double largest = 0;
    for (int i = 0; i < 20000; ++i) {
      const double host = i * 0.005;
      const auto drone_ns = static_cast<std::int64_t>(1e9 * (host * (1 + drift) - 123));
      fit.add(drone_ns, static_cast<std::int64_t>(1e9 * (host + 0.002 + delay(random))));
      if (i > 2000)
        largest = std::max(largest, std::abs(static_cast<double>(fit.toHost(drone_ns)) * 1e-9 - host - 0.002));
    }
    EXPECT_LT(largest, 0.002) << "drift " << drift;
  }
}

TEST(ClockFit, StartsAnewAfterAReboot)
{
  ClockFit fit;
  EXPECT_TRUE(fit.add(1'000'000'000'000, 5'000'000'000));
  EXPECT_FALSE(fit.add(0, 6'000'000'000));
  EXPECT_EQ(fit.toHost(1'000'000), 6'001'000'000);
  EXPECT_EQ(fit.toDrone(6'001'000'000), 1'000'000);
}

TEST(ClockFit, IsNotReadyBeforeAFastPacketMayHaveCome)
{
  ClockFit fit;                           // 0.3 s
  fit.add(0, 1'000'000'000 + 90'000'000); // the first packet was slow
  EXPECT_FALSE(fit.isReady());
  fit.add(100'000'000, 1'100'000'000 + 1'000'000);
  EXPECT_FALSE(fit.isReady());
  fit.add(400'000'000, 1'400'000'000 + 30'000'000);
  EXPECT_TRUE(fit.isReady());
  EXPECT_NEAR(static_cast<double>(fit.toHost(400'000'000)), 1.401e9, 1e5);
}

TEST(VideoStamps, AClockThatJumpsBackByASecondGoesOnFromWhereItWas)
{
  VideoStamps stamps;
  std::int64_t arrival_ns = 0, last_ns = 0;
  int unmeasured = 0;
  for (int k = 0; k < 60; ++k, arrival_ns += 50'000'000) {
    const auto stamp = stamps.next(static_cast<std::uint32_t>(10'000 + 50 * k - (k >= 30 ? 1000 : 0)), arrival_ns);
    if (k > 0) {
      EXPECT_NEAR(static_cast<double>(stamp.ns - last_ns), 50e6, 1e6) << k;
    }
    unmeasured += stamp.is_measured ? 0 : 1;
    last_ns = stamp.ns;
  }
  EXPECT_EQ(unmeasured, 1);
  EXPECT_EQ(stamps.jumps(), 1u);
}

TEST(ClockRate, TellsAClockThatRunsTwiceAsFast)
{
  ClockRate rate;
  for (int k = 0; k < 100; ++k) {
    rate.add(std::int64_t{2} * k * 40'000'000, std::int64_t{k} * 40'000'000 + (k % 7) * 10'000'000);
    if (k < 70 || k > 80) {
      EXPECT_EQ(rate.rate().has_value(), k > 80) << k;
    }
  }
  EXPECT_NEAR(*rate.rate(), 2, 0.1);
}
