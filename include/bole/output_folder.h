// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Folders that a command writes into, and the only place where files are removed: what bole did not write stays.

#include <string>
#include <vector>

namespace bole
{
/// Files that a command writes, by their paths in its folder; a `*` stands for a whole number: "views/*.jpg".
using FileNames = std::vector<std::string>;

/// The first thing below \p folder that is none of \p names nor a folder of theirs, by its path in it; empty where
/// there is none.
std::string firstForeign(const std::string &folder, const FileNames &names);

/// Removes the regular files of \p names below \p folder (links are not followed), and those of their folders, itself
/// included, that are empty then.
void removeFiles(const std::string &folder, const FileNames &names);

/// Makes the folder and holds it for this process. What processes that were killed left half written is cleared.
///
/// \p names begins with the record: the JSON file with "complete" by which a later command knows that the others are
/// bole's. It is written at once; where it is not there they are somebody else's. Errors: vpException naming what is in
/// the way: one of \p names without a record, a link in the place of a folder, another process that writes, a folder
/// that cannot be made.
class OutputFolder
{
public:
  /// Makes \p path, or takes it where it holds nothing but \p names.
  OutputFolder(std::string path, const FileNames &names);
  ~OutputFolder();
  OutputFolder(const OutputFolder &) = delete;
  OutputFolder &operator=(const OutputFolder &) = delete;

  const std::string &path() const { return m_path; }                              ///< of the folder
  std::string file(const std::string &name) const { return m_path + "/" + name; } ///< path of \p name in it
  /// Whether no command wrote here before.
  bool isNew() const { return m_is_new; }

private:
  void refuseForeign(const FileNames &names) const;

  std::string m_path;
  int m_lock = -1;
  bool m_is_new = true;
};
} // namespace bole
