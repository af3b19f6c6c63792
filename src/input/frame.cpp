// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/frame.h>

#include "geometry/names.h"

namespace bole
{
const char *toString(FrameStatus status)
{
  return nameOf(status, {"ok", "stale", "corrupt", "missing", "resized", "doubtful"});
}
} // namespace bole
