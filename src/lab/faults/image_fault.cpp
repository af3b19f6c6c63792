// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/faults/image_fault.h"

#include "geometry/failure.h"
#include "geometry/names.h"

#include <algorithm>
#include <random>

namespace bole
{
namespace
{
vpImage<unsigned char> halved(const vpImage<unsigned char> &image)
{
  vpImage<unsigned char> small(image.getHeight() / 2, image.getWidth() / 2);
  for (unsigned v = 0; v < small.getHeight(); ++v)
    for (unsigned u = 0; u < small.getWidth(); ++u)
      small[v][u] = image[2 * v][2 * u];
  return small;
}
} // namespace

const char *toString(FaultKind kind)
{
  return nameOf(kind, {"none", "black", "noise", "smear", "freeze", "wrong size"});
}

FaultKind faultKindFromString(const std::string &word)
{
  if (const auto kind = valueNamed(word, FaultKind::wrong_size))
    return *kind;
  throw badValue("fault = {}, must be none, black, noise, smear, freeze or wrong size", word);
}

void spoil(vpImage<unsigned char> &image, FaultKind kind, const vpImage<unsigned char> &last_good, unsigned seed)
{
  const unsigned w = image.getWidth(), h = image.getHeight();
  std::mt19937 random(seed);
  switch (kind) {
  case FaultKind::none:
    break;
  case FaultKind::black:
    image = static_cast<unsigned char>(0);
    break;
  case FaultKind::noise:
    for (unsigned i = 0; i < image.getSize(); ++i)
      image.bitmap[i] = static_cast<unsigned char>(random() & 255u);
    break;
  case FaultKind::smear:
    for (unsigned v = h / 2; v < h; ++v)
      std::copy(image[h / 2 - 1], image[h / 2 - 1] + w, image[v]);
    break;
  case FaultKind::freeze:
    image = last_good;
    break;
  case FaultKind::wrong_size:
    image = halved(image);
    break;
  }
}
} // namespace bole
