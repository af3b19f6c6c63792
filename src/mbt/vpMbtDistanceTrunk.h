// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A trunk as a feature of ViSP's virtual visual servoing: the counterpart of vpMbtDistanceCylinder.
///
/// Idea: each border is cut into a few pieces; in each the place of strongest mean signed contrast is found
/// across the predicted border (see tracking/border_profile.h), and the feature is the distance between that
/// place and the border's line, in the image plane at z = 1. A piece is worth a long line of moving edges whose
/// votes have been averaged before, not after, the decision.
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
///
/// \code
/// vpMbtDistanceTrunk trunk;
/// trunk.buildFrom(vpPoint(5, 1, 0), vpPoint(5, 1, 3), 0.15);
/// trunk.setCameraParameters(cam);
/// trunk.predict(cMo, I.getWidth(), I.getHeight());
/// trunk.search(I, 6);
/// trunk.initInteractionMatrixError();
/// trunk.computeInteractionMatrixError(cMo); // trunk.L, trunk.error: stack them with other features
/// \endcode

#include "mbt/border_profile.h"

#include <array>
#include <string>
#include <vector>
#include <visp3/core/vpCameraParameters.h>
#include <visp3/core/vpColVector.h>
#include <visp3/core/vpHomogeneousMatrix.h>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpMatrix.h>
#include <visp3/core/vpPoint.h>

class vpMbtDistanceTrunk
{
public:
  struct Options
  {
    int pieces = 4;            ///< of a border (1 .. 16): more follow a bow, fewer average more
    int samples = 32;          ///< along a border (8 .. 400)
    double near_m = 0.1;       ///< parts nearer to the camera plane are not used (0.001 .. 10)
    double margin_px = 3;      ///< kept off the edge of the image (0 .. 50)
    double min_length_px = 30; ///< shorter borders are not used (4 .. 1000)
    double min_width_px = 4;   ///< thinner trunks are not used: their borders blur into each other (1 .. 100)
    double min_contrast = 1.0; ///< weaker maxima are no border, grey levels a pixel (0 .. 50)
    /// Throws vpException "name = value, must be ...".
    void validate() const;
  };

  /// The word of one piece of a border on the pose.
  struct Piece
  {
    Eigen::Vector2d found_px = Eigen::Vector2d::Zero(); ///< where the border was found
    double contrast = 0;                                ///< signed, grey levels a pixel
    double share = 0;                                   ///< of its length that was visible
    bool used = false;
  };

  /// One border: what is predicted, what is found, what is remembered.
  struct BorderState
  {
    bool visible = false;
    bole::VisibleBorder line;    ///< predicted
    std::vector<bool> hidden;    ///< samples behind another trunk
    bole::BorderProfile profile; ///< last search
    std::vector<float> whole;    ///< its mean over the whole border
    std::vector<float> contrast; ///< of the whole border at each offset of the last search
    std::vector<bole::ContrastPeak> peaks;
    int chosen = -1; ///< peak of the whole border that the pieces follow
    std::vector<Piece> pieces;
    double remembered_contrast = 0; ///< signed, mean over the frames before; 0: none yet
    int remembered_frames = 0;
    std::vector<float> remembered_profile; ///< grey across the border in the frames before, kProfileReach to each side

    /// How well the last search at \p offset_px looks like the frames before: normalised correlation of the
    /// profiles, -1 .. 1; 0 where nothing is remembered or the search did not reach.
    double likeness(int offset_px) const;
  };
  static constexpr int kProfileReach = 6; ///< [px]

  vpMbtDistanceTrunk();
  explicit vpMbtDistanceTrunk(const Options &options);

  /// Trunk of radius \p r [m] round the segment p1 p2 of the object frame (world coordinates of the points).
  void buildFrom(const vpPoint &p1, const vpPoint &p2, double r);
  void buildFrom(const bole::Cylinder &o_cylinder) { m_object = o_cylinder; }
  void setCameraParameters(const vpCameraParameters &cam) { m_cam = cam; }
  void getCameraParameters(vpCameraParameters &cam) const { cam = m_cam; }
  void setName(const std::string &name) { m_object.name = name; }
  std::string getName() const { return m_object.name; }
  const bole::Cylinder &object() const { return m_object; }
  const Options &options() const { return m_options; }
  void setOptions(const Options &options) { m_options = options; }
  /// Used for tracking or not, as vpMbtDistanceCylinder::setTracked().
  void setTracked(bool track) { m_tracked = track; }
  bool isTracked() const { return m_tracked; }

  /// Projects the trunk at \p cMo into an image of that size: borders, ends, visibility.
  void predict(const vpHomogeneousMatrix &cMo, unsigned int width, unsigned int height);
  /// Marks the samples hidden by \p nearer, both predicted at the same pose.
  void hideBehind(const vpMbtDistanceTrunk &nearer);
  /// Whether a border is in the image, long and wide enough.
  bool isVisible() const { return m_border[0].visible || m_border[1].visible; }
  const bole::Cylinder &inCamera() const { return m_camera; }
  const bole::RelativeTrunk &relative() const { return m_relative; }

  /// Profiles of both borders over +-half_px, their maxima; chooses none.
  void scan(const vpImage<unsigned char> &I, int half_px);
  /// Follows peak \p chosen of a border (-1: none): each piece takes its own maximum of the same sign within
  /// \p reach_px of it.
  void choose(bole::Border side, int chosen, double reach_px);
  /// scan() and choose() of the strongest maximum: all a user needs who has no better choice.
  void search(const vpImage<unsigned char> &I, int half_px);
  /// Keeps the signed contrast of the chosen peaks for the frames to come.
  void remember(double rate);
  void forget();

  /// Sets the sizes of L and error from the pieces that were found.
  void initInteractionMatrixError();
  /// L (nbFeature x 6) and error (nbFeature, image plane at z = 1) of the found places at \p cMo.
  void computeInteractionMatrixError(const vpHomogeneousMatrix &cMo);
  /// Row of L (in \p row, may be null) and residual of the image point \p m = (x, y, 1) and one border;
  /// \p by_log_radius is its derivative by the logarithm of the radius.
  static double residual(const bole::Cylinder &c_cylinder, bole::Border side, const Eigen::Vector3d &m,
                         Eigen::Matrix<double, 1, 6> *row = nullptr, double *by_log_radius = nullptr);

  BorderState &border(bole::Border side) { return m_border[side == bole::Border::left ? 0 : 1]; }
  const BorderState &border(bole::Border side) const { return m_border[side == bole::Border::left ? 0 : 1]; }

  vpMatrix L;                 ///< interaction matrix
  vpColVector error;          ///< residuals
  vpColVector by_log_radius;  ///< derivative of each residual by the logarithm of the radius
  vpColVector weight;         ///< of each residual, 0 .. 1: the share of a border that the piece stands for
  unsigned int nbFeature = 0; ///< rows of L

private:
  static void rememberProfile(BorderState &state, double rate);

  Options m_options;
  bole::Cylinder m_object, m_camera;
  bole::RelativeTrunk m_relative;
  vpCameraParameters m_cam;
  bole::PinholeCamera m_pinhole;
  std::array<BorderState, 2> m_border;
  bool m_tracked = true;
};
