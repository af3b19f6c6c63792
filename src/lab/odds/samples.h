// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Hypotheses of flights with known trunks: what the frames say of each, and whether it is a trunk.

#include "detection/trunk_evidence.h"

#include <string>
#include <vector>

namespace bole
{
struct OddsSample
{
  EvidenceTerms terms;
  bool is_trunk = false;
};

/// All hypotheses of the folder \p run of the flight \p sequence of which it can be told whether they are trunks.
/// \throw vpException where a file is missing.
std::vector<OddsSample> oddsSamples(const std::string &run, const std::string &sequence);
} // namespace bole
