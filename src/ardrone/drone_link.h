// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The live connection to a drone: video and navdata threads, newest frame only.
#include "ardrone/drone_clock.h"
#include "ardrone/navdata_odometry.h"
#include "ardrone/socket.h"
#include "ardrone/video_decoder.h"
#include <bole/vpArDroneGrabber.h>

#include <cstdint>
#include <memory>
#include <mutex>
#include <string>

namespace bole
{
// Commands to the drone: lines of text, `AT*NAME=sequence,arguments\r`.

/// A float as the drone wants it: its 32 bits read as a signed integer, in decimals (-0.8 is -1085485875).
std::string atFloat(float value);

/// Sends commands with rising sequence numbers. Thread-safe: the drone refuses numbers that go
/// back, so a program must have one channel to a drone.
class AtChannel
{
public:
  AtChannel(const std::string &host, std::uint16_t port);

  // Housekeeping: moves nothing.
  void config(const std::string &key, const std::string &value);
  void acknowledgeConfig();
  void resetWatchdog();

  // Flight: only vpRobotArDrone calls these.
  void trimFlat();
  void reference(bool take_off, bool emergency);
  /// \param roll, pitch share of the largest tilt, in [-1, 1]: left and nose down are negative.
  /// \param gaz, yaw share of the largest climb and turn rate: up and clockwise seen from above are
  /// positive. \param progressive false hovers whatever the other arguments are.
  void move(bool progressive, float roll, float pitch, float gaz, float yaw);

private:
  void send(const std::string &name, const std::string &arguments);

  Socket m_socket;
  std::mutex m_mutex;
  std::int64_t m_sequence = 0;
};

/// Where a drone is: `ardrone://HOST[?key=value&...]`.
///
/// Its keys are told of at vpArDroneGrabber.
struct ArDroneAddress
{
  std::string host = "192.168.1.1";
  std::uint16_t navdata_port = 5554, video_port = 5555, at_port = 5556;
  int generation = 0; ///< 1, 2, or 0 to find out
  std::string camera_path;
  double video_delay_s = 0.06;

  /// Throws vpException "address: key = value, must be ...".
  static ArDroneAddress parse(const std::string &address);
  /// Whether \p text is such an address, right or wrong.
  static bool accepts(const std::string &text);
  std::string toString() const;
};

/// A frame as it came off the air.
struct LiveFrame
{
  FrameStatus status = FrameStatus::missing;
  std::string message;
  YuvPicture picture;                             ///< empty when nothing could be decoded
  std::uint32_t number = 0;                       ///< as the drone counts
  std::int64_t stamp_ns = 0;                      ///< drone's video clock, unwrapped; rises over reboots too
  std::int64_t arrival_ns = 0;                    ///< host's steady clock, last byte of the frame
  std::optional<std::int64_t> unchanged_since_ns; ///< stamp of the picture from which this hardly differs
  std::optional<BodyState> body;                  ///< navdata interpolated at the exposure, stamp as above
  std::vector<GyroSample> gyro;                   ///< since the frame given out before, stamps as above
};

/// Talks to a drone as a listener: wakes the streams, asks for full navdata, keeps the
/// communication watchdog content. Never sends a flight command.
///
/// Idea: one thread drains the video socket and decodes everything (predicted frames need their predecessors), but
/// keeps only the newest frame for the consumer: a slow consumer gets fewer frames, never old ones. A second thread
/// integrates navdata. The two streams have clocks of their own; each is fitted to the host's (ClockFit), and a frame
/// exposed video_delay_s before its fastest arrival finds its navdata that way. A picture that hardly differs from an
/// earlier one although the navdata say that the body moved on by more than 0.1 m or 0.02 rad is `stale`: the
/// camera is frozen. A link silent for 0.8 s is opened anew, every 0.1 s.
///
/// Thread-safe. Cost: H.264 640x360 about 2 ms a frame on its own thread.
class DroneLink
{
public:
  explicit DroneLink(const ArDroneAddress &address, const LinkTap &tap = {});
  ~DroneLink();
  DroneLink(const DroneLink &) = delete;
  DroneLink &operator=(const DroneLink &) = delete;

  /// The newest frame not yet given out; waits for one at most \p timeout_s. False when there is none.
  bool next(LiveFrame &frame, double timeout_s);
  /// Adds what the navdata say to a frame that did not come: body, gyro and covariance at
  /// frame.stamp_ns. It counts as given out.
  void addMotion(LiveFrame &frame);
  /// The newest navdata; nothing before the first and after a second without any.
  std::optional<BodyState> body() const;
  /// 1 or 2; 0 while it is not known.
  int generation() const;
  LinkCounters counters() const;
  /// The drone's command port. Flight commands are for vpRobotArDrone.
  AtChannel &commands();

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
