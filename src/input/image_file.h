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
  FrameStatus status = FrameStatus::ok; ///< ok, corrupt or missing
  std::string message;                  ///< why not ok
  vpImage<unsigned char> image;         ///< grey; empty when not ok
};

/// Decodes \p path as grey. A file that ends early is corrupt even where its decoder would fill the
/// rest with grey (JPEG) or leave the last rows undefined.
ImageFile readImageFile(const std::string &path);
} // namespace bole
