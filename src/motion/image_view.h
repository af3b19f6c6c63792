// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// ViSP's images for OpenCV.

#include <bole/visp.h>
#include <opencv2/core.hpp>
#include <visp3/core/vpImage.h>

namespace bole
{
/// The pixels of \p image, not copied; not to be written.
inline cv::Mat viewOf(const vpImage<unsigned char> &image)
{
  return cv::Mat(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()), CV_8U,
                 const_cast<unsigned char *>(image.bitmap));
}
} // namespace bole
