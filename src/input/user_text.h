// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What users type: what they may have meant, and what of it may be shown and written.

#include <string>
#include <vector>

namespace bole
{
/// The one of \p known nearest to \p word; empty where none is within a third of its letters.
std::string nearestWord(const std::string &word, const std::vector<std::string> &known);

/// \p text without the user names and passwords of addresses in it (`http://NAME:PASSWORD@HOST/`), and with `***` for
/// what their queries call a password, token, key, signature or the like. Wherever an input's name becomes text, it
/// comes from here.
std::string withoutSecrets(std::string text);
} // namespace bole
