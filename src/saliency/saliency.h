// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Saliency: which pixels are near enough to matter (Section 5).
///
/// Each frame the rotation of the camera is refined from the images and the gyro (estimateRotation()). Where the
/// translation is given too, labels ask whether a pixel is nearer than a range that matters for planning, with evidence
/// gathered over frames (InverseDepthEvidence); otherwise they ask, as the paper does, whether a pixel moves otherwise
/// than the background. Pixels that no frame has told anything about are "unknown".
///
/// Frames: p previous camera, c current camera. Images are rectified, all of the size of the camera.
/// Errors: an image of another size throws vpException. Where the images do not tell the rotation it is that of the
/// gyro, or none. The first frame is unknown everywhere; the same image once more changes no label, and its motion is
/// kept for the next frame.
/// Cost: 2 ms a frame of 320x240 (src/doc/saliency.md). Not thread-safe; no globals.
///
///     SaliencyEstimator estimator(camera);
///     const Saliency saliency = estimator.update(image, RotationPrior{pRc, covariance}, TranslationPrior{pt});
///     if (saliency.confidence[v][u] >= kUnknownBelow && saliency.p_background[v][u] < 0.5f) { ... near ... }
///
/// Laws (each a test): p_background is within [0, 1] and finite on any image; an image seen twice in a row changes no
/// label; a blank image is unknown everywhere.
#include "saliency/saliency_options.h"
#include <bole/camera.h>
#include <bole/pose.h>

#include <Eigen/LU>
#include <deque>
#include <optional>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
// An image at several sizes, with its gradient, for the search from coarse to fine, and where its pixels come from.

struct PyramidLevel
{
  PinholeCamera camera;
  vpImage<float> image;                  ///< 1 = full scale
  vpImage<float> gradient_x, gradient_y; ///< central differences [1/px of this level]
};

/// Level k is 2^k times smaller; each pixel is the mean of four of the level below. A level is never smaller than
/// 16 pixels, so that there may be fewer levels than asked for. Gradients are made from \p finest_level on; the image
/// of level 0 is empty where \p finest_level is above.
class ImagePyramid
{
public:
  ImagePyramid(const vpImage<unsigned char> &image, const PinholeCamera &camera, int levels, int finest_level);

  int levels() const { return static_cast<int>(m_levels.size()); }
  const PyramidLevel &operator[](int level) const { return m_levels[static_cast<std::size_t>(level)]; }

private:
  std::vector<PyramidLevel> m_levels;
};

/// Homogeneous pixel of the previous image: H u + rho e, H = K pRc K^-1, e = K pt.
struct PlaneWarp
{
  Eigen::Matrix3f H;
  Eigen::Vector3f e;

  PlaneWarp(const PinholeCamera &camera, const Pose &pMc)
  {
    Eigen::Matrix3d K = Eigen::Matrix3d::Identity();
    K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
    H = (K * pMc.R * K.inverse()).cast<float>();
    e = (K * pMc.t).cast<float>();
  }
};

// Rotation of the camera and labels of the pixels from two images, together (Section 5, Eq. 10 to 17).
//
// The E-step (Eq. 10 and 11) asks each pixel of I(t) which explains it better, the rotation alone (background) or a
// wide distribution of flows (foreground); the velocity of the pixel is integrated out in closed form. The M-step
// (Eq. 16 and 17) is one Gauss-Newton step on the rotation given the labels, with the gyro as Gaussian prior.
// It runs from a coarse level of an image pyramid to a fine one.
//
// Laws (each a test): labels are finite and within [0, 1] on any image; a blank image leaves the prior as it is;
// a rendered rotation is found.
//
// Deviations from the paper:
// - Eq. 10 in the log domain with a logistic; both likelihoods in linear form are 0/0 in double precision.
// - Eq. 12 warps I(t-1) and Eq. 15 warps I(t). Here pixel u of I(t-1) moves to u + v in I(t), and the labels belong
//   to the pixels of I(t), where the detector wants them: pixel u is compared with I(t-1) at u - v.
// - Eq. 13: mean of the foreground's flow V w rather than 0, and the exact warp of the rotation rather than V w.
// - Eq. 16: minimises the negative of what is printed.

/// Rotation of the camera between two frames, as a gyro knows it.
struct RotationPrior
{
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity(); ///< current camera in the previous one: Exp(omega)
  /// Of the right perturbation pRc * Exp(phi) [rad^2].
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity() * 1e-6;
};

constexpr double kBackgroundPrior = 0.7; ///< p(lambda = 1) before looking: most of a forest is far

struct RotationEm
{
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< right perturbation [rad^2]
  double texture = 0; ///< share of the pixels of the finest level whose gradient tells them apart
  /// log p(background) - log p(foreground) without the prior of the labels, at the finest level worked on.
  /// Empty where nobody asked for labels.
  vpImage<float> log_ratio;
};

/// \param prior the gyro's rotation; without it the search starts from \p start with wide labels.
/// \param with_labels one more pass makes the log ratios.
RotationEm estimateRotation(const ImagePyramid &previous, const ImagePyramid &current,
                            const std::optional<RotationPrior> &prior, const Eigen::Matrix3d &start,
                            const SaliencyOptions &options, bool with_labels);

