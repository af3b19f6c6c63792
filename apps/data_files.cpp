// SPDX-License-Identifier: GPL-2.0-or-later
#include "data_files.h"
#include "geometry/failure.h"

#include "input/user_text.h"

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <initializer_list>
#include <vector>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;

bool isDataFolder(const fs::path &folder)
{
  std::error_code ignored;
  return fs::exists(folder / "config/default.yaml", ignored);
}

/// The first of \p endings with which \p name is in \p folder (one of dataFolder()) or in dataFolder() itself.
std::string find(const std::string &name, const char *folder, std::initializer_list<const char *> endings)
{
  std::error_code ignored;
  const fs::path data = dataFolder(), path(name);
  if (name.empty() || path.is_absolute() || fs::exists(path, ignored) || data.empty())
    return name;
  for (const fs::path &root : {data / folder, data})
    for (const char *ending : endings)
      if (const fs::path found = root / (name + ending); fs::exists(found, ignored))
        return found.string();
  return name;
}
} // namespace

std::string dataFolder()
{
  if (const char *given = std::getenv("BOLE_DATA_DIR"))
    return given;
  std::error_code failed;
  const fs::path command = fs::read_symlink("/proc/self/exe", failed);
  if (failed)
    return "";
  for (const fs::path &folder : {command.parent_path() / "../share/bole", command.parent_path() / "../.."})
    if (isDataFolder(folder))
      return folder.lexically_normal().string();
  return "";
}

std::string findPreset(const std::string &name)
{
  std::error_code error;
  const std::string found = find(name, "config", {"", ".yaml"});
  if (name.empty() || name.find('/') != std::string::npos || fs::exists(found, error))
    return found;
  std::vector<std::string> names;
  for (const auto &entry : fs::directory_iterator(fs::path(dataFolder()) / "config", error))
    if (entry.path().extension() == ".yaml")
      names.push_back(entry.path().stem().string());
  std::sort(names.begin(), names.end());
  const std::string meant = nearestWord(fs::path(name).stem().string(), names);
  throw ioError("--config {}: no such file, and no preset of that name{}; presets: {}", name,
                meant.empty() ? "" : fmt::format(" (did you mean {}?)", meant), fmt::join(names, ", "));
}

std::string findSequence(const std::string &name) { return find(name, "data", {""}); }
std::string findModel(const std::string &name) { return find(name, "models", {"", ".xml", ".cao"}); }
} // namespace bole::apps
