// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Faults of a camera, its link and the other sensors, put into frames on purpose: the one injector of the laboratory.

#include <bole/frame.h>

#include <random>
#include <string>

namespace bole
{
enum class FaultKind
{
  none,
  black,           ///< every pixel 0
  noise,           ///< every pixel a random grey
  smear,           ///< the last row of the upper half again and again, as a decoder shows that lost its data half-way
  freeze,          ///< the last good image again
  wrong_size,      ///< half as wide and half as high
  odometry_freeze, ///< the last good pose again
  odometry_jump,   ///< a metre to the left, and from then on
  odometry_gone,
  gyro_gone,
  gyro_bias ///< 0.2 rad/s about the vertical
};
const char *toString(FaultKind kind);

/// Spoils \p image where \p kind is one of the camera; \p last_good is shown by `freeze`, \p seed makes the noise.
void spoil(vpImage<unsigned char> &image, FaultKind kind, const vpImage<unsigned char> &last_good, unsigned seed);

/// A fault during a servo trial: which, when and for how long.
struct FaultOptions
{
  FaultKind kind = FaultKind::none;
  double start_s = 5;    ///< after the task began to servo, 0 to 3600
  double duration_s = 3; ///< 0.05 to 3600

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// Spoils what a frame holds and nothing else: no stage is told.
class FaultInjector
{
public:
  explicit FaultInjector(const FaultOptions &options, unsigned seed = 1);
  /// \param servoing_s time since the task began to servo, negative before. Whether \p frame was spoilt.
  bool apply(Frame &frame, double servoing_s);

private:
  FaultOptions m_options;
  std::mt19937 m_random;
  std::optional<Pose> m_last_odometry;
  vpImage<unsigned char> m_last;
};
} // namespace bole
