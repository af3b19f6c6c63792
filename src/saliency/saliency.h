// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Saliency: which pixels are near enough to matter (Section 5).
///
/// Each frame the rotation of the camera is refined from the images and the gyro (rotation_em.h). Where the translation
/// is given too, labels ask whether a pixel is nearer than a range that matters for planning, with evidence gathered
/// over frames (inverse_depth_evidence.h); otherwise they ask, as the paper does, whether a pixel moves otherwise than
/// the background. Pixels that no frame has told anything about are "unknown".
///
/// Frames: p previous camera, c current camera. Images are rectified, all of the size of the camera.
/// Errors: an image of another size throws vpException; everything else that may happen to a frame is a status.
/// Cost: 2 ms a frame of 320x240 (src/doc/saliency.md). Not thread-safe; no globals.
///
///     SaliencyEstimator estimator(camera);
///     const Saliency saliency = estimator.update(image, RotationPrior{pRc, covariance}, TranslationPrior{pt});
///     if (saliency.isKnown(v, u) && saliency.p_background[v][u] < 0.5f) { ... near ... }
///
/// Laws (each a test): p_background is within [0, 1] and finite on any image; an image seen twice in a row changes no
/// label; a blank image is unknown everywhere.

#include "saliency/inverse_depth_evidence.h"
#include "saliency/rotation_em.h"
#include "saliency/saliency_options.h"

#include <deque>
#include <optional>

namespace bole
{
/// Translation of the camera between two frames, in metres, as odometry or point features know it.
struct TranslationPrior
{
  Eigen::Vector3d pt = Eigen::Vector3d::Zero();                    ///< current camera in the previous one [m]
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity() * 1e-4; ///< [m^2]
};

enum class SaliencyStatus
{
  first_frame,  ///< nothing to compare with: all unknown
  with_gyro,    ///< rotation from gyro and images
  without_gyro, ///< rotation from images alone, with robust weights: may be pulled by near things
  no_texture,   ///< rotation is the prior's (or none); labels say unknown
  stale,        ///< the same image again: labels of the frame before, motion kept for the next frame
  not_converged ///< the images did not agree on a rotation: the prior's is returned
};

struct Saliency
{
  SaliencyStatus status = SaliencyStatus::first_frame;
  vpImage<float> p_background;                              ///< lambda = 1 means background
  vpImage<float> confidence;                                ///< |change of the log odds| by the images; small = unknown
  Eigen::Matrix3d pRc = Eigen::Matrix3d::Identity();        ///< refined rotation from the image before
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity(); ///< right perturbation of pRc [rad^2]
  bool asks_for_range = false; ///< labels mean "nearer than near_range"; else "moves unlike the background"
  double parallax_px = 0;      ///< of the pair of frames used, at near_range
  int iterations = 0;
  double unknown_share = 1; ///< of the pixels
  float unknown_below = 0;  ///< confidence under which a pixel is unknown

  bool isKnown(unsigned row, unsigned column) const { return confidence[row][column] >= unknown_below; }
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
  CoarseLabels labelByRange(const ImagePyramid &current, Saliency &result);
  CoarseLabels labelByMotion(const RotationEm &rotation) const;
  void fill(const CoarseLabels &labels, Saliency &result) const;

  PinholeCamera m_camera;
  SaliencyOptions m_options;
  InverseDepthEvidence m_evidence;
  std::deque<View> m_views; ///< newest first
  vpImage<unsigned char> m_last_image;
  Saliency m_last; ///< without its images, which m_labels gives again
  CoarseLabels m_labels;
  Eigen::Matrix3d m_last_turn = Eigen::Matrix3d::Identity();
  std::optional<RotationPrior> m_gyro; ///< since the last image used
  std::optional<TranslationPrior> m_translation;
  bool m_has_pending_motion = false;
};
} // namespace bole
