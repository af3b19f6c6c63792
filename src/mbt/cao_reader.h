// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A strict reader and a writer of ViSP's `.cao` models that hold trunks: cylinders and nothing else.
///
/// Format (V1): points; lines; faces from lines; faces from points; cylinders "i j radius" on two points;
/// circles. Each part starts with its count, `#` starts a comment, line endings may be those of Unix or Windows.
/// A cylinder may end in name="...". Everything that is not a cylinder, and every word that does not fit, is
/// refused: a model that is read in part would be tracked in part.

#include "geometry/cylinder.h"

#include <string>
#include <vector>

namespace bole
{
/// The cylinders of the model \p path in its own frame [m].
/// \throw vpException "path:line: what, must be what".
std::vector<Cylinder> readCao(const std::string &path);

/// Writes \p cylinders as a V1 model that ViSP's own trackers read too.
/// \throw vpException when the file cannot be written.
void writeCao(const std::string &path, const std::vector<Cylinder> &cylinders, const std::string &comment = "");
} // namespace bole
