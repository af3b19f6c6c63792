// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Reading one image file without ever throwing: a broken file is a status.

#include <bole/frame.h>

#include <string>

namespace bole
{
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
} // namespace bole
