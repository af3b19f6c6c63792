// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Navigation data of the AR.Drone 1 and 2: one datagram in, named numbers out.

#include <Eigen/Core>

#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <vector>

namespace bole
{
/// Bits of the drone's state word that anyone asks for.
enum class DroneState : std::uint32_t
{
  flying = 1u << 0,
  demo_mode = 1u << 10,
  bootstrap = 1u << 11,
  communication_lost = 1u << 13,
  low_battery = 1u << 15,
  command_watchdog = 1u << 30, ///< no command came for 2 s: answer with AT*COMWDG
  emergency = 1u << 31
};

/// One packet, in the drone's units and axes (x forward, y right, z down) as it came.
struct Navdata
{
  std::uint32_t state = 0;
  std::uint32_t sequence = 0;
  bool vision_defined = false;

  struct Demo // option 0
  {
    std::uint32_t control_state = 0; ///< upper 16 bits: 2 landed, 3 flying, 4 hovering, 6 taking off, 8 landing
    std::uint32_t battery_percent = 0;
    Eigen::Vector3f phi_theta_psi_mdeg = Eigen::Vector3f::Zero(); ///< roll, pitch, yaw [milli-degree]
    std::int32_t altitude_mm = 0;                                 ///< over the ground [mm]
    Eigen::Vector3f velocity_mm_s = Eigen::Vector3f::Zero();      ///< [mm/s], drone's axes
  };
  std::optional<Demo> demo;
  std::optional<std::uint32_t> time; ///< option 1: upper 11 bits [s], lower 21 bits [us]: wraps after 2048 s
  struct Physical                    // option 3
  {
    Eigen::Vector3f acceleration_mg = Eigen::Vector3f::Zero(); ///< [mg], drone's axes
    Eigen::Vector3f rate_deg_s = Eigen::Vector3f::Zero();      ///< [deg/s], drone's axes
  };
  std::optional<Physical> physical;

  /// The bytes of every option behind its id and size, by id.
  std::map<std::uint16_t, std::vector<std::uint8_t>> options;

  bool has(DroneState bit) const { return (state & static_cast<std::uint32_t>(bit)) != 0; }
  std::uint32_t flightPhase() const { return demo ? demo->control_state >> 16 : 0; }
};

enum class NavdataError
{
  none,
  too_short,
  header,
  option_size,
  no_checksum,
  checksum
};
const char *toString(NavdataError error);

/// Reads one datagram. Only packets with a right checksum get through.
/// Laws (each a test): parse(encode(n)) == n; any single changed byte is an error; any input terminates.
NavdataError parseNavdata(const std::uint8_t *data, std::size_t size, Navdata &navdata);

/// The datagram of \p navdata: its typed options 0, 1 and 3 where they are set (with zeros for what
/// the struct leaves out), the others as bytes, and the checksum. For the emulator and the tests.
std::vector<std::uint8_t> encodeNavdata(const Navdata &navdata);
} // namespace bole
