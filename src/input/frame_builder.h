// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the recorded sources share: from a decoded image and its stamp to a complete Frame.
#include "input/trajectory.h"
#include <bole/camera.h>
#include <bole/frame.h>
#include <bole/open_source.h>

#include <memory>
#include <optional>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Undistorts and shrinks images by one precomputed map: from a real lens to a pinhole of a handy size.
///
/// Idea: every stage behind `input` works with straight lines, so the lens is undone once a frame. The image is first
/// shrunk by averaging areas to at most \p max_width_px (trunks need no more than 320 to 640 columns, and the cost of
/// every stage grows with the pixels), then the map is applied to the small image. The focal length of the output is
/// the shortest one, between 0.6 and 2 times that of the lens, at which every output pixel sees the input image, so no
/// made-up border enters the gradients.
///
/// Without distortion and shrinking the image is handed over as it is. Cost at 320x240: a fraction of a millisecond.
/// Not for two threads at once (it keeps a scratch image).
/// Law (a test): an image drawn through the lens comes out as one drawn through camera().
class Rectifier
{
public:
  /// \param max_width_px images wider than this are shrunk to it; 0 to keep every size.
  explicit Rectifier(const CameraModel &model, int max_width_px = 0);
  ~Rectifier();
  Rectifier(Rectifier &&) noexcept;
  Rectifier &operator=(Rectifier &&) noexcept;

  /// Size of the images apply() takes [px].
  int inputWidth() const;
  int inputHeight() const;
  /// Pinhole of the images apply() gives.
  const PinholeCamera &camera() const;
  bool isIdentity() const;

  /// \p image is exchanged for its rectified form. Throws vpException when its size is not the input's.
  void apply(vpImage<unsigned char> &image) const;

private:
  struct Map;
  std::unique_ptr<Map> m_map;
};

struct ImageFile
{
  FrameStatus status = FrameStatus::ok; ///< ok, corrupt, missing or resized
  std::string message;                  ///< why not ok
  vpImage<unsigned char> image;         ///< grey; empty when not ok
};

/// Decodes \p path as grey. A file that ends early is corrupt even where its decoder would fill the
/// rest with grey (JPEG) or leave the last rows undefined.
/// \param width, height [px] of the images before: one of another size is `resized` and not decoded; 0: any size.
ImageFile readImageFile(const std::string &path, int width = 0, int height = 0);

/// Which of SourceOptions a source has a use for.
struct SourceKind
{
  const char *name;
  bool takes_camera, has_camera, takes_odometry, takes_rate;
};
constexpr SourceKind kAslFolder{"an ASL folder", true, true, true, false};
constexpr SourceKind kNumberedImages{"a sequence of images", true, false, true, true};
constexpr SourceKind kVideo{"a video", true, false, true, false};
constexpr SourceKind kStream{"a live stream", true, false, false, false};
constexpr SourceKind kDrone{"a drone", false, true, false, false};

/// Throws vpException where \p options are out of range, or hold what has no effect on \p input of this \p kind.
void requireUsed(const SourceOptions &options, const std::string &input, const SourceKind &kind);

/// Motion sensors of a recording; each may be empty.
struct Recording
{
  Trajectory odometry;
  Trajectory truth;
  std::vector<GyroSample> gyro;
};

/// \p recording without the constant errors of its sensors.
Recording corrected(Recording recording, const SensorCalibration &calibration);

/// Adds what the motion sensors measured, judges the images (FrameJudge) and rectifies them.
class FrameBuilder
{
public:
  FrameBuilder(const MountedCamera &camera, const SourceOptions &options, Recording recording);

  /// Fills \p frame from the raw image \p file taken at \p stamp_ns. Stamps must rise from call to call.
  void build(std::int64_t stamp_ns, ImageFile file, Frame &frame);
  /// Judges and rectifies the raw picture of a frame that has all else: the sensors are asked, too.
  void complete(Frame &frame);

  /// Size of the images that build() takes [px].
  int inputWidth() const { return m_rectifier.inputWidth(); }
  int inputHeight() const { return m_rectifier.inputHeight(); }
  const PinholeCamera &camera() const { return m_rectifier.camera(); }
  const Pose &bMc() const { return m_bMc; }
  const CameraModel &lens() const { return m_lens; }
  const Recording &recording() const { return m_recording; }

private:
  CameraModel m_lens;
  Rectifier m_rectifier;
  Pose m_bMc;
  Recording m_recording;
  FrameJudge m_judge;
  std::optional<std::int64_t> m_last_stamp_ns;
  std::size_t m_gyro_at = 0;
  std::size_t m_index = 0;
};

/// Reads the odometry file of \p options, shifted by its offset; empty when none is given.
Trajectory readOdometry(const SourceOptions &options);

/// Throws vpException when no pose of \p odometry falls in [\p first_ns, \p last_ns].
void requireOverlap(const Trajectory &odometry, std::int64_t first_ns, std::int64_t last_ns,
                    const std::string &odometry_path, const std::string &source);

/// The camera of \p options for images of this size, checked against it; without a camera file one
/// that looks straight ahead with the assumed field of view, which \p note then says.
/// \p pixel_aspect: width of a pixel over its height.
MountedCamera cameraFor(const SourceOptions &options, int width, int height, std::string &note,
                        double pixel_aspect = 1);
} // namespace bole
