// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What this library was built from.

#include <map>
#include <string>

namespace bole
{
/// Of bole, its commit ("unknown" outside a repository), ViSP, OpenCV and libav.
std::map<std::string, std::string> versions();
} // namespace bole
