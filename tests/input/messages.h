// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What tests of frame sources share.

#include <bole/frame.h>

#include <functional>
#include <string>
#include <vector>
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
    return error.what();
  }
  return "";
}

inline std::vector<Frame> readAll(FrameSource &source)
{
  std::vector<Frame> frames;
  for (Frame frame; source.next(frame);)
    frames.push_back(frame);
  return frames;
}
} // namespace bole::test
