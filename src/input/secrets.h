// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Addresses as they may be shown and written.

#include <string>

namespace bole
{
/// \p text without the user names and passwords of addresses in it (`http://NAME:PASSWORD@HOST/`), and with `***` for
/// what their queries call a password, token, key, signature or the like. Wherever an input's name becomes text, it
/// comes from here.
std::string withoutSecrets(std::string text);
} // namespace bole
