// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the user may have meant by a word that is not known.

#include <string>
#include <vector>

namespace bole::apps
{
/// Insertions, deletions, replacements and swaps of neighbours that lead from \p a to \p b.
std::size_t editDistance(const std::string &a, const std::string &b);

/// The one of \p known nearest to \p word; empty where none is within a third of its letters.
std::string nearest(const std::string &word, const std::vector<std::string> &known);
} // namespace bole::apps
