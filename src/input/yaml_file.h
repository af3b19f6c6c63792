// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The one place where YAML is read: no file makes a reader crash, hang or eat the memory.

#include <string>
#include <yaml-cpp/yaml.h>

namespace bole
{
/// The document in \p path, which may be walked without care: aliases are expanded in at most 100,000 nodes, nothing is
/// nested deeper than 32, and no alias holds itself.
/// \throw vpException(ioError) "path:line: ...".
YAML::Node loadYaml(const std::string &path);

/// All of a file that people write, at most 1 MB. \throw vpException(ioError) naming it.
std::string readSmallFile(const std::string &path);

/// "path:line" of \p mark.
std::string placeOf(const std::string &path, const YAML::Mark &mark);
} // namespace bole
