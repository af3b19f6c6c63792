// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Bytes as a file, for readers that want a path.

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>

namespace bole::fuzz
{
/// A file of this process with \p data in it; the next call of the same \p name overwrites it.
inline std::string fileOf(const std::uint8_t *data, std::size_t size, const std::string &name)
{
  static const std::filesystem::path folder = [] {
    const std::filesystem::path memory = "/dev/shm";
    const auto root = std::filesystem::is_directory(memory) ? memory : std::filesystem::temp_directory_path();
    const auto own = root / ("bole-fuzz-" + std::to_string(::getpid()));
    std::filesystem::create_directories(own);
    static const struct Remove
    {
      std::filesystem::path path;
      ~Remove()
      {
        std::error_code error;
        std::filesystem::remove_all(path, error);
      }
    } at_exit{own};
    return own;
  }();
  const std::string path = (folder / name).string();
  std::ofstream(path, std::ios::binary).write(reinterpret_cast<const char *>(data), static_cast<std::streamsize>(size));
  return path;
}

/// A message that does not begin with the file's name helps nobody.
inline void requireNamed(const std::string &message, const std::string &path)
{
  if (message.find(path) != 0)
    std::abort();
}
} // namespace bole::fuzz
