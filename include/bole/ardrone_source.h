// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A live drone as a source of frames for the pipeline.

#include <bole/frame.h>
#include <bole/open_source.h>
#include <bole/vpArDroneGrabber.h>

#include <memory>

namespace bole
{
/// The published calibration of the front camera: generation 1 at 320x240 (FOV lens), 2 at 640x360,
/// scaled to another size of the same shape. Yours is better: calibrate and give a camera file.
MountedCamera publishedArDroneCamera(int generation, int width, int height);

/// Frames of an AR.Drone (or an emulator, or a replayed recording): grey, rectified, newest first
/// served, with the drone's odometry, gyro and height.
///
/// next() blocks until there is a frame and never ends by itself; it ends (false) after stop(), or
/// when the drone has been silent for \p Options::give_up_s. While the drone is silent it gives a
/// `missing` frame every frame_timeout_s. The world of wMb_odometry is that of NavdataOdometry.
///
/// One thread calls next(); stop() may be called from any thread and from a signal handler.
///
/// \code
/// auto source = bole::ArDroneSource("ardrone://127.0.0.1?offset=10000");
/// bole::Frame frame;
/// while (source.next(frame))
///   pipeline.process(frame);
/// \endcode
class ArDroneSource : public FrameSource
{
public:
  /// What an AR.Drone is read with.
  struct Options
  {
    vpArDroneGrabber::Options grabber; ///< of the link and of the decoder
    double give_up_s = 10;             ///< [s], (0.5, 86400): a battery is changed, a reboot takes less
    int max_width_px = 640;            ///< [px], 0 or >= 64: wider images are shrunk, see Rectifier
    /// \throws vpException where a value is out of range, with what is allowed
    void validate() const;
  };

  /// Connects and waits for the first whole frame whose motion is known (the
  /// first whole one where no navdata come); throws vpException when none comes, for a wrong
  /// address or camera file, and for a camera of another shape.
  explicit ArDroneSource(const std::string &address);
  /// \param address ardrone://HOST[?key=value...] \param options see Options \param tap sees every packet, for
  /// recordings \throws vpException on an address that cannot be read
  ArDroneSource(const std::string &address, const Options &options, LinkTap tap = {});
  ~ArDroneSource() override;

  bool next(Frame &frame) override;
  PinholeCamera camera() const override;
  Pose bMc() const override;
  /// The address as it was given.
  std::string name() const override;
  /// An AR.Drone tells its motion in its navdata.
  bool hasOdometry() const override { return true; }
  /// The navdata hold a gyro.
  bool hasGyro() const override { return true; }
  bool isCompressed() const override { return true; }

  /// Ends a wait for the next frame, from any thread.
  void stop() noexcept;
  /// Packets and pictures so far.
  LinkCounters counters() const;
  /// The grabber behind, for its status and its counters.
  vpArDroneGrabber &grabber();
  /// Camera as mounted, with its lens, for recordings of the images as they came.
  const MountedCamera &mountedCamera() const;
  /// The frame given out last, before rectification.
  const LiveFrame &liveFrame() const;

  /// Whether \p address is one for this source.
  static bool accepts(const std::string &address);

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
