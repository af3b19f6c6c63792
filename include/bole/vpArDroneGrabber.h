// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// AR.Drone 1 and 2 behind ViSP's grabber interface.

#include <bole/frame.h>

#include <bole/visp.h>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <visp3/core/vpFrameGrabber.h>

namespace bole
{
class DroneLink;
struct LiveFrame;

/// What navdata say of the body at one instant, in SI units and the axes x forward, y left, z up.
struct BodyState
{
  std::int64_t stamp_ns = 0; ///< drone's navdata clock, unwrapped
  Pose wMb;                  ///< integrated from the start; the world stands on the ground, z up
  Eigen::Vector3d velocity = Eigen::Vector3d::Zero(); ///< [m/s], body frame
  std::optional<Eigen::Vector3d> rate;                ///< [rad/s], body frame; with full navdata only
  std::optional<Eigen::Vector3d> force;               ///< specific force [m/s^2], body frame; with full navdata only
  double height = 0;                                  ///< over the ground [m], 0 while the sonar is blind
  double battery = 0;                                 ///< share of full, 0 to 1
  std::uint32_t state = 0;                            ///< the drone's state word
  std::uint32_t flight_phase = 0;                     ///< 2 landed, 3 flying, 4 hovering, 6 taking off, 8 landing
};

/// What came of the video.
struct VideoCounters
{
  std::size_t frames = 0;        ///< given out, whatever their status
  std::size_t ok = 0;            ///< pictures by what became of them
  std::size_t corrupt = 0;       ///< pictures by what became of them
  std::size_t stale = 0;         ///< pictures by what became of them
  std::size_t resized = 0;       ///< pictures by what became of them
  std::size_t refused = 0;       ///< datagrams that cannot be a picture, or come faster than any drone sends
  std::size_t skipped = 0;       ///< never decoded, since a newer key frame was there
  std::size_t resyncs = 0;       ///< times that the stream had to be searched for a header
  std::size_t skipped_bytes = 0; ///< bytes that belonged to no frame
};

/// What came over the link so far.
struct LinkCounters
{
  VideoCounters video;              ///< of the pictures
  std::size_t delivered = 0;        ///< frames given out
  std::size_t frozen = 0;           ///< of them, stale
  std::size_t dropped = 0;          ///< decoded, but a newer frame came before anyone asked, or its time was over
  std::size_t connections = 0;      ///< of the video, the first one too
  std::size_t clock_jumps = 0;      ///< of the video's clock: reboots
  std::size_t navdata_packets = 0;  ///< used
  std::size_t navdata_refused = 0;  ///< wrong checksum, cut
  std::size_t navdata_late = 0;     ///< out of sequence
  std::size_t navdata_restarts = 0; ///< how often the numbering began anew
};

/// What a received piece belongs to.
enum class LinkChannel : std::uint8_t
{
  video = 1,
  navdata = 2,
  video_connected = 3
};
/// Sees every received byte first; called from the receiving threads, must be quick and
/// thread-safe.
using LinkTap = std::function<void(LinkChannel, std::int64_t arrival_ns, const std::uint8_t *data, std::size_t size)>;
} // namespace bole

/// Grabs the newest image of an AR.Drone's front camera with the navdata of the same instant.
///
/// Idea: open() connects and waits for a first good image; acquire() gives the newest image not yet
/// given out and waits for one where there is none. What came in between is dropped, never queued,
/// so the age of an image does not depend on the speed of the program. Broken images are no
/// exceptions: acquire() leaves the image as it was and getStatus() says why; only open() throws,
/// when no drone answers in time. Where no image comes in time the status is `missing`, with the
/// navdata of that instant. Reading never moves the drone.
///
/// Images are those of the lens, not rectified: ArDroneSource does that. One thread may use an
/// object at a time.
///
/// \code
/// vpArDroneGrabber g("ardrone://192.168.1.1");
/// vpImage<unsigned char> I;
/// g.open(I);
/// while (true) {
///   g.acquire(I);
///   if (g.getStatus() == bole::FrameStatus::ok && g.getBody())
///     std::cout << g.getTimestamp() << " s: height " << g.getBody()->height << " m\n";
/// }
/// \endcode
class vpArDroneGrabber : public vpFrameGrabber
{
public:
  /// Of the link and the picture.
  struct Options
  {
    double open_timeout_s = 5;    ///< [s], (0.1, 600): a key frame comes every half second
    double frame_timeout_s = 0.4; ///< [s], (0.02, 60): acquire() gives up then, the status is `missing`
    /// \throws vpException where a value is out of range, with what is allowed
    void validate() const;
  };

  /// \param address `ardrone://HOST[?key=value&...]`, `ardrone://` alone is the drone's own network, 192.168.1.1.
  /// | key | meaning | default |
  /// |---|---|---|
  /// | `offset` | added to the three ports below, 0 .. 59000: several emulators on one machine | 0 |
  /// | `navdata`, `video`, `at` | UDP, TCP (drone 2) or UDP (drone 1), UDP port | 5554, 5555, 5556 |
  /// | `generation` | `1`, `2` or `auto`: tries the drone 2's TCP port first | `auto` |
  /// | `camera` | camera file, readCamera() | the published calibration of the generation |
  /// | `video_delay_ms` | from exposure to the arrival of the fastest frame, 0 .. 500 | 60 |
  ///
  /// Errors: vpException "address: key = value, must be ...".
  explicit vpArDroneGrabber(const std::string &address = "ardrone://192.168.1.1");
  /// \param address ardrone://HOST[?key=value...] \param options see Options \param tap sees every packet, for
  /// recordings
  vpArDroneGrabber(const std::string &address, const Options &options, bole::LinkTap tap = {});
  ~vpArDroneGrabber() override;

  /// Connects and waits for the first picture, in grey. \throws vpException when the drone does not answer
  void open(vpImage<unsigned char> &I) override;
  /// The same, in colour.
  void open(vpImage<vpRGBa> &I) override;
  /// Waits for the next picture, in grey. \throws vpException at the end of the flight
  void acquire(vpImage<unsigned char> &I) override;
  /// The same, in colour.
  void acquire(vpImage<vpRGBa> &I) override;
  /// Ends the connection.
  void close() override;

  // Of the image acquired last:
  /// Of the last picture: ok, stale, corrupt, ...
  bole::FrameStatus getStatus() const;
  const std::string &getMessage() const; ///< why the status is not ok
  double getTimestamp() const;           ///< drone's clock [s]
  std::uint32_t getFrameNumber() const;  ///< as the drone counts
  /// Attitude, rates, velocity, height, battery and state at the exposure; nothing where navdata
  /// are missing.
  const std::optional<bole::BodyState> &getBody() const;

  /// Packets and pictures so far.
  bole::LinkCounters getCounters() const;
  /// Connects without waiting for an image: for programs that need navdata or commands only.
  void connect();

  // For the library's own classes, whose types are private:
  /// The connection. Throws vpException when not open.
  bole::DroneLink &getLink();
  /// The frame acquired last with everything that came with it.
  const bole::LiveFrame &getFrame() const;

private:
  void waitForFirstImage();
  void grab();

  struct State;
  std::unique_ptr<State> m_state;
};
