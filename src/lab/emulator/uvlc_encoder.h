// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The encoder of an emulated AR.Drone 1.

#include <bole/visp.h>
#include <cstdint>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// Encodes a grey picture (colours neutral) as an AR.Drone 1 does, quantiser 31. Written from the facts that stand in
/// src/ardrone/uvlc.h and from the decoder's mathematics by definition: no code in common. Sides must be 160x120 or
/// 88x72 times a power of two; throws vpException else.
std::vector<std::uint8_t> encodeUvlc(const vpImage<unsigned char> &image, std::uint32_t number);
} // namespace bole
