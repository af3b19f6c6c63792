// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A factor graph as plain data: what the smoother solves, what a g2o file holds, what a reference
/// solver reads.

#include <bole/factors.h>

#include <cstdint>
#include <iosfwd>
#include <optional>
#include <string>
#include <vector>

namespace bole
{
/// Edges name vertices by their place in `poses` and `trunks`; the ids are the names in a file.
struct Graph
{
  /// A pose of the body.
  struct PoseVertex
  {
    std::int64_t id = 0; ///< as in the file
    Pose wMb;            ///< world from body
  };
  /// A trunk.
  struct TrunkVertex
  {
    std::int64_t id = 0; ///< as in the file
    Trunk trunk;         ///< in the world
    TrunkPrior prior;    ///< on its radius and lean
  };
  /// A prior on one pose.
  struct PosePriorEdge
  {
    std::size_t pose = 0; ///< index into Graph::poses
    PosePrior prior;      ///< absolute measurement
  };
  /// A measured step between two poses.
  struct OdometryEdge
  {
    std::size_t a = 0; ///< indices into Graph::poses
    std::size_t b = 0; ///< indices into Graph::poses
    Odometry odometry; ///< step and covariance
  };
  /// A relative rotation and direction of translation from point features.
  struct RelativePoseEdge
  {
    std::size_t a = 0;                   ///< indices into Graph::poses
    std::size_t b = 0;                   ///< indices into Graph::poses
    RelativePoseMeasurement measurement; ///< with its covariance
  };
  /// One view of a trunk, as its summary factor.
  struct ObservationEdge
  {
    std::size_t pose = 0;  ///< indices into Graph::poses and Graph::trunks
    std::size_t trunk = 0; ///< indices into Graph::poses and Graph::trunks
    SummaryFactor summary; ///< Eq. 9
  };

  Pose bMc;                                     ///< camera in the body frame
  Loss summary_loss;                            ///< on observations
  Loss direction_loss;                          ///< on relative poses from points
  std::vector<PoseVertex> poses;                ///< in the order of time
  std::vector<TrunkVertex> trunks;              ///< in the order in which they were found
  std::vector<PosePriorEdge> pose_priors;       ///< absolute measurements of poses
  std::vector<OdometryEdge> odometry;           ///< steps of the pose filter
  std::vector<RelativePoseEdge> relative_poses; ///< steps of the point features
  std::vector<ObservationEdge> observations;    ///< views of trunks
  std::string assumed;                          ///< by readG2o() where the file leaves it open, for its user
};

/// Sum of rho(|r|^2) / 2 over all factors and trunk priors at the values of the vertices. The
/// constant part of the summaries' energies is left out. Throws vpException(badValue) for a factor
/// that is none (see validate()).
double cost(const Graph &graph);

/// The first pose that no chain of odometry ties to a pose with a prior, by its place.
std::optional<std::size_t> untiedPose(const Graph &graph);

/// Throws vpException(badValue) naming the edge for anything no solver may be given: an index out
/// of range, an edge from a vertex to itself, NaN, a covariance or F that is clearly indefinite, a
/// sigma that is not positive, a pose that no chain of odometry and priors ties to the world.
void validate(const Graph &graph);

/// \p graph with every length multiplied by \p factor (> 0) about the origin of the world, as seen
/// from the camera (the lever arm bMc keeps its length): what a flight of unknown scale becomes
/// when its scale is found. The priors on radii stay: they are in metres already.
///
/// Laws (each a test): no residual but theirs changes; scaled(scaled(g, f), 1 / f) is g.
Graph scaled(const Graph &graph, double factor);

/// \name Graphs as g2o text
/// One vertex or edge a line, `#` starts a comment, numbers in SI, quaternions
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
/// | VERTEX_SE2, EDGE_SE2 | read alone: x y theta in place of t and quaternion, information (6): poses in the plane |
/// | EDGE_SE3_PRIOR | read alone: pose, id of a PARAMS_SE3OFFSET, then as above, of what the pose carries there |
/// | FIX | read alone: poses that stay where they are (to 1e-6) |
/// | PARAMS_SE3OFFSET | id, t (3), quaternion: bMc, the camera in the body |
/// | LOSS | summary or direction, quadratic, huber or cauchy, width |
///
/// EDGE_SE3:QUAT and VERTEX_SE3:QUAT are g2o's own: its rotation error is the vector part of the
/// quaternion, half our angle, so the information is scaled by 2 (mixed) and 4 (rotation). Numbers
/// have 17 digits: what is read back is what was written, to rounding. Where a file holds no pose, neither by a prior
/// nor by FIX, its first stays where it is, and Graph::assumed says so.
///@{

/// Throws vpException(ioError) where \p path cannot be written. Atomic: a temporary file beside it,
/// fsync, rename.
void writeG2o(const std::string &path, const Graph &graph);
/// The same to a stream.
void writeG2o(std::ostream &out, const Graph &graph);

/// Throws vpException "file:line: ..." for a file without a pose, an unknown tag, a wrong count of numbers, NaN, an id
/// used twice or never defined, an indefinite matrix, a pose that nothing ties to the world.
Graph readG2o(const std::string &path);
/// The same from a stream; \p name stands for the file in messages.
Graph readG2o(std::istream &in, const std::string &name);
///@}
} // namespace bole
