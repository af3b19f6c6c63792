// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Files that are either the old one or the complete new one, whatever happens to the process.

#include <string>
#include <string_view>

namespace bole
{
/// A file that is written beside its place and moved there when complete: temporary name in the
/// same folder, fsync, rename, fsync of the folder. Without commit() the temporary file is removed.
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

  /// Whether \p name is that of a temporary file: of one that is being written, or was by a process that was killed.
  static bool isTemporary(const std::string &name);

private:
  std::string m_path;
  std::string m_temporary;
  bool m_is_committed = false;
};

/// \p content becomes the file \p path, atomically.
void writeAtomically(const std::string &path, std::string_view content);
} // namespace bole
