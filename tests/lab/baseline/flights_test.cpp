// SPDX-License-Identifier: GPL-2.0-or-later
// The flights of the comparison, and what our tracker must reach on their beginnings.
#include "baseline/comparison.h"
#include <bole/cylinder.h>
#include <bole/vpMbTrunkTracker.h>

#include <gtest/gtest.h>

#include <filesystem>
#include <unistd.h>

namespace
{
using namespace bole;
namespace fs = std::filesystem;
const std::string kCao = testing::TempDir() + "flights_" + std::to_string(::getpid()) + ".cao";

TEST(Flights, WithThePriorOursIsNeverLostInTheRenderedForests)
{
  const fs::path rendered = fs::path(BOLE_SHARED_DATA_DIR) / "rendered";
  if (!fs::exists(rendered))
    GTEST_SKIP() << rendered << " is absent";
  for (const char *name : {"park-forward", "winter-weave", "pine-arc"}) {
    const TestFlight flight = readAslFlight((rendered / name).string());
    ASSERT_EQ(flight.frames.size(), 120u);
    writeCao(kCao, flight.trunksWithin(25));
    EdgeSettings settings;
    settings.far_m = 25;
    std::vector<Contender> ours;
    ours.emplace_back(TrackerKind::trunk, Help::prior, settings);
    ours.emplace_back(TrackerKind::trunk, Help::alone, settings);
    const std::vector<Score> scores = compare(flight, kCao, ours, flight.limits);
    EXPECT_EQ(scores[0].until_loss, 119) << name;
    EXPECT_EQ(scores[0].silent_failures, 0) << name;
    EXPECT_LT(scores[0].position_rmse_m, 0.1) << name;
    EXPECT_LE(scores[1].silent_failures, 6) << name; // alone it may lose the flight, but says so
  }
  fs::remove(kCao);
}

TEST(Flights, TheCubeIsAReferenceForTheCylinderBesideIt)
{
  const fs::path mbt = fs::path(BOLE_VISP_IMAGES_DIR) / "mbt";
  if (!fs::exists(mbt / "cube"))
    GTEST_SKIP() << mbt << " is absent: package visp-images-data";
  const TestFlight flight = readCubeFlight(mbt.string(), 25);
  ASSERT_EQ(flight.frames.size(), 25u);
  EXPECT_FALSE(flight.upright);
  writeCao(kCao, flight.trunks);
  std::vector<Contender> ours;
  ours.emplace_back(TrackerKind::trunk, Help::prior, EdgeSettings(), BOLE_SOURCE_DIR "/models/cylinder.xml");
  const Score score = compare(flight, kCao, ours, flight.limits)[0];
  EXPECT_EQ(score.until_loss, 24);
  EXPECT_LT(score.position_rmse_m, 0.03);
  fs::remove(kCao);
}

TEST(Flights, AFolderWithoutAFlightIsRefused)
{
  EXPECT_THROW(readAslFlight("/nowhere"), vpException);
  EXPECT_THROW(readCubeFlight("/nowhere"), vpException);
}
} // namespace
