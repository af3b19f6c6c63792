// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What enters the pipeline: frames with a timestamp, a status, and what the motion sensors measured.

#include <bole/camera.h>
#include <bole/pose.h>

#include <bole/visp.h>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// What is known of a frame before anyone looks at its pixels.
enum class FrameStatus
{
  ok,
  stale,   ///< the same image again: a frozen camera or a decoder that repeats its last picture
  corrupt, ///< could not be decoded (whole or part): do not trust the pixels
  missing, ///< the source says that a frame should be here, and it is not; the image is empty
  resized, ///< not the size of the frames before: not used
  doubtful ///< decoded, and no picture of this place at this time: dark, noise, smeared, out of order, late
};
/// As reports write it.
const char *toString(FrameStatus status);

/// Angular rate in the body frame [rad/s], timestamp in [ns], and what an accelerometer beside the gyro measured.
struct GyroSample
{
  std::int64_t stamp_ns = 0;                      ///< time of the sample
  Eigen::Vector3d rate = Eigen::Vector3d::Zero(); ///< angular rate in the body [rad/s]
  std::optional<Eigen::Vector3d> force = {};      ///< specific force in the body frame [m/s^2]: +9.81 upwards at rest
};

/// A sensor that contradicts the others.
struct SensorVerdict
{
  std::string sensor; ///< "gyro", "accelerometer", "odometry" or "images"
  std::string kind;   ///< rotation, bias, time, stuck, ended, jump, noise, direction, tilt, height, scale, focal, mount
  double since_s = 0; ///< stamp at which the contradiction began [s]
  std::string text;   ///< for the user: "odometry: frozen since 5.0 s"
};

/// One picture with all that the sensors said about its time.
struct Frame
{
  std::int64_t stamp_ns = 0;            ///< time of the middle of the exposure
  std::size_t index = 0;                ///< position in the source, counted with missing frames
  FrameStatus status = FrameStatus::ok; ///< whether the picture may be used
  std::string message;                  ///< why the status is not ok, or what is wrong with its time
  double gap_s = 0;                     ///< [s] since the frame before, where that is far longer than usual; else 0
  vpImage<unsigned char> image;         ///< grey, rectified: the pinhole of FrameSource::camera() applies
  std::optional<Pose> wMb_odometry;     ///< pose filter at this frame, where there is one
  /// [ns] of the host's steady clock when the last byte of the frame came; 0 for recordings.
  std::int64_t arrival_ns = 0;
  std::vector<GyroSample> gyro;  ///< samples since the frame before, oldest first
  std::optional<Pose> wMb_truth; ///< ground truth, for pictures and evaluation only: no stage may read it
};

/// A stream of frames: a folder, a video, a live drone.
class FrameSource
{
public:
  virtual ~FrameSource() = default;
  /// The next frame; false at the end. Broken frames come with a status, never as an exception; a
  /// user's mistake (a missing folder, a bad calendar of stamps) throws vpException naming file and
  /// line.
  virtual bool next(Frame &frame) = 0;
  /// Pinhole of the rectified images.
  virtual PinholeCamera camera() const = 0;
  /// Camera in the body frame.
  virtual Pose bMc() const = 0;
  /// Number of frames, 0 when not known (live, some videos).
  virtual std::size_t size() const { return 0; }
  /// Of the input, for reports.
  virtual std::string name() const = 0;
  /// Whether frames come with poses of a pose filter.
  virtual bool hasOdometry() const = 0;
  /// Whether frames come with samples of a gyro.
  virtual bool hasGyro() const = 0;
  /// False where the focal length is a guess.
  virtual bool isCameraKnown() const { return true; }
  /// Whether the images went through a lossy codec at a low rate: a video file, a drone's video link.
  virtual bool isCompressed() const { return false; }
  /// What the user should be told about how the input is read (an assumed camera); empty when
  /// nothing.
  virtual std::string note() const { return {}; }
};
} // namespace bole
