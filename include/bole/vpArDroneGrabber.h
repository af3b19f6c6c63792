// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// AR.Drone 1 and 2 behind ViSP's grabber interface.

#include "ardrone/drone_link.h"

#include <memory>
#include <string>
#include <visp3/core/vpFrameGrabber.h>

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
  struct Options
  {
    double open_timeout_s = 5;    ///< [s], (0.1, 600): a key frame comes every half second
    double frame_timeout_s = 0.4; ///< [s], (0.02, 60): acquire() gives up then, the status is `missing`
    bole::DroneLink::Options link;
    void validate() const;
  };

  /// \param address see bole::ArDroneAddress; throws vpException when it is none.
  explicit vpArDroneGrabber(const std::string &address = "ardrone://192.168.1.1");
  vpArDroneGrabber(const bole::ArDroneAddress &address, const Options &options, bole::LinkTap tap = {});
  ~vpArDroneGrabber() override;

  void open(vpImage<unsigned char> &I) override;
  void open(vpImage<vpRGBa> &I) override;
  void acquire(vpImage<unsigned char> &I) override;
  void acquire(vpImage<vpRGBa> &I) override;
  void close() override;

  // Of the image acquired last:
  bole::FrameStatus getStatus() const { return m_frame.status; }
  const std::string &getMessage() const { return m_frame.message; }
  double getTimestamp() const { return static_cast<double>(m_frame.stamp_ns) * 1e-9; } ///< drone's clock [s]
  std::uint32_t getFrameNumber() const { return m_frame.number; }
  /// Attitude, rates, velocity, height, battery and state at the exposure; nothing where navdata
  /// are missing.
  const std::optional<bole::BodyState> &getBody() const { return m_frame.body; }
  const bole::LiveFrame &getFrame() const { return m_frame; }

  bole::LinkCounters getCounters() const;
  /// The connection, for the navdata of now and for vpRobotArDrone. Throws vpException when not
  /// open.
  bole::DroneLink &getLink();
  /// Connects without waiting for an image: for programs that need navdata or commands only.
  void connect();

private:
  void waitForFirstImage();
  void grab();

  bole::ArDroneAddress m_address;
  Options m_options;
  bole::LinkTap m_tap;
  std::unique_ptr<bole::DroneLink> m_link;
  bole::LiveFrame m_frame;
  struct Instant
  {
    std::int64_t stamp_ns = 0, arrival_ns = 0;
  };
  Instant m_last_whole; ///< of the frame before those that are missing
};
