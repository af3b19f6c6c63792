// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What scene files and commands call the values of an enumeration.

#include "simulation/flight_path.h"
#include "support/text.h"
#include <bole/camera.h>

#include <string>
#include <utility>
#include <vector>

namespace bole
{
template <class T> using Words = std::vector<std::pair<std::string, T>>;

inline const char *toString(Light light) { return nameOf(light, {"sun", "overcast"}); }
inline const char *toString(Bark bark) { return nameOf(bark, {"dark", "bright", "mixed"}); }
inline const char *toString(PathKind path) { return nameOf(path, {"forward", "lateral", "loop", "slalom"}); }

/// All values of an enumeration by their names.
template <class T> Words<T> wordsOf(T)
{
  Words<T> words;
  for (T value{}; std::string(toString(value)) != kUnknownName; value = static_cast<T>(static_cast<int>(value) + 1))
    words.emplace_back(toString(value), value);
  return words;
}
} // namespace bole
