// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/drawn_bark.h"
#include "support/test.h"

#include "tracking/texture_shift.h"

namespace
{
using namespace bole;

using test::kCamera;

const ElevationRange kPart{-0.3, 0.4};
constexpr double kSearch_px = 8;

class BarkShifts : public testing::Test
{
protected:
  /// In pixels, to the left of where the newer camera would see it if it stood at m_expected.
  std::optional<double> shift_px(double beside_m = 0) const
  {
    Trunk expected = m_trunk;
    expected.xy.y() += beside_m;
    const vpImage<unsigned char> before = test::drawBark(m_before, m_trunk, m_bark),
                                 now = test::drawBark(m_now, m_trunk, m_bark);
    const auto shift = textureShift({before, m_before}, {now, m_expected}, kCamera, expected, kPart, kSearch_px);
    if (!shift)
      return std::nullopt;
    return kCamera.fx * shift->angle;
  }
  /// What the wrong place of the camera makes of it.
  double expected_px() const
  {
    const RelativeTrunk real = relativeTrunk(m_now, Pose(), m_trunk),
                        there = relativeTrunk(m_expected, Pose(), m_trunk);
    return kCamera.fx * real.minus(there)(2) / (1 - real.ratio());
  }

  Trunk m_trunk{{2.0, 0.1}, std::log(0.15)};
  test::Bark m_bark;
  Pose m_before = test::lookingAlongX(0, 0, 1.3), m_now = test::lookingAlongX(0.01, 0.05, 1.31), m_expected = m_now;
};

TEST_F(BarkShifts, TellByHowMuchAStepIsWrong)
{
  for (const double wrong_m : {-0.04, -0.013, 0.02, 0.05}) {
    m_expected = m_now;
    m_expected.t.y() += wrong_m;
    m_expected.t.z() -= 0.02; // heights are told to some centimetres
    const auto shift = shift_px();
    ASSERT_TRUE(shift) << wrong_m;
    EXPECT_GT(std::abs(expected_px()), 1);
    EXPECT_NEAR(*shift, expected_px(), 0.25) << wrong_m;
  }
}

TEST_F(BarkShifts, AreFoundWhereTheTrunkIsTakenToStandALittleBesideItsPlace)
{
  m_expected.t.y() -= 0.02;
  const auto shift = shift_px(0.02); // 2 px
  ASSERT_TRUE(shift);
  EXPECT_NEAR(*shift, expected_px(), 0.35);
}

TEST_F(BarkShifts, AreFoundByACameraThatRolls)
{
  const Eigen::Matrix3d roll = Eigen::AngleAxisd(0.12, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  m_before.R = m_before.R * roll;
  m_now.R = m_now.R * roll;
  m_expected = m_now;
  m_expected.t.y() += 0.03;
  const auto shift = shift_px();
  ASSERT_TRUE(shift);
  EXPECT_NEAR(*shift, expected_px(), 0.3);
}

TEST_F(BarkShifts, AreNotToldByBarkThatRepeatsItselfNorByATrunkOfAFewPixels)
{
  m_bark.repeats = true;
  EXPECT_FALSE(shift_px());
  m_bark.repeats = false;
  m_trunk.xy.x() = 7;
  EXPECT_FALSE(shift_px());
}

/// Half of what is looked at shows the wall, which moves otherwise.
TEST_F(BarkShifts, AreNotToldByHalfATrunkAndHalfOfWhatIsBehind)
{
  m_now = m_expected = test::lookingAlongX(0, 0.15, 1.3);
  ASSERT_TRUE(shift_px());
  EXPECT_FALSE(shift_px(0.11));
  EXPECT_FALSE(shift_px(-0.11));
}
} // namespace
