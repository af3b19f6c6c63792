// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Numbers out of text, the same in every locale.

#include <charconv>
#include <cmath>
#include <optional>
#include <string_view>

namespace bole
{
/// The finite number that \p text is, with a decimal point whatever locale the program has; nothing where it is none.
template <typename Number> std::optional<Number> parseNumber(std::string_view text)
{
  if (text.substr(0, 1) == "+" && text.substr(1, 1) != "-")
    text.remove_prefix(1);
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (text.empty() || error != std::errc() || end != text.data() + text.size() || !std::isfinite(double(value)))
    return std::nullopt;
  return value;
}
} // namespace bole
