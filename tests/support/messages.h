// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What is said of a mistake.

#include <bole/visp.h>

#include <functional>
#include <string>
#include <visp3/core/vpException.h>

namespace bole::test
{
/// Message of the vpException that \p action throws, empty when it throws none.
inline std::string messageOf(const std::function<void()> &action)
{
  try {
    action();
  }
  catch (const vpException &error) {
    return error.getStringMessage();
  }
  return "";
}
} // namespace bole::test