// Evidence per pixel for each of a few inverse depths, gathered over frames.
//
// Where the translation t of the camera is known, a static point at inverse depth rho moves by V w + A t rho. A coarse
// sweep over rho compares the current image with an older one at each rho; squared residuals are averaged over a small
// upright window and turned into a log-likelihood by the noise of intensity, of the motion and of the step of the
// sweep. So a window without texture, or near the focus of expansion, likes every rho the same and says nothing.
// From frame to frame the evidence moves with the pixel and the depth it speaks of, and fades.
//
// Laws (each a test): no motion leaves the evidence unchanged but for its fading; without texture the log odds are
// those of the prior; finite on any image.
//
// Not in the paper: it asks whether a pixel *moves* with the background; this asks whether it is *near*.

/// Uncertainty of the motion between two frames, as standard deviations.
struct MotionNoise
{
  double rotation = 1e-3;    ///< [rad]
  double translation = 0.01; ///< an axis [m]
};

class InverseDepthEvidence
{
public:
  static constexpr int kRowStep = 2; ///< rows of the working level to a row of evidence

  /// \p camera is that of the working level, \p level its level in the pyramid.
  InverseDepthEvidence(const PinholeCamera &camera, int level, const SaliencyOptions &options);

  void clear();
  /// Moves the evidence to the current frame; \p pMc is the current camera in the previous one. Fades it.
  void predict(const Pose &pMc);
  /// Adds what \p older says about \p current, both at the working level; \p oMc is the current camera in the older.
  void add(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise);
  /// log p(nearer than near_range) - log p(farther), one value a pixel of the working level, but only each kRowStep-th
  /// row: trunks are upright, and windows taller than wide.
  vpImage<float> logOddsNear() const;
  /// log odds before any evidence.
  float priorLogOdds() const { return m_prior_log_odds; }

private:
  void compare(const PyramidLevel &older, const PyramidLevel &current, const Pose &oMc);
  void addLikelihood(const PyramidLevel &current, const Pose &oMc, const MotionNoise &noise);

  PinholeCamera m_camera;
  SaliencyOptions m_options;
  double m_intensity_variance;
  int m_rows, m_window_rows;
  std::size_t m_first_near = 0; ///< first step nearer than near_range
  float m_prior_log_odds;
  std::vector<float> m_rho;                                     ///< [1/m], rising from 0
  std::vector<float> m_log_prior;                               ///< of each step
  std::vector<float> m_evidence;                                ///< row by row, pixel by pixel, all steps of each
  std::vector<float> m_scratch, m_residuals, m_line, m_squares; ///< kept for their memory
};

/// Median flow [px of \p camera] of points at \p range under the translation of \p oMc.
double medianParallax(const PinholeCamera &camera, const Pose &oMc, double range);

/// Translation of the camera between two frames, in metres, as odometry or point features know it.
struct TranslationPrior
{
  Eigen::Vector3d pt = Eigen::Vector3d::Zero();                    ///< current camera in the previous one [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity() * 1e-4; ///< [m^2]
};

constexpr float kUnknownBelow = 0.7f; ///< confidence under which a pixel is unknown

struct Saliency
{
  vpImage<float> p_background;                              ///< lambda = 1 means background
  vpImage<float> confidence;                                ///< |change of the log odds| by the images; small = unknown
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity();        ///< refined rotation from the image before
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< right perturbation of pRc [rad^2]
};

class SaliencyEstimator
{
public:
  explicit SaliencyEstimator(const PinholeCamera &camera, const SaliencyOptions &options = {});

  /// The next frame. \p gyro and \p translation are the motion since the frame before; a missing \p translation
  /// forgets the evidence gathered over frames.
  Saliency update(const vpImage<unsigned char> &image, const std::optional<RotationPrior> &gyro = std::nullopt,
                  const std::optional<TranslationPrior> &translation = std::nullopt);

  /// Forgets all frames: after a jump of the video.
  void reset();

private:
  struct View
  {
    ImagePyramid pyramid;
    Pose vMc; ///< camera in the frame of the first view kept
  };
  /// Log odds of being near, of each \p row_step-th row of \p level.
  struct CoarseLabels
  {
    vpImage<float> log_odds;
    int level = 0, row_step = 1;
    float prior = 0; ///< log odds before looking
  };
  bool isStale(const vpImage<unsigned char> &image) const;
  bool asksForRange() const { return m_translation.has_value(); }
  void addMotion(const std::optional<RotationPrior> &gyro, const std::optional<TranslationPrior> &translation);
  RotationEm refineRotation(const ImagePyramid &current, Saliency &result) const;
  CoarseLabels labelByRange(const ImagePyramid &current, const Saliency &result);
  CoarseLabels labelByMotion(const RotationEm &rotation) const;
  void fill(const CoarseLabels &labels, Saliency &result) const;

  PinholeCamera m_camera;
  SaliencyOptions m_options;
  InverseDepthEvidence m_evidence;
  std::deque<View> m_views; ///< newest first
  vpImage<unsigned char> m_last_image;
  CoarseLabels m_labels;
  Eigen::Matrix3d m_last_turn = Eigen::Matrix3d::Identity();
  std::optional<RotationPrior> m_gyro; ///< since the last image used
  std::optional<TranslationPrior> m_translation;
  bool m_has_pending_motion = false;
};
} // namespace bole
