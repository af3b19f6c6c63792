// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/frame.h>

namespace bole
{
const char *toString(FrameStatus status)
{
  switch (status) {
  case FrameStatus::ok:
    return "ok";
  case FrameStatus::stale:
    return "stale";
  case FrameStatus::corrupt:
    return "corrupt";
  case FrameStatus::missing:
    return "missing";
  case FrameStatus::resized:
    return "resized";
  case FrameStatus::doubtful:
    return "doubtful";
  }
  return "unknown";
}
} // namespace bole
