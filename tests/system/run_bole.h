// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The command as a test runs it, and what it leaves.

#include "support/files.h"
#include "support/shell.h"

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>

namespace bole::test
{
inline const std::string kFlight = BOLE_SOURCE_DIR "/data/park-forward"; ///< the demonstration

/// \p before: what the shell does in front of it.
inline Outcome run(const std::string &arguments, const std::string &before = "")
{
  return runShell(before + BOLE_EXECUTABLE + " " + arguments);
}

/// A folder of this test program that is not there yet.
inline std::string freshFolder(const std::string &name)
{
  const std::string folder = testing::TempDir() + "bole_system_" + name;
  std::filesystem::remove_all(folder);
  return folder;
}

inline std::size_t linesIn(const std::string &path)
{
  const std::string text = textOf(path);
  return static_cast<std::size_t>(std::count(text.begin(), text.end(), '\n'));
}

inline nlohmann::json jsonOf(const std::string &path) { return nlohmann::json::parse(textOf(path)); }
} // namespace bole::test
