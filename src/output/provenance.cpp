// SPDX-License-Identifier: GPL-2.0-or-later
// What a run is made of: its input and the versions of the programs.
#include "output/summary_json.h"

#include "bole_commit.h"
#include <bole/visp.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <memory>
#include <opencv2/core/version.hpp>
#include <vector>

extern "C" {
#include <libavutil/avutil.h>
#include <libavutil/mem.h>
#include <libavutil/sha.h>
}

namespace bole
{
namespace fs = std::filesystem;
namespace
{
void add(AVSHA &hash, const char *data, std::size_t size)
{
  av_sha_update(&hash, reinterpret_cast<const std::uint8_t *>(data), size);
}

/// Adds the content of \p path; false where that cannot be read or is not wanted any more.
bool addFile(AVSHA &hash, const fs::path &path, std::uint64_t &bytes, const std::atomic<bool> &is_cancelled)
{
  std::ifstream file(path, std::ios::binary);
  std::vector<char> block(1 << 16);
  while (file && !is_cancelled) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    const auto count = static_cast<std::size_t>(file.gcount());
    add(hash, block.data(), count);
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
  const std::unique_ptr<AVSHA, void (*)(void *)> hash(av_sha_alloc(), av_free);
  av_sha_init(hash.get(), 256);
  InputDigest digest;
  if (fs::is_regular_file(root, error)) {
    if (!addFile(*hash, root, digest.bytes, is_cancelled))
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
      add(*hash, name.c_str(), name.size() + 1);
      if (!addFile(*hash, file, digest.bytes, is_cancelled))
        return std::nullopt;
    }
  }
  else
    return std::nullopt;
  std::array<std::uint8_t, 32> bytes{};
  av_sha_final(hash.get(), bytes.data());
  digest.sha256 = fmt::format("{:02x}", fmt::join(bytes, ""));
  return digest;
}

std::map<std::string, std::string> versions()
{
  return {{"bole", BOLE_VERSION},
          {"commit", BOLE_COMMIT},
          {"visp", fmt::format("{}.{}.{}", VISP_VERSION_MAJOR, VISP_VERSION_MINOR, VISP_VERSION_PATCH)},
          {"opencv", CV_VERSION},
          {"libav", av_version_info()}};
}
} // namespace bole
