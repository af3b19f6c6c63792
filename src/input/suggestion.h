// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the user may have meant by a word that is not known.

#include <string>
#include <vector>

namespace bole
{
/// The one of \p known nearest to \p word; empty where none is within a third of its letters.
std::string nearestWord(const std::string &word, const std::vector<std::string> &known);
} // namespace bole
