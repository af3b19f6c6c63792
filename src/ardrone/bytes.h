// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Little-endian numbers out of and into byte buffers.

#include <cstdint>
#include <cstring>
#include <vector>

namespace bole
{
/// The number of type \p T at \p p, stored with its least significant byte first. Reads sizeof(T) bytes.
template <typename T> T readLittleEndian(const std::uint8_t *p)
{
  std::uint64_t bits = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i)
    bits |= std::uint64_t{p[i]} << (8 * i);
  if constexpr (sizeof(T) == 8) {
    T value;
    std::memcpy(&value, &bits, 8);
    return value;
  }
  else if constexpr (sizeof(T) == 4) {
    const auto word = static_cast<std::uint32_t>(bits);
    T value;
    std::memcpy(&value, &word, 4);
    return value;
  }
  else {
    return static_cast<T>(bits);
  }
}

/// Appends \p value with its least significant byte first.
template <typename T> void appendLittleEndian(std::vector<std::uint8_t> &out, T value)
{
  std::uint64_t bits = 0;
  if constexpr (sizeof(T) == 8) {
    std::memcpy(&bits, &value, 8);
  }
  else if constexpr (sizeof(T) == 4) {
    std::uint32_t word;
    std::memcpy(&word, &value, 4);
    bits = word;
  }
  else {
    bits = static_cast<std::uint64_t>(value);
  }
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out.push_back(static_cast<std::uint8_t>(bits >> (8 * i)));
}
} // namespace bole
