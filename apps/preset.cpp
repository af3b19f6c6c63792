// SPDX-License-Identifier: GPL-2.0-or-later
#include "preset.h"
#include "suggestion.h"

#include <algorithm>
#include <filesystem>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole::apps
{
namespace fs = std::filesystem;
namespace
{
/// The folder of the presets; empty where there is none.
fs::path presetFolder()
{
  std::error_code error;
  for (fs::path folder = fs::read_symlink("/proc/self/exe", error).parent_path(); folder.has_relative_path();
       folder = folder.parent_path())
    for (const fs::path &presets : {folder / "share/bole/config", folder / "config"})
      if (fs::exists(presets / "default.yaml", error))
        return presets;
  return {};
}
} // namespace

std::string presetPath(const std::string &config)
{
  std::error_code error;
  if (config.empty() || fs::exists(config, error) || config.find('/') != std::string::npos)
    return config;
  const fs::path folder = presetFolder();
  std::vector<std::string> names;
  if (!folder.empty())
    for (const auto &entry : fs::directory_iterator(folder, error))
      if (entry.path().extension() == ".yaml")
        names.push_back(entry.path().stem().string());
  const std::string name = fs::path(config).stem().string();
  if (std::find(names.begin(), names.end(), name) != names.end())
    return (folder / (name + ".yaml")).string();
  std::sort(names.begin(), names.end());
  const std::string meant = nearest(name, names);
  throw vpException(vpException::ioError,
                    fmt::format("--config {}: no such file, and no preset of that name{}; presets: {}", config,
                                meant.empty() ? "" : fmt::format(" (did you mean {}?)", meant),
                                fmt::join(names, ", ")));
}
} // namespace bole::apps
