// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A fault of the camera or of a sensor during a servo trial: which, when and for how long.

#include "lab/faults/image_fault.h"
#include "lab/simulation/random.h"
#include <bole/frame.h>

namespace bole
{
enum class SensorFault
{
  none,
  odometry_freeze, ///< the last good pose again
  odometry_jump,   ///< a metre to the left, and from then on
  odometry_gone,
  gyro_gone,
  gyro_bias ///< 0.2 rad/s about the vertical
};
const char *toString(SensorFault fault);

struct FaultOptions
{
  FaultKind kind = FaultKind::none; ///< of the camera
  SensorFault sensor = SensorFault::none;
  double start_s = 5;    ///< after the task began to servo, 0 to 3600
  double duration_s = 3; ///< 0.05 to 3600

  void validate() const; ///< \throw vpException naming the option, its value and the range
};

/// The fault that \p word names: one of the camera or of a sensor. \throw vpException for another word.
FaultOptions faultFromString(const std::string &word);

/// Spoils what a frame holds and nothing else: no stage is told.
class FaultInjector
{
public:
  explicit FaultInjector(const FaultOptions &options, std::uint64_t seed = 1);
  /// \param servoing_s time since the task began to servo, negative before. Whether \p frame was spoilt.
  bool apply(Frame &frame, double servoing_s);

private:
  void spoilSensor(Frame &frame) const;

  FaultOptions m_options;
  Random m_random;
  std::optional<Pose> m_last_odometry;
  vpImage<unsigned char> m_last;
};
} // namespace bole
