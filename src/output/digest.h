// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What a run read: its size and a hash, by which the same input is known again.

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>

namespace bole
{
struct InputDigest
{
  std::uint64_t bytes = 0;
  std::string sha256; ///< 64 hexadecimal digits
};

/// Of a file: its bytes. Of a folder: the name and the bytes of every file in it, in the order of their names. Of a
/// pattern such as `frames/%05d.png`: the same of its folder. Nothing where \p input is none of these, cannot be read,
/// or \p is_cancelled becomes true. Cost: reading it once.
std::optional<InputDigest> digestOf(const std::string &input, const std::atomic<bool> &is_cancelled);
} // namespace bole
