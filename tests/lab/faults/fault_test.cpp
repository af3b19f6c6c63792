// SPDX-License-Identifier: GPL-2.0-or-later
#include "faults/fault.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using Image = vpImage<unsigned char>;

Image ramp()
{
  Image image(8, 6);
  for (unsigned i = 0; i < image.getSize(); ++i)
    image.bitmap[i] = static_cast<unsigned char>(5 * i);
  return image;
}

Image spoilt(FaultKind kind, unsigned seed = 1)
{
  Image image = ramp();
  spoil(image, kind, Image(8, 6, 77), seed);
  return image;
}

TEST(Fault, SpoilsAnImageAsItsNameSays)
{
  EXPECT_TRUE(spoilt(FaultKind::none) == ramp());
  EXPECT_EQ(spoilt(FaultKind::black).getMaxValue(), 0);
  EXPECT_TRUE(spoilt(FaultKind::freeze) == Image(8, 6, 77));
  EXPECT_FALSE(spoilt(FaultKind::noise, 1) == spoilt(FaultKind::noise, 2));
  EXPECT_TRUE(spoilt(FaultKind::noise, 1) == spoilt(FaultKind::noise, 1));
  EXPECT_EQ(spoilt(FaultKind::wrong_size).getWidth(), 3u);
  EXPECT_EQ(spoilt(FaultKind::wrong_size)[1][2], ramp()[2][4]);
  const Image smear = spoilt(FaultKind::smear), seen = ramp();
  EXPECT_TRUE(std::equal(smear[0], smear[4], seen[0]));
  for (const unsigned row : {4u, 7u})
    EXPECT_TRUE(std::equal(smear[row], smear[row] + 6, seen[3]));
}

TEST(Fault, IsKnownByItsWordAndNoOther)
{
  for (const FaultKind kind : {FaultKind::black, FaultKind::freeze, FaultKind::odometry_jump, FaultKind::gyro_bias})
    EXPECT_EQ(faultFromString(toString(kind)), kind);
  EXPECT_THROW(faultFromString("blue"), vpException);
}
} // namespace
