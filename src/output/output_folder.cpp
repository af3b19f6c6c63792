// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/output_folder.h>

#include "geometry/failure.h"
#include "input/atomic_file.h"
#include "input/regular_file.h"

#include <algorithm>
#include <fcntl.h>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <set>
#include <sys/file.h>
#include <unistd.h>

namespace bole
{
namespace fs = std::filesystem;
namespace
{
bool matches(const std::string &name, const std::string &path)
{
  const std::size_t star = name.find('*'), behind = name.size() - star - 1;
  if (star == std::string::npos)
    return path == name;
  if (path.size() <= name.size() - 1 || path.compare(0, star, name, 0, star) != 0 ||
      path.compare(path.size() - behind, behind, name, star + 1, behind) != 0)
    return false;
  const std::string number = path.substr(star, path.size() - behind - star);
  return number.find_first_not_of("0123456789") == std::string::npos;
}

bool isOneOf(const FileNames &names, const std::string &path)
{
  return std::any_of(names.begin(), names.end(), [&](const std::string &name) { return matches(name, path); });
}

/// Returns the folders that \p names stand in, the innermost first.
std::vector<std::string> foldersOf(const FileNames &names)
{
  std::set<std::string, std::greater<>> folders;
  for (const std::string &name : names)
    for (fs::path parent = fs::path(name).parent_path(); !parent.empty(); parent = parent.parent_path())
      folders.insert(parent.string());
  return {folders.begin(), folders.end()};
}

/// Returns those of \p names that exist in \p folder, whatever they are; it follows no links.
std::vector<std::string> presentOf(const std::string &folder, const FileNames &names)
{
  std::vector<std::string> folders = foldersOf(names), present;
  folders.emplace_back();
  for (const std::string &inner : folders) {
    const fs::path path = fs::path(folder) / inner;
    if (!inner.empty() && !fs::is_directory(fs::symlink_status(path)))
      continue;
    for (const auto &entry : fs::directory_iterator(path))
      if (const std::string name = (fs::path(inner) / entry.path().filename()).string(); isOneOf(names, name))
        present.push_back(name);
  }
  return present;
}

/// Tells whether \p path is what a command of bole writes about itself.
bool isRecord(const std::string &path)
{
  constexpr std::size_t kMostBytes = 16'000'000;
  const auto json = nlohmann::json::parse(readWholeFile(path, kMostBytes), nullptr, false);
  return json.is_object() && (json.contains("complete") || json.contains("versions"));
}
} // namespace

std::string firstForeign(const std::string &folder, const FileNames &names)
{
  const std::vector<std::string> folders = foldersOf(names);
  for (const auto &entry : fs::recursive_directory_iterator(folder)) {
    const fs::file_status status = entry.symlink_status();
    const std::string name = entry.path().lexically_relative(folder).string();
    if (fs::is_directory(status) ? std::find(folders.begin(), folders.end(), name) == folders.end()
                                 : !fs::is_regular_file(status) || !isOneOf(names, name))
      return name;
  }
  return {};
}

void removeFiles(const std::string &folder, const FileNames &names)
{
  if (!fs::is_directory(fs::symlink_status(folder)))
    return;
  for (const std::string &name : presentOf(folder, names))
    if (const fs::path file = fs::path(folder) / name; fs::is_regular_file(fs::symlink_status(file)))
      fs::remove(file);
  std::error_code is_not_empty;
  for (const std::string &inner : foldersOf(names))
    fs::remove(fs::path(folder) / inner, is_not_empty);
  fs::remove(folder, is_not_empty);
}

OutputFolder::OutputFolder(std::string path, const FileNames &names) : m_path(std::move(path))
{
  std::error_code error;
  fs::create_directories(m_path, error);
  if (error)
    throw ioError("{}: cannot be made: {}", m_path, error.message());
  refuseForeign(names);
  m_is_new = !fs::exists(file(names.front()));
  m_lock = ::open(m_path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (m_lock < 0)
    throw ioError("{}: cannot be opened", m_path);
  if (::flock(m_lock, LOCK_EX | LOCK_NB) != 0) {
    ::close(m_lock);
    throw ioError("{}: another run writes into this folder", m_path);
  }
  for (const auto &entry : fs::directory_iterator(m_path, error))
    if (isOneOf(names, AtomicFile::targetOf(entry.path().filename().string())) &&
        fs::is_regular_file(entry.symlink_status()))
      fs::remove(entry.path(), error);
  if (m_is_new)
    writeAtomically(file(names.front()), "{\"complete\": false}\n");
}

OutputFolder::~OutputFolder() { ::close(m_lock); }

void OutputFolder::refuseForeign(const FileNames &names) const
{
  const std::string record = file(names.front());
  if (fs::exists(record)) {
    if (!isRecord(record))
      throw ioError("{}: was not written by bole, must not be lost: choose another folder", record);
  }
  else if (const auto present = presentOf(m_path, names); !present.empty())
    throw ioError("{}: was not written by bole (there is no {}), must not be lost: choose another folder",
                  file(present.front()), names.front());
  for (const std::string &inner : foldersOf(names))
    if (const auto status = fs::symlink_status(file(inner)); fs::exists(status) && !fs::is_directory(status))
      throw ioError("{}: is a {}, must be a folder", file(inner), fs::is_symlink(status) ? "link" : "file");
}
} // namespace bole
