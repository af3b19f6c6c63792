// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What scene files and commands call the values of an enumeration.

#include "lab/simulation/flight_path.h"
#include <bole/camera.h>

#include <string>
#include <utility>
#include <vector>

namespace bole
{
template <class T> using Words = std::vector<std::pair<std::string, T>>;

inline const Words<Light> &wordsOf(Light)
{
  static const Words<Light> words = {{"sun", Light::sun}, {"overcast", Light::overcast}};
  return words;
}
inline const Words<Bark> &wordsOf(Bark)
{
  static const Words<Bark> words = {{"dark", Bark::dark}, {"bright", Bark::bright}, {"mixed", Bark::mixed}};
  return words;
}
inline const Words<PathKind> &wordsOf(PathKind)
{
  static const Words<PathKind> words = {{"forward", PathKind::forward},
                                        {"lateral", PathKind::lateral},
                                        {"loop", PathKind::loop},
                                        {"slalom", PathKind::slalom}};
  return words;
}
inline const Words<Distortion> &wordsOf(Distortion)
{
  static const Words<Distortion> words = {{"none", Distortion::none},
                                          {"radial-tangential", Distortion::radial_tangential},
                                          {"equidistant", Distortion::equidistant},
                                          {"fov", Distortion::fov}};
  return words;
}

template <class T> std::string wordOf(T value)
{
  for (const auto &[word, meant] : wordsOf(value))
    if (meant == value)
      return word;
  return {};
}
} // namespace bole
