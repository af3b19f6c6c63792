// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A reader of ViSP's `.cao` models of trunks, which are cylinders; writeCao() of bole/cylinder.h writes them.
///
/// Format (V1): points; lines; faces from lines; faces from points; cylinders "i j radius" on two points; circles. Each
/// part starts with its count, `#` starts a comment, what stands behind the numbers of a line says nothing. A cylinder
/// may end in name=oak or name="old oak". As ViSP does the reader takes V2 and files that end before the cylinders or
/// the circles; lines, faces and circles are passed over. ViSP's own loader writes to the terminal, names no line, and
/// does not check the points of a cylinder.

#include <bole/cylinder.h>

#include <string>
#include <vector>

namespace bole
{
/// The cylinders of the model \p path in its own frame [m], at least one.
/// \throw vpException "path:line: what, must be what".
std::vector<Cylinder> readCao(const std::string &path);
/// The same of a wood: all stand along z. \throw vpException "path: what, must be what".
std::vector<Cylinder> readTrunkModel(const std::string &path);
} // namespace bole
