// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Presets by name: `--config paper` from any folder.

#include <string>

namespace bole::apps
{
/// \p config itself where it is a file; else the preset of that name beside the program: in the source tree it was
/// built in, or in share/bole of the prefix it is installed to. Empty stays empty. \throw vpException that lists the
/// presets where there is none of that name.
std::string presetPath(const std::string &config);
} // namespace bole::apps
