// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What nearly every test includes, with what is said of a mistake.

#include "support/files.h"

#include <bole/visp.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <memory>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <sstream>

#include <Eigen/Dense>
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <visp3/core/vpException.h>
#include <visp3/core/vpImage.h>

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

/// The statement is refused with \p part in what is said.
#define EXPECT_REFUSED(part, ...) EXPECT_THAT(bole::test::messageOf([&] { __VA_ARGS__; }), testing::HasSubstr(part))
