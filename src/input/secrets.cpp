// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/secrets.h"

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
} // namespace bole
