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
  struct PoseVertex
  {
    std::int64_t id = 0;
    Pose wMb;
  };
  struct TrunkVertex
  {
    std::int64_t id = 0;
    Trunk trunk;
    TrunkPrior prior;
  };
  struct PosePriorEdge
  {
    std::size_t pose = 0;
    PosePrior prior;
  };
  struct OdometryEdge
  {
    std::size_t a = 0, b = 0;
    Odometry odometry;
  };
  struct RelativePoseEdge
  {
    std::size_t a = 0, b = 0;
    RelativePoseMeasurement measurement;
  };
  struct HeightEdge
  {
    std::size_t pose = 0;
    Height height;
  };
  struct ObservationEdge
  {
    std::size_t pose = 0, trunk = 0;
    SummaryFactor summary;
  };

  Pose bMc;            ///< camera in the body frame
  Loss summary_loss;   ///< on observations
  Loss direction_loss; ///< on relative poses from points
  std::vector<PoseVertex> poses;
  std::vector<TrunkVertex> trunks;
  std::vector<PosePriorEdge> pose_priors;
  std::vector<OdometryEdge> odometry;
  std::vector<RelativePoseEdge> relative_poses;
  std::vector<HeightEdge> heights;
  std::vector<ObservationEdge> observations;
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
