// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Navigation data of the AR.Drone 1 and 2: one datagram in, named numbers out, and where the drone says it has flown.

#include <bole/ardrone_wire.h>

#include <cstdint>
#include <deque>
#include <optional>
#include <vector>

namespace bole
{
/// Reads one datagram; false where it is no navdata, or its checksum is wrong.
/// Laws (each a test): parse(encode(n)) == n; any single changed byte is an error; any input terminates.
bool parseNavdata(const std::uint8_t *data, std::size_t size, Navdata &navdata);

/// Attitude wRb from the drone's angles roll, pitch, yaw [rad].
///
/// The drone's frames have y to the right and z down, ours y left and z up; half a turn about x, F,
/// takes one to the other, so wRb = F Rz(yaw) Ry(pitch) Rx(roll) F = Rz(-yaw) Ry(-pitch) Rx(roll).
/// Law (a test): the drone turned about one of its axes turns the right way about ours, each axis alone.
Eigen::Matrix3d attitudeFromDrone(double roll, double pitch, double yaw);
/// A vector in the drone's axes (y right, z down) in ours, and back: y and z change their signs.
inline Eigen::Vector3d flipDroneAxes(const Eigen::Vector3d &v) { return {v.x(), -v.y(), -v.z()}; }

/// Integrates navdata to poses wMb.
///
/// Idea: horizontal position by integrating the velocity (mm/s, drone's axes) turned by the attitude, by the trapezoid
/// rule in the drone's own time, since packets come in bursts; z is the height that the sonar and the drone's filter
/// report. Where the height jumps although the drone does not climb, the ground has a step (a bush, a wall): z goes on
/// with the vertical velocity and the step is kept as an offset. The world stands on the ground below the first sample,
/// z up; its x axis is where the drone's yaw is zero. After a reboot (restart()) the pose goes on where it was.
class NavdataOdometry
{
public:
  /// Adds a packet with option "demo"; others, and stamps that do not rise, are ignored.
  void add(std::int64_t stamp_ns, const Navdata &navdata);
  /// The drone's clock and yaw start anew: the next sample takes on the last pose.
  void restart();

  /// State at \p stamp_ns, interpolated; nothing before the history, beyond the extrapolation, or in a gap.
  std::optional<BodyState> at(std::int64_t stamp_ns) const;
  std::optional<BodyState> newest() const;
  /// Angular rates and specific forces in (from, to], oldest first.
  std::vector<GyroSample> gyro(std::int64_t from_ns, std::int64_t to_ns) const;

private:
  std::deque<BodyState> m_history;
  double m_ground = 0;     ///< height of the ground below in the world [m]
  double m_yaw_offset = 0; ///< ours minus the drone's, after a reboot [rad]
  std::optional<BodyState> m_before_restart;
};
} // namespace bole
