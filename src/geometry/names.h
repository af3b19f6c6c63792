// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the values of an enumeration are called, and the value of a name.

#include <cstddef>
#include <initializer_list>
#include <optional>
#include <string_view>

namespace bole
{
/// Of a value beyond those of its enumeration.
constexpr const char *kUnknownName = "unknown";

/// The name of \p value; \p names stand in the order of the enumeration, which counts from 0.
template <typename Enum> const char *nameOf(Enum value, std::initializer_list<const char *> names)
{
  const auto at = static_cast<std::size_t>(value);
  return at < names.size() ? names.begin()[at] : kUnknownName;
}

/// The value that toString() calls \p name, of those up to \p last; nothing where there is none.
template <typename Enum> std::optional<Enum> valueNamed(std::string_view name, Enum last)
{
  for (int i = 0; i <= static_cast<int>(last); ++i)
    if (name == toString(static_cast<Enum>(i)))
      return static_cast<Enum>(i);
  return std::nullopt;
}
} // namespace bole
