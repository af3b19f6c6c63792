// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Little-endian numbers out of and into byte buffers.

#include <cstdint>
#include <cstring>
#include <vector>

namespace bole
{
/// The number of type \p T at \p p, stored with its least significant byte first. Reads sizeof(T) bytes, at most 4.
template <typename T> T readLittleEndian(const std::uint8_t *p)
{
  std::uint32_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    bits |= std::uint32_t{p[i]} << (8 * i);
  if constexpr (sizeof(T) < sizeof bits)
    return static_cast<T>(bits);
  T value;
  std::memcpy(&value, &bits, sizeof value);
  return value;
}

/// Appends the integer \p value with its least significant byte first.
template <typename T> void appendLittleEndian(std::vector<std::uint8_t> &out, T value)
{
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}
} // namespace bole
