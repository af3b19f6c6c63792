// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Eq. 3 of the paper: the energy of one tree in one image, what it is to second order, and its minimum (Eq. 9).
///
/// A cylinder has no ends (theta is x, y and r), so a border is summed over the whole height of the image, one sample a
/// row: the negative part of the gradient on the left border, the positive one on the right.
///
/// Laws (each a test): the energy is Eq. 3 summed by brute force over the image; gradient and Hessian are its
/// differences; convexified() keeps the gradient and asks for no more than a pixel.
#include <bole/camera.h>
#include <bole/graph.h>
#include <bole/summary_factor.h>

#include <optional>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole::paper
{
/// min(0, dI/dx) and max(0, dI/dx) by Sobel [full scale/px], each blurred with sigma = 3 px (Section 4.1).
struct SplitGradient
{
  vpImage<float> negative, positive;
};
SplitGradient splitGradient(const vpImage<unsigned char> &image);

/// One border in the image: the column x + slope * v on each row v of [begin, end).
struct BorderInImage
{
  int begin = 0, end = 0; ///< none where the border is not in the image, or less steep than 45 degrees
  double x = 0, slope = 0;
  Eigen::Matrix<double, 3, 4> by_tree; ///< by the tangent of the tree a pixel moves sideways by its ray . by_tree

  double columnAt(int v) const { return x + slope * v; }
};
BorderInImage borderInImage(const PinholeCamera &camera, const RelativeTrunk &tree, Border border);

/// Steps of the tangent of \p tree that move an end of one of its borders by a pixel, none longer than a tenth.
Vector4d pixelSteps(const PinholeCamera &camera, const RelativeTrunk &tree);

/// Eq. 3. Keeps a reference to the gradient.
class TreeEnergy
{
public:
  TreeEnergy(const SplitGradient &gradient, const PinholeCamera &camera, double alpha)
      : m_gradient(gradient), m_camera(camera), m_alpha(alpha)
  {
  }

  const PinholeCamera &camera() const { return m_camera; }
  /// At \p tree, with its derivative by the tangent in \p f where not null.
  double evaluate(const RelativeTrunk &tree, Vector4d *f = nullptr) const;
  /// To second order about \p tree: F by central differences of the gradient, of any signs.
  SummaryFactor expand(const RelativeTrunk &tree) const;

private:
  const SplitGradient &m_gradient;
  PinholeCamera m_camera;
  double m_alpha;
};

/// Whether the quadratic has a minimum, in each direction of the tangent.
bool isConvex(const SummaryFactor &summary, const Vector4d &steps);

/// The same value and gradient with a Hessian that is positive and lets the image move a border by a pixel at most (the
/// basin of Eq. 3 is the blur, three pixels wide): one step downhill from wherever it starts.
SummaryFactor convexified(SummaryFactor summary, const Vector4d &steps);

/// "We non-linearly optimize the relative tree parameters to maximize the true measurement likelihood before computing"
/// the quadratic: the minimum of the tree's own energy below \p start, in all four directions, by Newton steps that are
/// halved until the energy falls. Nothing where that ends on no minimum.
std::optional<SummaryFactor> minimised(const TreeEnergy &energy, const RelativeTrunk &start);

// Eq. 2 and Fig. 2 of the paper: the optimum of all poses and trees by odometry, priors and summary factors, together
// with the energies (Eq. 3 and 4) of the newest image.
//
// Levenberg-Marquardt: the energies are expanded anew where each step leads, and a step is taken only where the sum of
// the energies themselves and of all other factors falls. So it ends, and what it leaves is never worse than what it
// was given; where the image has no minimum it stops at the best there is. Without that test the sum grows without
// end where views contradict each other by more than alpha allows.
//
// Laws (each a test): the sum never rises; where it ends no move of a pose or a tree lowers it.

/// Moves the poses and trees of \p graph to the joint optimum. \p image: of the newest pose, or nullptr; \p observed:
/// the trees that it observes, by their place in Graph::trunks.
/// \throw vpException where the sum is no number
void optimiseJointly(Graph &graph, const TreeEnergy *image = nullptr, const std::vector<std::size_t> &observed = {});

/// Marginal covariance of each tree at the optimum, in the tangent of Trunk.
std::vector<Matrix5d> treeCovariances(const Graph &graph);
} // namespace bole::paper
