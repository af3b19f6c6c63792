// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/trunk_record.h>

#include "geometry/names.h"

namespace bole
{
const char *toString(TrunkStatus status) { return nameOf(status, {"candidate", "confirmed", "lost", "merged"}); }

const char *toString(RejectReason reason)
{
  return nameOf(reason, {"none", "undecided", "unseen", "missed", "doubted", "outdone", "duplicate", "unranged"});
}
} // namespace bole
