// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A trunk of the model as a feature of virtual visual servoing: predicted borders, found places, residuals.
///
/// Idea: each border is cut into pieces. In each, the place of strongest mean signed contrast across the predicted
/// border is found (tracking/border_profile.h), and the residual is the distance of that place from the border's line,
/// in the image plane at z = 1. A piece is worth a long line of moving edges whose votes are averaged before the
/// decision.
///
/// The residual of a point m = (x, y, 1) and the silhouette plane with unit normal n (out of the trunk) is
/// e = n.m / sqrt(n_x^2 + n_y^2). With the axis a, b = a x n and a point p of the axis, all in the camera frame,
/// the plane obeys n.a = 0 and n.p = -r; under a camera velocity (v, w) its normal moves by
///   dn = alpha a + beta b,  alpha = w.b,  beta = (n.v + w.(p x n) - alpha a.p) / (b.p),
/// from which L = de/d(v, w): a row (1x6) in ViSP's convention, e + L * twist. Exact for every direction.
/// A radius that grows by dr turns the normal by dn = -dr / (b.p) b.
///
/// Laws (each a test): L agrees with central differences of the residual; the residual of a point of the
/// border is zero; L of an upright trunk has no component along the axis, and none about it.

#include "geometry/silhouette.h"
#include "tracking/border_profile.h"
#include <bole/cylinder.h>

#include <bole/vpMbTrunkTracker.h>

namespace bole
{
using Row6d = Eigen::Matrix<double, 1, 6>;

/// The silhouette plane of one border and how it moves.
class BorderPlane
{
public:
  BorderPlane() = default;
  BorderPlane(const Cylinder &c, const RelativeTrunk &relative, Border side);
  const Eigen::Vector3d &normal() const { return m_n; }
  /// Distance of the image point \p m = (x, y, 1) from the border, positive outside the trunk.
  double residual(const Eigen::Vector3d &m) const { return m_n.dot(m) / m_h; }
  /// Its derivatives by the twist of the camera and by the logarithm of the radius.
  void derive(const Eigen::Vector3d &m, Row6d &by_twist, double &by_log_radius) const;
  /// How far [px] the border moves sideways in the image (rows, or columns where \p is_flat) at \p m under a twist.
  Row6d sideways(const PinholeCamera &camera, const Eigen::Vector3d &m, bool is_flat) const;

private:
  Eigen::Vector3d m_n, m_a, m_b, m_beta_v, m_beta_w;
  double m_h = 1, m_beta_radius = 0;
};

constexpr int kPieces = 4;    ///< of a border: more follow a bow, fewer average more
constexpr int kSamples = 32;  ///< rows that are read along a border
constexpr int kMemory_px = 6; ///< half-width of the remembered profile

/// What one piece of a border says about the pose.
struct FoundPiece
{
  Eigen::Vector3d m = Eigen::Vector3d::Zero(); ///< where the border was found, at z = 1
  double share = 0;                            ///< of the border's length that it stands for, 0 .. 1 / kPieces
  bool used = false;
  // at the pose of the last linearise()
  double residual = 0, by_log_radius = 0, robust = 1;
  Row6d by_twist = Row6d::Zero();
};

/// One border: what is predicted, what is found, what is remembered.
struct ModelBorder
{
  bool visible = false;
  ImageBorder image;                               ///< predicted
  BorderPlane plane;                               ///< predicted, later that of the last linearise()
  Row6d sideways_by_twist = Row6d::Zero();         ///< [px], of its middle
  std::vector<int> rows;                           ///< rows (columns) that are read; -1: behind another trunk
  std::array<std::vector<float>, kPieces> profile; ///< mean grey level at the offsets of the last scan, a piece each
  std::array<float, kPieces> seen{};               ///< share of each piece that was read
  std::array<double, kPieces> centre{};            ///< mean row of each piece
  std::vector<float> whole, contrast;              ///< of the whole border
  std::vector<BorderPeak> peaks;
  int chosen = -1; ///< peak that the pieces follow
  std::array<FoundPiece, kPieces> pieces;

  std::optional<double> known_contrast; ///< signed, mean over the frames before [grey levels a pixel]
  int known_frames = 0;
  bool known_is_flat = false;
  std::vector<float> known_profile; ///< grey across the border in the frames before, kMemory_px to each side

  /// How well the last scan at \p offset_px looks like the frames before: normalised correlation of the profiles,
  /// -1 .. 1; 0 where nothing is remembered or the scan did not reach.
  double likeness(int offset_px) const;
  bool hasKnownSign() const { return known_frames >= 2; }
};

class ModelTrunk
{
public:
  using Options = vpMbTrunkTracker::Options;
  explicit ModelTrunk(const Cylinder &object) : m_object(object) {}
  const Cylinder &object() const { return m_object; }
  const Cylinder &inCamera() const { return m_camera; }
  const RelativeTrunk &relative() const { return m_relative; }
  double distance() const { return m_camera.radius / m_relative.ratio(); } ///< of the axis [m]

  /// Projects the trunk at \p cMo into the image of \p camera: borders, ends, visibility. \p margin_px is kept off the
  /// edge of the image.
  void predict(const Pose &cMo, const PinholeCamera &camera, const Options &options, double margin_px = 4);
  /// Takes out the rows hidden by \p nearer, both predicted at the same pose.
  void hideBehind(const ModelTrunk &nearer, const PinholeCamera &camera, const Options &options);
  bool isVisible() const { return m_borders[0].visible || m_borders[1].visible; }
  void makeInvisible() { m_borders[0].visible = m_borders[1].visible = false; }

  /// Reads the profiles of both borders over +-half_px and finds their maxima; chooses none.
  void scan(const vpImage<unsigned char> &I, int half_px, double min_contrast);
  /// Follows peak \p chosen of a border (-1: none): each piece takes its own maximum of the same sign within
  /// \p reach_px of it.
  void choose(ModelBorder &border, int chosen, double reach_px, const PinholeCamera &camera, double min_contrast);
  /// Residuals and derivatives of the found pieces at \p cMo.
  void linearise(const Pose &cMo);
  /// Keeps contrast and profile of the chosen peaks for the frames to come.
  void remember();
  void forget();

  std::array<ModelBorder, 2> &borders() { return m_borders; }
  const std::array<ModelBorder, 2> &borders() const { return m_borders; }

private:
  Cylinder m_object, m_camera;
  RelativeTrunk m_relative;
  std::array<ModelBorder, 2> m_borders;
};
} // namespace bole
