// SPDX-License-Identifier: GPL-2.0-or-later
// The order in which the affected variables are eliminated again.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
/// The order of the flight: each trunk right after the last pose that saw it.
void Smoother::State::orderAffected()
{
  const auto key = [this](int id) {
    const Variable &v = variables[id];
    return v.is_pose ? 2 * v.number : 2 * std::max(trunks[v.number].last_pose, trunks[v.number].behind) + 1;
  };
  std::sort(affected.begin(), affected.end(), [&](int l, int r) {
    const int kl = key(l), kr = key(r);
    return kl != kr ? kl < kr : variables[l].number < variables[r].number;
  });
}
} // namespace bole
