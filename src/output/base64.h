// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures as text, for pages in one file.

#include <string>
#include <string_view>

namespace bole
{
/// As of RFC 4648.
std::string base64(std::string_view bytes);
} // namespace bole
