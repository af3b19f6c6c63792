// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/suggestion.h"

#include <algorithm>

namespace bole
{
namespace
{
/// Insertions, deletions, replacements and swaps of neighbours that lead from \p a to \p b.
std::size_t editDistance(const std::string &a, const std::string &b)
{
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      d[i][j] = std::min({d[i - 1][j] + 1, d[i][j - 1] + 1, d[i - 1][j - 1] + (a[i - 1] == b[j - 1] ? 0 : 1)});
      if (i > 1 && j > 1 && a[i - 1] == b[j - 2] && a[i - 2] == b[j - 1])
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}
} // namespace

std::string nearestWord(const std::string &word, const std::vector<std::string> &known)
{
  constexpr std::size_t kLongest = 60; // none of ours is longer
  const std::string start = word.substr(0, kLongest);
  std::string best;
  std::size_t least = std::max<std::size_t>(2, word.size() / 3) + 1;
  for (const std::string &candidate : known)
    if (const std::size_t distance = editDistance(start, candidate); distance < least) {
      least = distance;
      best = candidate;
    }
  return best;
}
} // namespace bole
