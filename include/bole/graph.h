// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A factor graph as plain data: what the smoother solves, what a g2o file holds, what a reference
/// solver reads.

#include <bole/factors.h>

#include <cstdint>
#include <optional>
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
  /// A measured height.
  struct HeightEdge
  {
    std::size_t pose = 0; ///< index into Graph::poses
    Height height;        ///< over the world's z = 0
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
  std::vector<HeightEdge> heights;              ///< of poses
  std::vector<ObservationEdge> observations;    ///< views of trunks
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
/// from the camera (the lever arm bMc keeps its length): what a flight of unknown scale becomes when
/// its metre is found. Heights and the priors on radii stay: they are what knows the metre.
///
/// Laws (each a test): no residual but theirs changes; scaled(scaled(g, f), 1 / f) is g.
Graph scaled(const Graph &graph, double factor);
} // namespace bole
