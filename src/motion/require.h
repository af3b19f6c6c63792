// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// One line of an Options::validate().

#include <fmt/format.h>

#include <visp3/core/vpException.h>

namespace bole::motion
{
template <typename Value> void require(bool holds, const char *name, Value value, const char *must)
{
  if (!holds) {
    throw vpException(vpException::badValue, fmt::format("{} = {}, must be {}", name, value, must));
  }
}
} // namespace bole::motion
