// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A reader and a writer of ViSP's `.cao` models of trunks, which are cylinders.
///
/// Format (V1): points; lines; faces from lines; faces from points; cylinders "i j radius" on two points; circles. Each
/// part starts with its count, `#` starts a comment, what stands behind the numbers of a line says nothing. A cylinder
/// may end in name=oak or name="old oak". As ViSP does the reader takes V2 and files that end before the cylinders or
/// the circles; lines, faces and circles are passed over. ViSP's own loader writes to the terminal, names no line, and
/// does not check the points of a cylinder.

#include "geometry/cylinder.h"

#include <string>
#include <vector>

namespace bole
{
/// The cylinders of the model \p path in its own frame [m], at least one.
/// \throw vpException "path:line: what, must be what".
std::vector<Cylinder> readCao(const std::string &path);
/// The same of a wood: all stand along z. \throw vpException "path: what, must be what".
std::vector<Cylinder> readTrunkModel(const std::string &path);

/// Writes \p cylinders as a V1 model that ViSP's own trackers read too.
/// \throw vpException when the file cannot be written.
void writeCao(const std::string &path, const std::vector<Cylinder> &cylinders, const std::string &comment = "");
} // namespace bole
