// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether an image can be believed at all, before anything is tracked in it.
///
/// Idea: a camera, its driver and its radio link fail in few ways, and each leaves a mark that no forest makes.
/// By itself an image shows no contrast, no light, too much of it, noise, blur, or rows and columns that repeat each
/// other. Against the images before it is a repetition (perhaps with fresh noise on top), mirrored, upside down, a
/// negative, cropped or torn, and so are those that follow it, until one follows the last good image again. Against the
/// gyro it is out of order or late: the shift of the whole image between two frames is the rotation of the camera but
/// for the parallax.
///
/// Limits are in grey levels, in shares, and in multiples of what the flight showed so far, so that they hold for every
/// camera. A camera that really has changed for good (a drop on the lens, another mode) is believed again after 30
/// images.

#include <Eigen/Core>

#include <bole/visp.h>
#include <memory>
#include <optional>
#include <string>
#include <visp3/core/vpImage.h>

namespace bole
{
enum class ImageFault
{
  none,
  wrong_size,
  black,        ///< no contrast, or hardly any light
  saturated,    ///< most pixels at the upper end
  noise,        ///< neighbours as different as strangers, or much more noise than before
  blurred,      ///< much less sharp than before
  smeared,      ///< rows or columns repeat each other
  frozen,       ///< an image that came before, perhaps with fresh noise
  mirrored,     ///< left and right exchanged
  upside_down,  ///< rotated by 180 degrees
  negative,     ///< dark and bright exchanged
  cropped,      ///< the same scene larger or smaller: another part of the sensor
  torn,         ///< one half follows the image before, the other does not
  out_of_order, ///< does not follow the frame before as the gyro says
  late          ///< shows what the gyro measured at another time
};
const char *toString(ImageFault fault);

/// What is known of the camera's motion since the image that was checked before.
struct MeasuredRotation
{
  /// Rotation vector of the camera in its own frame by the gyro [rad]; nothing where a sample is missing.
  std::optional<Eigen::Vector3d> gyro;
  /// The same by the odometry: where it is there, the gyro is believed only if both agree.
  std::optional<Eigen::Vector3d> odometry;
  double focal_px = 0;  ///< focal length in the checked image
  double elapsed_s = 0; ///< [s]
};

/// Remembers what the flight looked like. Cost: about 0.3 ms at 320x240. Not thread-safe.
///
/// Laws (each a test): an image is never accepted as new within the flight when 99.9 % of its pixels are those of the
/// last accepted one; a fault that lasts is named anew for each image, smear, blur and noise for 30 images at most.
class ImageHealth
{
public:
  /// \p detects_frozen: off for a camera that may stand still without any noise.
  explicit ImageHealth(bool detects_frozen = true);
  ~ImageHealth();
  ImageHealth(ImageHealth &&) noexcept;
  ImageHealth &operator=(ImageHealth &&) noexcept;

  /// Starts anew from an image taken as good; the next image may be equal to it.
  void start(const vpImage<unsigned char> &I);
  ImageFault check(const vpImage<unsigned char> &I, const MeasuredRotation &motion = {});
  /// An image that did not come: the camera moved all the same.
  void skip(const MeasuredRotation &motion);
  /// What was seen of the last fault, with its numbers.
  const std::string &reason() const;

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
