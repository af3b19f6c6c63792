// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Single pictures from bytes and to bytes, by libavcodec.

#include <bole/visp.h>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// The grey levels of a PNG, JPEG, BMP, TIFF or PNM, 8 bits of them, colours by ITU-R BT.601, transparency ignored.
/// False for what cannot be decoded. Never throws.
bool decodeGrey(const std::vector<unsigned char> &bytes, vpImage<unsigned char> &grey);

/// Throw vpException where libavcodec cannot.
std::string encodePng(const vpImage<unsigned char> &grey);
std::string encodeJpeg(const vpImage<vpRGBa> &picture);
} // namespace bole
