// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/atomic_file.h"
#include "geometry/failure.h"

#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <filesystem>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

namespace bole
{
namespace fs = std::filesystem;
namespace
{
[[noreturn]] void failWith(const std::string &path, const char *what)
{
  throw ioError("{}: {}: {}", path, what, std::strerror(errno));
}

fs::path folderOf(const std::string &path)
{
  const fs::path parent = fs::path(path).parent_path();
  return parent.empty() ? fs::path(".") : parent;
}

bool writeAll(int descriptor, std::string_view content)
{
  while (!content.empty()) {
    const ssize_t count = ::write(descriptor, content.data(), content.size());
    if (count < 0 && errno == EINTR)
      continue;
    if (count <= 0)
      return false;
    content.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

/// Waits until the disk has \p path.
bool flushToDisk(const std::string &path, int flags)
{
  const int descriptor = ::open(path.c_str(), flags | O_CLOEXEC);
  if (descriptor < 0)
    return false;
  const bool is_done = ::fsync(descriptor) == 0;
  return ::close(descriptor) == 0 && is_done;
}
} // namespace

AtomicFile::AtomicFile(std::string path) : m_path(std::move(path))
{
  constexpr int kMost = 1000; // temporary files of one name, left by as many processes that were killed
  const fs::path target(m_path);
  if (std::error_code error; fs::exists(target, error) && !fs::is_regular_file(target, error))
    throw ioError("{}: is a {}, must be a file", m_path,
                  fs::is_directory(target, error) ? "folder" : "pipe, socket or device");
  int descriptor = -1;
  for (int other = 0; descriptor < 0; ++other) {
    const std::string name = fmt::format(".{}{}.partial{}", target.stem().string(),
                                         other == 0 ? "" : fmt::format("~{}", other), target.extension().string());
    m_temporary = (folderOf(m_path) / name).string();
    descriptor = ::open(m_temporary.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor < 0 && (errno != EEXIST || other == kMost))
      failWith(m_path, "cannot be written");
  }
  ::close(descriptor);
}

std::string AtomicFile::targetOf(const std::string &name)
{
  const fs::path path(name), stem = path.stem();
  if (name.empty() || name.front() != '.' || stem.extension() != ".partial")
    return {};
  const std::string target = stem.stem().string().substr(1);
  return target.substr(0, target.rfind('~')) + path.extension().string();
}

AtomicFile::~AtomicFile()
{
  if (!m_is_committed)
    ::unlink(m_temporary.c_str());
}

void AtomicFile::commit()
{
  if (!flushToDisk(m_temporary, O_RDONLY))
    failWith(m_path, "cannot be flushed to disk");
  if (::rename(m_temporary.c_str(), m_path.c_str()) != 0)
    failWith(m_path, "cannot be put in place");
  m_is_committed = true;
  flushToDisk(folderOf(m_path).string(), O_RDONLY | O_DIRECTORY);
}

void writeAtomically(const std::string &path, std::string_view content)
{
  AtomicFile file(path);
  const int descriptor = ::open(file.temporaryPath().c_str(), O_WRONLY | O_NOFOLLOW | O_CLOEXEC);
  const bool is_written = descriptor >= 0 && writeAll(descriptor, content);
  if (descriptor < 0 || ::close(descriptor) != 0 || !is_written)
    failWith(path, "cannot be written");
  file.commit();
}

GrowingFile::GrowingFile(std::string path, std::string_view head) : m_path(std::move(path))
{
  writeAtomically(m_path, head);
  m_descriptor = ::open(m_path.c_str(), O_WRONLY | O_APPEND | O_NOFOLLOW | O_CLOEXEC);
  if (m_descriptor < 0)
    failWith(m_path, "cannot be written");
}

GrowingFile::~GrowingFile() { ::close(m_descriptor); }

void GrowingFile::add(std::string_view line)
{
  if (!writeAll(m_descriptor, line))
    failWith(m_path, "cannot be written");
}
} // namespace bole
