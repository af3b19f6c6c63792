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
#include <bole/vpMbTrunkTracker.h>

#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// The cylinders of the model \p path in its own frame [m], at least one.
/// \throw vpException "path:line: what, must be what".
std::vector<Cylinder> readCao(const std::string &path);
/// The same of a wood: all stand along z. \throw vpException "path: what, must be what".
std::vector<Cylinder> readTrunkModel(const std::string &path);

// ViSP's XML settings of a model-based tracker, with a section of our own.
//
// Read are `camera` (u0, v0, px, py), `face` (angles, clipping) and `trunk`; the sections of ViSP's other
// trackers (`ecm`, `klt`, ...) are passed over, so that one file serves both. In `trunk` every key is one of
// vpMbTrunkTracker::Options, and a key or value that does not fit is refused with file and line:
// \code{.xml}
// <conf>
//   <camera><u0>159.5</u0><v0>119.5</v0><px>200</px><py>200</py></camera>
//   <face><near_clipping>0.1</near_clipping><far_clipping>15</far_clipping><fov_clipping>1</fov_clipping></face>
//   <trunk><border_sigma_px>1.5</border_sigma_px><scan_max_px>24</scan_max_px></trunk>
// </conf>
// \endcode

struct TrunkSettings
{
  vpMbTrunkTracker::Options options;
  bool has_camera = false;
  vpCameraParameters camera;
  std::optional<double> near_clipping, far_clipping;   ///< [m]
  std::optional<double> angle_appear, angle_disappear; ///< [rad]
  bool fov_clipping = false;
};

/// Settings of the file \p path; options that it does not name keep the values of \p options.
/// \throw vpException "path:line: key = value, must be ...".
TrunkSettings readTrunkSettings(const std::string &path, const vpMbTrunkTracker::Options &options,
                                bool verbose = false);
} // namespace bole
