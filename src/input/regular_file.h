// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The one way to files that somebody else may have made: none of them makes a reader hang or eat the memory.

#include <fstream>
#include <string>
#include <vector>

namespace bole
{
/// Opens \p path for reading. A pipe, socket or device would hang or never end, so that only a regular file is opened
/// (links are followed). Every reader of a file opens it here.
/// \throw vpException(ioError) "path: what is there instead".
std::ifstream openRegularFile(const std::string &path);

/// All of a file of at most \p most_bytes. \throw vpException(ioError) naming it.
std::string readWholeFile(const std::string &path, std::size_t most_bytes);
/// All of a file that people write, at most 1 MB. \throw vpException(ioError) naming it.
std::string readSmallFile(const std::string &path);

/// The lines of a text, counted. A line of more than 100,000 characters is refused before it is in the memory; the byte
/// order mark of UTF-8 and the carriage returns of other systems are left out.
///
/// \code
/// TextLines lines("model.cao");
/// while (lines.next())
///   use(lines.line());
/// \endcode
class TextLines
{
public:
  /// As openRegularFile().
  explicit TextLines(const std::string &path);
  /// Reads from \p in, which messages call \p name.
  TextLines(std::istream &in, std::string name) : m_in(in), m_name(std::move(name)) {}

  TextLines(const TextLines &) = delete;
  TextLines &operator=(const TextLines &) = delete;

  /// False at the end. \throw vpException(ioError) "name:line: ...".
  bool next();
  const std::string &line() const { return m_line; }
  std::size_t number() const { return m_number; } ///< of the line, from 1
  const std::string &name() const { return m_name; }

private:
  std::ifstream m_file;
  std::istream &m_in;
  std::string m_name, m_line;
  std::size_t m_number = 0;
};

/// An element of the part of XML that settings and calibrations use (nested elements with text, comments, a
/// declaration): of an innermost one the text.
struct XmlElement
{
  std::string path; ///< "conf/camera/u0"
  std::string text; ///< without the blanks around it
  int line = 0;     ///< of its end
};

/// The elements of a file of at most 1 MB in the order of their ends, so that an element follows those in it.
/// Attributes are passed over. \throw vpException "path:line: ...".
std::vector<XmlElement> readXml(const std::string &path);
} // namespace bole
