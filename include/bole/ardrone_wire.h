// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What an AR.Drone 1 or 2 says on the wire, as plain data: for programs that stand in for a drone, or read what one
/// has sent.

#include <bole/vpArDroneGrabber.h>

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

/// One packet of navigation data, in the drone's units and axes (x forward, y right, z down) as it came.
struct Navdata
{
  std::uint32_t state = 0;     ///< bits of DroneState and more
  std::uint32_t sequence = 0;  ///< of the packet
  bool vision_defined = false; ///< as the header says

  struct Demo ///< option 0
  {
    std::uint32_t control_state = 0;   ///< upper 16 bits: 2 landed, 3 flying, 4 hovering, 6 taking off, 8 landing
    std::uint32_t battery_percent = 0; ///< [%]
    Eigen::Vector3f phi_theta_psi_mdeg = Eigen::Vector3f::Zero(); ///< roll, pitch, yaw [milli-degree]
    std::int32_t altitude_mm = 0;                                 ///< over the ground [mm]
    Eigen::Vector3f velocity_mm_s = Eigen::Vector3f::Zero();      ///< [mm/s], drone's axes
  };
  std::optional<Demo> demo;          ///< option 0
  std::optional<std::uint32_t> time; ///< option 1: upper 11 bits [s], lower 21 bits [us]: wraps after 2048 s
  struct Physical                    ///< option 3
  {
    Eigen::Vector3f acceleration_mg = Eigen::Vector3f::Zero(); ///< [mg], drone's axes
    Eigen::Vector3f rate_deg_s = Eigen::Vector3f::Zero();      ///< [deg/s], drone's axes
  };
  std::optional<Physical> physical; ///< option 3

  /// The bytes of every option behind its id and size, by id.
  std::map<std::uint16_t, std::vector<std::uint8_t>> options;

  /// Whether a bit of the state is set.
  bool has(DroneState bit) const { return (state & static_cast<std::uint32_t>(bit)) != 0; }
  /// Upper half of Demo::control_state.
  std::uint32_t flightPhase() const { return demo ? demo->control_state >> 16 : 0; }
};

constexpr std::int64_t kNavdataTimePeriod_us = 2048LL * 1'000'000; ///< after which Navdata::time wraps
constexpr std::int64_t kPaveTimePeriod_ms = std::int64_t{1} << 32; ///< after which PaveHeader::timestamp_ms wraps

/// Kinds of video frames of the AR.Drone 2.
enum class PaveFrameType : std::uint8_t
{
  unknown = 0,
  idr = 1,
  i = 2,
  p = 3,
  headers = 4
};

/// The fields of PaVE, the envelope of the AR.Drone 2's video, that anyone reads. All little-endian on the wire; the
/// header is 64 or 68 bytes long by firmware and says so itself.
struct PaveHeader
{
  std::uint8_t version = 2;                          ///< of the envelope
  std::uint8_t codec = 4;                            ///< 4 = H.264
  std::uint16_t header_size = 64;                    ///< [byte]
  std::uint32_t payload_size = 0;                    ///< [byte]
  std::uint16_t coded_width = 0;                     ///< [px], a multiple of 16
  std::uint16_t coded_height = 0;                    ///< [px], a multiple of 16
  std::uint16_t display_width = 0;                   ///< [px]
  std::uint16_t display_height = 0;                  ///< [px]
  std::uint32_t frame_number = 0;                    ///< rising by one
  std::uint32_t timestamp_ms = 0;                    ///< drone's clock, wraps after 49.7 days
  PaveFrameType frame_type = PaveFrameType::unknown; ///< what the payload is
  std::uint32_t stream_position = 0;                 ///< payload bytes sent before this frame, low word
  std::uint16_t stream_id = 0;                       ///< of the encoder
  std::uint8_t header1_size = 0;                     ///< [byte] SPS in front of a key frame
  std::uint8_t header2_size = 0;                     ///< [byte] PPS behind it
  std::uint32_t advertised_size = 0;                 ///< [byte]

  /// True when the fields are such as a drone can send: the signature alone appears in payloads by chance.
  bool isPlausible() const;
};
} // namespace bole
