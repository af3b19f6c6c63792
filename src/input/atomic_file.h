// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Files that are either the old one or the complete new one, whatever happens to the process.

#include <string>
#include <string_view>

namespace bole
{
/// A file that is written beside its place and moved there when complete: temporary name in the same folder that no
/// other file has, fsync, rename, fsync of the folder. Without commit() the temporary file is removed. A link in its
/// place is replaced, not written through; a folder, pipe or device there is refused.
///
/// \code
/// AtomicFile file("run/overlay.mp4");
/// encodeTo(file.temporaryPath());   // same extension as the target
/// file.commit();
/// \endcode
class AtomicFile
{
public:
  /// Throws vpException when the folder of \p path cannot be written to.
  explicit AtomicFile(std::string path);
  ~AtomicFile();
  AtomicFile(const AtomicFile &) = delete;
  AtomicFile &operator=(const AtomicFile &) = delete;

  const std::string &path() const { return m_path; }
  const std::string &temporaryPath() const { return m_temporary; }
  /// Puts the file in its place. Throws vpException naming it when the disk says no.
  void commit();

  /// The name that the file \p name was to have if it is a temporary one: one that is being written, or was by a
  /// process that was killed. Empty for others.
  static std::string targetOf(const std::string &name);

private:
  std::string m_path;
  std::string m_temporary;
  bool m_is_committed = false;
};

/// \p content becomes the file \p path, atomically.
void writeAtomically(const std::string &path, std::string_view content);

/// A file that grows line by line: a process that is killed leaves all lines until then. Errors: vpException naming it.
class GrowingFile
{
public:
  /// \p head takes the place of what was there.
  GrowingFile(std::string path, std::string_view head);
  ~GrowingFile();
  GrowingFile(const GrowingFile &) = delete;
  GrowingFile &operator=(const GrowingFile &) = delete;

  void add(std::string_view line);

private:
  std::string m_path;
  int m_descriptor = -1;
};
} // namespace bole
