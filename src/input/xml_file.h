// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The part of XML that settings and calibrations use: nested elements with text, comments, a declaration.

#include <string>
#include <vector>

namespace bole
{
/// An element of a file: of an innermost one the text.
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
