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
#include "paper/tree_energy.h"
#include <bole/camera.h>
#include <bole/frame.h>
#include <bole/graph.h>
#include <bole/pose.h>
#include <bole/report.h>

#include <Eigen/Core>
#include <optional>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole::paper
{
// Section 5 of the paper, Eq. 10 to 17: the turn of the camera between two images, and which pixels move with it.
//
// The E-step (Eq. 10 and 11) asks each pixel which explains it better, the turn alone (background) or a wide
// distribution of flows (foreground); the velocity of the pixel is integrated out in closed form. The M-step (Eq. 16
// and 17) is one Gauss-Newton step on the turn given the labels. At full resolution, from the turn of the gyro.
//
// Slips of the print put right: Eq. 10 in the log domain (both likelihoods are 0/0 in double precision); Eq. 12 warps
// I(t-1) and Eq. 15 I(t): here pixel u of I(t) is compared with I(t-1) at u - v; Eq. 16 minimises the negative of what
// is printed.
//
// Laws (each a test): the labels are the integrals over all image velocities; the M-step is where the expected
// negative log-likelihood is least; V is what a turn does to the image.

constexpr double kIntensity = 0.02;             ///< sigma_I, noise of a pixel [full scale]
constexpr double kBackground_px = 0.15;         ///< of Sigma_b: flow about V omega
constexpr double kForeground_px = 3;            ///< of Sigma_f: flow about 0
constexpr int kEmIterations = 8;                ///< of EM
using FlowMatrix = Eigen::Matrix<double, 2, 3>; ///< V
using Turn = Eigen::Matrix3d;                   ///< pRc: current camera in the previous one, Exp(omega)

/// Eq. 14 [px/rad], with both focal lengths.
FlowMatrix flowMatrix(const PinholeCamera &camera, const Eigen::Vector2d &u_px);

/// An image with its gradient by central differences, 1 = full scale.
struct GreyImage
{
  vpImage<float> grey, by_x, by_y;

  GreyImage() = default;
  explicit GreyImage(const vpImage<unsigned char> &image);
};

/// What EM found.
struct TurnAndLabels
{
  Turn pRc = Turn::Identity();
  vpImage<float> log_ratio; ///< log of p(pixel | background) over p(pixel | foreground), 0 where nothing is known
};

/// \p start: of the iterations.
TurnAndLabels estimateTurn(const GreyImage &previous, const GreyImage &current, const PinholeCamera &camera,
                           const Turn &start, int iterations = kEmIterations);

// Section 6 of the paper, Eq. 18 to 21: new trees from one frame.
//
// Each vertical line is the left (right) border of a new salient tree with the probability that the negative
// (positive) part of the gradient along it is strong enough, that it lies on foreground, and that no known tree
// inhibits it; maxima above a threshold are paired, from the most probable on.
//
// Slips of the print put right: Q rises with x for a < 0 and takes the magnitude of the gradient (Eq. 19);
// p(non_inhib) = 1 - min(1, sum exp(-d^2 / (2 sigma_R^2))) (Eq. 21).
//
// Law (a test): the probabilities are the product of the three, each by brute force.

constexpr double kThreshold = 0.75; ///< "a fixed threshold"

/// Upper quartiles over all lines of all pictures of a flight, as `bole reproduce --statistics` prints them.
struct LineQuartiles
{
  double gradient = 0.042;   ///< of the mean of the blurred part (Eq. 19) [full scale/px]; data/park-forward's
  double foreground = 0.574; ///< of the mean of 1 - p(background) (Eq. 20)
};

/// Q of Eq. 19 and 20, its parameters "by inspection of the statistics of the data": one half at the quartile, nine
/// tenths at 1.2 times of it.
double probabilityOf(double value, double quartile);

/// The mean of an image along every vertical line through the camera: the camera turned level, a line is a column
/// q = tan(bearing from the heading), positive to the left.
struct LevelProfile
{
  Eigen::Matrix3d cRl = Eigen::Matrix3d::Identity(); ///< level frame (forward, left, up) to camera
  double step = 0.0025, q_first = 0;                 ///< q of sample i: q_first + step * i
  std::vector<double> mean;                          ///< 0 where most of the line is not in the image

  LevelProfile(const vpImage<float> &image, const PinholeCamera &camera, const Eigen::Matrix3d &wRc);
};

/// Columns of the level frame that a tree takes.
struct TakenRange
{
  double q_low = 0, q_high = 0;
};

struct NewTree
{
  RelativeTrunk relative;
  double p_left = 0, p_right = 0;
};

/// \p p_background: of each pixel; \p wRc: attitude of the camera; \p known: where the trees stand that are looked for.
std::vector<NewTree> detectTrees(const SplitGradient &gradient, const vpImage<float> &p_background,
                                 const PinholeCamera &camera, const Eigen::Matrix3d &wRc,
                                 const std::vector<TakenRange> &known, const LineQuartiles &quartiles);

/// sigma_R of Eq. 21 [px]: 6 px for a focal length of 200 px.
double inhibition_px(const PinholeCamera &camera);

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

private:
  /// What the map knows of a tree beside its place in the graph, which is its id.
  struct Tree
  {
    bool is_observed = true; ///< by the newest image; else it has ended
    int views = 0;
    double first_s = 0, last_s = 0;
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
