// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Faults of a camera and its link, put into images on purpose: the one injector of the laboratory.

#include <bole/visp.h>
#include <string>
#include <visp3/core/vpImage.h>

namespace bole
{
enum class FaultKind
{
  none,
  black,     ///< every pixel 0
  noise,     ///< every pixel a random grey
  smear,     ///< the last row of the upper half again and again, as a decoder shows that lost its data half-way
  freeze,    ///< the last good image again
  wrong_size ///< half as wide and half as high
};
const char *toString(FaultKind kind);
/// \throw vpException for another word.
FaultKind faultKindFromString(const std::string &word);

/// Spoils \p image; \p last_good is shown by `freeze`, \p seed makes the noise.
void spoil(vpImage<unsigned char> &image, FaultKind kind, const vpImage<unsigned char> &last_good, unsigned seed);
} // namespace bole
