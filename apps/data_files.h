// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Presets, models and flights that come with bole are found by name from any folder.

#include <string>

namespace bole::apps
{
/// The folder of config/, models/ and data/: $BOLE_DATA_DIR, that of an installation (share/bole beside the command's
/// folder) or the sources that the command was built in; empty when there is none.
std::string dataFolder();

/// \p name itself when it is there or looks like a path of its own; else the file or folder of bole's that it names
/// ("tabletop" for config/tabletop.yaml, "park-forward" or "data/park-forward" for the flight), or \p name when none
/// does. findPreset() throws vpException that lists the presets where there is none of that name.
std::string findPreset(const std::string &name);
std::string findSequence(const std::string &name);
std::string findModel(const std::string &name);
} // namespace bole::apps
