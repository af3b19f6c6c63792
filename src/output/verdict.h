// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a run is worth, in words: what is known, what is doubtful, and which option would help.

#include "output/summary_json.h"

#include <string>
#include <vector>

namespace bole
{
struct Verdict
{
  bool is_trusted = true;          ///< false: the camera never moved, only rotated, or saw nothing
  std::vector<std::string> facts;  ///< a line each
  std::vector<std::string> doubts; ///< a sentence each, with the option that would help; empty when all is well
};

Verdict judge(const RunSummary &summary);

/// The last lines of `bole track`.
std::string toText(const Verdict &verdict);
} // namespace bole
