// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/atomic_file.h"
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
  const fs::path target(m_path);
  m_temporary =
      (folderOf(m_path) / fmt::format(".{}.partial{}", target.stem().string(), target.extension().string())).string();
  if (fs::is_directory(target))
    throw ioError("{}: is a folder, must be a file", m_path);
  const int descriptor = ::open(m_temporary.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666);
  if (descriptor < 0)
    failWith(m_path, "cannot be written");
  ::close(descriptor);
}

bool AtomicFile::isTemporary(const std::string &name)
{
  return !name.empty() && name.front() == '.' && fs::path(name).stem().extension() == ".partial";
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
  const int descriptor = ::open(file.temporaryPath().c_str(), O_WRONLY | O_CLOEXEC);
  if (descriptor < 0)
    failWith(path, "cannot be written");
  std::size_t written = 0;
  while (written < content.size()) {
    const ssize_t count = ::write(descriptor, content.data() + written, content.size() - written);
    if (count < 0 && errno == EINTR)
      continue;
    if (count <= 0) {
      ::close(descriptor);
      failWith(path, "cannot be written");
    }
    written += static_cast<std::size_t>(count);
  }
  if (::close(descriptor) != 0)
    failWith(path, "cannot be written");
  file.commit();
}
} // namespace bole
