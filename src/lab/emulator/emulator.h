// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A drone made of sockets: serves video, navdata and the command port as an AR.Drone does, faults included.

#include "emulator/wire_format.h"
#include <bole/frame.h>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// One thing that a drone sends, in the order of sending.
struct FeedPacket
{
  enum class Kind
  {
    picture,
    navdata,
    raw_video,
    raw_navdata,
    video_connected
  } kind = Kind::navdata;
  std::int64_t sent_ns = 0;        ///< since the start of the flight
  std::int64_t stamp_ns = 0;       ///< exposure or measurement, since the start of the flight
  vpImage<unsigned char> image;    ///< picture
  Navdata navdata;                 ///< navdata: everything but state, sequence and time
  std::vector<std::uint8_t> bytes; ///< raw_*: as recorded
};

/// What the emulator flies: a sequence, or a recording.
class PacketFeed
{
public:
  virtual ~PacketFeed() = default;
  virtual bool next(FeedPacket &packet) = 0;
  virtual int generation() const = 0;     ///< 1 or 2
  virtual double frameRateHz() const = 0; ///< of the pictures
};

constexpr double kVideoDelay_s = 0.06; ///< from exposure to sending; 50 to 75 ms on the drone

struct SequenceFeedOptions
{
  int generation = 2;         ///< 1 or 2
  bool loop = false;          ///< there and back for ever: the motion stays continuous
  std::size_t max_frames = 0; ///< 0: all
};
/// Frames of \p source with navdata made from its odometry (velocity from differences, attitude, height) and gyro;
/// level and still where it has none. Read into memory, since a loop flies it backwards too; what does not fit into 2
/// GB is refused.
std::unique_ptr<PacketFeed> makeSequenceFeed(FrameSource &source, const SequenceFeedOptions &options);
/// The raw bytes of a recording (see recording.h).
std::unique_ptr<PacketFeed> makeRecordingFeed(const std::string &folder);

/// Serves a feed on loopback.
///
/// The flight starts with the first listener on the video port (and on the navdata port, or half a
/// second later). One thread; start() and stop() from any thread.
class ArDroneEmulator
{
public:
  struct Options
  {
    std::uint16_t navdata_port = 0, video_port = 0, at_port = 0; ///< 0: any free one
    double speed = 1;                                            ///< [1, 20]: flight seconds a second
    double bit_rate = 1.3e6; ///< [bit/s], [1e4, 1e8]: of a captured stream of an AR.Drone 2; its most is 4e6
    int key_interval = 15;   ///< frames, [1, 300]; 15 on the drone
    // Faults.
    double loss = 0;         ///< share of datagrams and TCP frames that are not sent, [0, 1)
    double jitter_s = 0;     ///< [s], [0, 1]: random extra delay of each packet; datagrams overtake
    double corrupt = 0;      ///< share of packets with one to four bytes changed, [0, 1)
    double reboot_at_s = -1; ///< flight time of a reboot: silence, then clocks and numbers from zero; < 0: none
    double reboot_for_s = 1; ///< [s] of silence
    double freeze_at_s = -1; ///< flight time from which the camera sends the same picture; < 0: never
    double freeze_for_s = 2; ///< [s]
    double stall_at_s = -1;  ///< flight time from which no video comes though the connection stands; < 0: never
    double stall_for_s = 2;  ///< [s]
    bool clock_wrap = false; ///< start both clocks 3 s before they wrap
    unsigned seed = 1;
    void validate() const;
  };
  struct Counters
  {
    std::size_t frames = 0, navdata = 0; ///< sent
    std::size_t lost = 0, corrupted_frames = 0, corrupted_navdata = 0, frozen = 0, stalled = 0,
                reboots = 0;         ///< injected
    std::size_t refused = 0;         ///< frames dropped since the client did not read
    std::size_t out_of_sequence = 0; ///< commands refused for their number
    double flight_s = 0;
    std::int64_t started_ns = -1; ///< host's steady clock at flight time zero; -1 before
  };

  ArDroneEmulator(std::unique_ptr<PacketFeed> feed, const Options &options);
  ~ArDroneEmulator();
  void start();
  void stop();
  /// Waits for the end of the flight at most \p timeout_s; true at the end.
  bool wait(double timeout_s);

  /// With the ports that were found: `ardrone://127.0.0.1?navdata=...`.
  std::string address() const;
  Counters counters() const;
  /// The commands received, oldest first (the first 100,000), and how many by name.
  std::vector<AtCommand> commands() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
