// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/user_text.h"

#include <algorithm>
#include <cctype>

namespace bole
{
namespace
{
constexpr const char *kBlanks = " \t\r\n";

/// Where the host of the address that begins at \p begin stands in \p text: behind name and password.
std::size_t hostOf(const std::string &text, std::size_t begin, std::size_t end)
{
  const std::string authority = text.substr(begin, std::min(text.find_first_of("/?#", begin), end) - begin);
  std::size_t sign = authority.rfind('@');
  // "name:pass/word@host" is no address, but a password all the same: behind a colon there would be a port.
  const std::size_t colon = authority.find(':');
  if (sign == std::string::npos && colon != std::string::npos && authority.front() != '[' &&
      authority.find_first_not_of("0123456789:", colon) != std::string::npos)
    sign = text.substr(begin, end - begin).rfind('@');
  return sign == std::string::npos ? begin : begin + sign + 1;
}

bool isSecret(std::string key)
{
  std::transform(key.begin(), key.end(), key.begin(), [](unsigned char c) { return std::tolower(c); });
  for (const char *word : {"pass", "pwd", "token", "secret", "key", "auth", "sig", "cred"})
    if (key.find(word) != std::string::npos)
      return true;
  return false;
}
} // namespace

std::string withoutSecrets(std::string text)
{
  const std::string scheme = "://";
  for (std::size_t at = text.find(scheme); at != std::string::npos; at = text.find(scheme, at)) {
    at += scheme.size();
    text.erase(at, hostOf(text, at, std::min(text.find_first_of(kBlanks, at), text.size())) - at);
    std::size_t end = std::min(text.find_first_of(kBlanks, at), text.size());
    for (std::size_t sign = text.find('=', at); sign < end; sign = text.find('=', sign + 1)) {
      const std::size_t key = text.find_last_of("?&;/#", sign) + 1;
      const std::size_t value_end = std::min(text.find_first_of("&;/?#", sign), end);
      if (!isSecret(text.substr(key, sign - key)))
        continue;
      text.replace(sign + 1, value_end - sign - 1, "***");
      end = std::min(text.find_first_of(kBlanks, at), text.size());
    }
  }
  return text;
}

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
