// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/summary_json.h"

#include <algorithm>
#include <array>
#include <filesystem>
#include <fmt/format.h>
#include <fstream>
#include <memory>
#include <vector>

extern "C" {
#include <libavutil/mem.h>
#include <libavutil/sha.h>
}

namespace bole
{
namespace fs = std::filesystem;
namespace
{
class Sha256
{
public:
  Sha256() : m_state(av_sha_alloc(), av_free) { av_sha_init(m_state.get(), 256); }
  void add(const char *data, std::size_t size)
  {
    av_sha_update(m_state.get(), reinterpret_cast<const std::uint8_t *>(data), size);
  }
  std::string finish()
  {
    std::array<std::uint8_t, 32> digest{};
    av_sha_final(m_state.get(), digest.data());
    std::string text;
    for (const std::uint8_t byte : digest)
      text += fmt::format("{:02x}", byte);
    return text;
  }

private:
  std::unique_ptr<AVSHA, void (*)(void *)> m_state;
};

/// Adds the content of \p path; false where that cannot be read or is not wanted any more.
bool addFile(Sha256 &hash, const fs::path &path, std::uint64_t &bytes, const std::atomic<bool> &is_cancelled)
{
  std::ifstream file(path, std::ios::binary);
  std::vector<char> block(1 << 16);
  while (file && !is_cancelled) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    const auto count = static_cast<std::size_t>(file.gcount());
    hash.add(block.data(), count);
    bytes += count;
  }
  return file.eof() && !is_cancelled;
}
} // namespace

std::optional<InputDigest> digestOf(const std::string &input, const std::atomic<bool> &is_cancelled)
{
  std::error_code error;
  fs::path root = input;
  if (input.find('%') != std::string::npos && !fs::exists(root, error))
    root = root.has_parent_path() ? root.parent_path() : fs::path(".");
  Sha256 hash;
  InputDigest digest;
  if (fs::is_regular_file(root, error)) {
    if (!addFile(hash, root, digest.bytes, is_cancelled))
      return std::nullopt;
  }
  else if (fs::is_directory(root, error)) {
    std::vector<fs::path> files;
    for (fs::recursive_directory_iterator it(root, error), end; !error && it != end && !is_cancelled;
         it.increment(error))
      if (it->is_regular_file(error))
        files.push_back(it->path());
    if (error || is_cancelled)
      return std::nullopt;
    std::sort(files.begin(), files.end());
    for (const fs::path &file : files) {
      const std::string name = file.lexically_relative(root).string();
      hash.add(name.c_str(), name.size() + 1);
      if (!addFile(hash, file, digest.bytes, is_cancelled))
        return std::nullopt;
    }
  }
  else
    return std::nullopt;
  digest.sha256 = hash.finish();
  return digest;
}
} // namespace bole
