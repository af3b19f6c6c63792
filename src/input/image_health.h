// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Whether an image can be believed at all, before anything is tracked in it.
///
/// Idea: a camera and its radio link fail in few ways, and each leaves a mark that no forest makes: no
/// contrast; neighbours as different as strangers; the very bytes of the image before; rows or columns
/// that repeat each other. All are counted on a part of the pixels, relative to the last good image where that matters.

#include <visp3/core/vpImage.h>

namespace bole
{
enum class ImageFault
{
  none,
  wrong_size,
  black,
  noise,
  frozen,
  smeared
};
const char *toString(ImageFault fault);

/// Remembers the last image and the last good one. Cost: about 0.05 ms at 320x240.
class ImageHealth
{
public:
  struct Options
  {
    double min_deviation = 3;    ///< standard deviation of the grey levels below which an image is blank (0 .. 50)
    double max_roughness = 0.75; ///< mean difference of neighbours over deviation; white noise has 1.1 (0.3 .. 1)
    double max_repeated =
        0.15; ///< share of rows or columns equal to their neighbour, beyond the last good image's (0 .. 1)
    double same_pixels = 0.999; ///< share of equal pixels that makes an image the one before (0.5 .. 1)
    bool detect_frozen = true;  ///< off for a camera that may stand still without any noise
    void validate() const;      ///< throws vpException "name = value, must be ..."
  };
  ImageHealth() = default;
  explicit ImageHealth(const Options &options) : m_options(options) { m_options.validate(); }

  /// Starts anew from an image taken as good; the next image may be equal to it.
  void start(const vpImage<unsigned char> &I);
  ImageFault check(const vpImage<unsigned char> &I);

private:
  struct Numbers
  {
    double deviation = 0, roughness = 0, repeated = 0;
  };
  static Numbers measure(const vpImage<unsigned char> &I);

  Options m_options;
  vpImage<unsigned char> m_last;
  bool m_may_repeat = true;
  double m_good_repeated = 0;
};
} // namespace bole
