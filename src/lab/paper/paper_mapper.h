// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// R. Roberts, D.-N. Ta, J. Straub, K. Ok and F. Dellaert, Saliency Detection and Model-based Tracking, SPIE 2012: its
/// method as printed, from frames to a map, to compare with. src/doc/paper.md goes through its equations and says what
/// had to be decided where it is silent.
///
/// Idea: a pair of lines that the detector finds is a tree at once (Eq. 18 to 21). The trees that the frame before
/// observed are observed again: their energies (Eq. 3 and 4) are optimised together with the pose, all other trees and
/// what the earlier frames left (Eq. 2, Fig. 2). At the minimum of its own energy next to where that leaves it the
/// image of a tree becomes a summary factor for ever (Eq. 9). A tree whose energy has no minimum there is observed no
/// more: it stays in the map, and nothing is ever associated with it.
///
/// Laws (each a test): a tree is in the map from the frame that finds it; one that ends stays, and what is found in its
/// place is another tree; one that is observed keeps others out; the motion is the pose filter's relative pose alone.

#include "paper/line_detector.h"
#include "paper/rotation_em.h"
#include <bole/frame.h>
#include <bole/graph.h>
#include <bole/report.h>

#include <optional>
#include <vector>

namespace bole::paper
{
constexpr double kPrintedAlpha = 1000; ///< weight of Eq. 3 without a unit; here for gradients in full scale a pixel

/// The turn of the camera over the samples of the gyro between two stamps, where they cover it: what EM starts from.
std::optional<Turn> gyroTurn(const std::vector<GyroSample> &samples, std::int64_t from_ns, std::int64_t to_ns,
                             const Pose &bMc);

/// Labels of image after image (Section 5).
class Saliency
{
public:
  explicit Saliency(const PinholeCamera &camera) : m_camera(camera) {}

  /// p(background) of each pixel: one half in the first image. \p turn: since the image before, where it is known;
  /// else the last one is held.
  const vpImage<float> &update(const vpImage<unsigned char> &image, const std::optional<Turn> &turn);
  const vpImage<float> &background() const { return m_background; }

private:
  PinholeCamera m_camera;
  std::optional<GreyImage> m_previous;
  Turn m_turn = Turn::Identity();
  vpImage<float> m_background;
};

/// From frames to a map and a trajectory.
class PaperMapper
{
public:
  PaperMapper(const PinholeCamera &camera, const Pose &bMc, double alpha, const LineQuartiles &quartiles);

  /// \throw vpException where the frame has no pose of the pose filter: the method has no such case
  FrameReport process(const Frame &frame);
  /// Smooths the flight once more; the covariances of the map are known after it.
  void finish();

  std::vector<TrunkRecord> map() const;
  Trajectory smoothedTrajectory() const;
  const Graph &graph() const { return m_graph; }

private:
  /// What the map knows of a tree beside its place in the graph, which is its id.
  struct Tree
  {
    bool is_observed = true; ///< by the newest image; else it has ended
    int views = 0;
    double first_s = 0, last_s = 0;
    RelativeTrunk relative;
  };

  void addPose(const Frame &frame);
  std::vector<TakenRange> takenRanges() const;
  void instantiate(const SplitGradient &gradient);
  std::vector<TrunkInView> summarise(const TreeEnergy &energy, std::size_t known, double time_s);
  RelativeTrunk seen(std::size_t tree) const;
  Pose camera() const { return m_graph.poses.back().wMb * m_graph.bMc; }

  PinholeCamera m_camera;
  double m_alpha;
  LineQuartiles m_quartiles;
  Saliency m_saliency;
  Graph m_graph;
  std::vector<Tree> m_trees;           ///< as Graph::trunks
  std::vector<Matrix5d> m_covariances; ///< the same, after finish()
  Trajectory m_odometry;               ///< of the pose filter
};
} // namespace bole::paper
