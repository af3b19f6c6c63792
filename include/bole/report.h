// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What the pipeline knows after a frame: all that tasks and outputs read.
///
/// Frames: w world, b body, c camera. Lengths are in metres as far as the scale is known then.

#include <bole/frame.h>
#include <bole/trunk_record.h>

#include <string>
#include <utility>
#include <vector>

namespace bole
{
/// A trunk of the map, whether it is in view or not.
struct KnownTrunk
{
  int id = 0;                                  ///< in the map
  TrunkStatus status = TrunkStatus::candidate; ///< `lost`: confirmed, and now out of sight
  Trunk trunk;                                 ///< in the world
  int observations = 0;                        ///< frames in which it was measured
  double log_odds = 0;                         ///< to be a trunk and no chance pair of lines
  double seen_through = 0;                     ///< points seen behind it for each on its bark; 0 where it is in less
                                               ///< than every second frame
  double log_radius_variance = 0;              ///< [1]
  /// Of its bearing from the camera [rad^2]: how well its place relative to the camera is known. It leaves out the
  /// drift of the world, which moves camera and trunk alike.
  double bearing_variance = 0;
};

/// A point of the frame that has a parallax.
struct TriangulatedRay
{
  Eigen::Vector3d ray = Eigen::Vector3d::UnitX(); ///< unit vector from the camera, world axes
  double inverse_distance = 0;                    ///< [1/m], may be below 0 by noise
  double sigma = 0;                               ///< standard deviation of inverse_distance [1/m]
};

/// Which pixels are near.
struct SaliencyField
{
  vpImage<float> p_background; ///< 1: background
  vpImage<float> confidence;   ///< change of the log-odds by the images
  float unknown_below = 0;     ///< confidence under which a pixel is unknown

  /// Whether a cell has an answer.
  bool isKnown(unsigned row, unsigned column) const { return confidence[row][column] >= unknown_below; }
};

/// All that is known right after a frame.
struct FrameReport
{
  std::size_t index = 0;                                  ///< frames processed before this one
  std::int64_t stamp_ns = 0;                              ///< of the frame
  FrameStatus frame_status = FrameStatus::ok;             ///< whether its picture was used
  std::string reason;                                     ///< why the status is not ok, or Frame::message
  double gap_s = 0;                                       ///< Frame::gap_s
  Pose wMb;                                               ///< as known right after this frame
  Pose wMc;                                               ///< as known right after this frame
  Matrix6d pose_covariance = Matrix6d::Identity();        ///< of (rho, phi) of wMb, scale error left out
  bool is_translation_seen = false;                       ///< by a pose filter or by points; else it was only expected
  bool is_odometry_used = false;                          ///< that of the frame; else it had none, or is not believed
  bool has_ranges = true;                                 ///< false while the camera has only rotated
  std::vector<TrunkInView> trunks;                        ///< known trunks looked for
  std::vector<KnownTrunk> map;                            ///< all that a frame has to reckon with, in view or not
  std::vector<int> given_up;                              ///< ids that never come back, whatever later frames show
  std::vector<TriangulatedRay> points;                    ///< none where the frame was not ok
  std::vector<SensorVerdict> verdicts;                    ///< all of the flight so far
  std::optional<SaliencyField> saliency;                  ///< where saliency is on
  std::vector<std::pair<const char *, double>> timing_ms; ///< a stage each, in flow order
};

/// Points whose place is known within 7 per cent of their distance, no farther than \p range [m]: world [m]. Bark,
/// branches, ground: whatever has corners.
std::vector<Eigen::Vector3d> placedPoints(const FrameReport &report, double range);
/// The trunk of the map with this id; nullptr when it was merged or given up or is out of sight.
const KnownTrunk *knownTrunk(const FrameReport &report, int id);
/// The trunk as measured in this frame; nullptr when it was not.
const TrunkInView *trackedTrunk(const FrameReport &report, int id);
} // namespace bole
