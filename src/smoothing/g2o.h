// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Graphs as g2o text: one vertex or edge a line, `#` starts a comment, numbers in SI, quaternions
/// x y z w, symmetric matrices as their upper triangle by rows.
///
/// | tag | then |
/// |---|---|
/// | VERTEX_SE3:QUAT | id, t (3), quaternion: wMb |
/// | VERTEX_TRUNK | id, x y log_r lean_x lean_y, the same five of its prior's mean, five sigmas |
/// | EDGE_SE3:QUAT | a b, t (3), quaternion: aMb, information (21) of (t, vector part of the
///   quaternion) |
/// | EDGE_SE3_PRIOR:QUAT | pose, t (3), quaternion, information (21) as above |
/// | EDGE_TRUNK_SUMMARY | pose trunk, quaternion of cRt, log(r/d), e, f (4), F (10), tangent (phi,
///   d log s) |
/// | EDGE_DIRECTION | a b, quaternion of caRcb, direction (3), covariance (15), see
///   RelativePoseMeasurement |
/// | EDGE_HEIGHT | pose, z, sigma |
/// | PARAMS_SE3OFFSET | id, t (3), quaternion: bMc, the camera in the body |
/// | LOSS | summary or direction, quadratic, huber or cauchy, width |
///
/// EDGE_SE3:QUAT and VERTEX_SE3:QUAT are g2o's own: its rotation error is the vector part of the
/// quaternion, half our angle, so the information is scaled by 2 (mixed) and 4 (rotation). Numbers
/// have 17 digits: what is read back is what was written, to rounding.

#include <bole/graph.h>

#include <iosfwd>

namespace bole
{
/// Throws vpException(ioError) where \p path cannot be written. Atomic: a temporary file beside it,
/// fsync, rename.
void writeG2o(const std::string &path, const Graph &graph);
void writeG2o(std::ostream &out, const Graph &graph);

/// Throws vpException "file:line: ..." for an unknown tag, a wrong count of numbers, NaN, an id
/// used twice or never defined, an indefinite matrix, a pose that nothing ties to the world.
Graph readG2o(const std::string &path);
Graph readG2o(std::istream &in, const std::string &name);
} // namespace bole
