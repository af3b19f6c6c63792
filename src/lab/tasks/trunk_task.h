// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Image-based servoing on one trunk: hold its bearing and distance, or circle round it.
///
/// Idea: two of vpFeatureTrunk's four numbers, bearing and log r/d, are what a drone that keeps its own roll, pitch and
/// height can choose. vpServo drives both to their desired values over the drone's Jacobian: the bearing by turning,
/// log r/d by flying ahead, one axis each, since their lags differ. What is left is sideways: `hold` leaves it at rest,
/// `circle` gives it a speed, and what that does to the two is fed forward.
///
/// A distance in metres is the map's radius over r/d, and the radius comes from parallax. A drone at rest has none and
/// drifts by several per cent in half a minute, because systematic errors of the borders from one viewpoint act as an
/// error of distance. So `hold` by distance oscillates sideways with the features held. It climbs and descends
/// meanwhile: the height has no scale error, unlike the horizontal odometry, and the points measure the direction of
/// flight, which transfers the scale of the height to the map. The distance is the map's: pose and map rest on all
/// images, while the borders of a single image vary with light and background.
///
/// A frame is old when it arrives and the drone is slow to obey, so each feature is predicted to where it will stand
/// when the command acts (DroneResponse), and the command is the velocity that a lagging drone needs for an exponential
/// decrease. Drag lets it fly a share of what is sent; the share is learnt from where it went (PlaneResponse), and so
/// much more is sent. Other unmodelled motion (drift outwards on a circle, wind) appears as a drift of the features
/// (FeatureFilter) and is fed forward, which leaves no lag on the circle.
///
/// Bearing and a ratio that is asked for come from the trunk as tracked in the image of the moment; where it was missed
/// for a frame or two, and for a distance, from the map and the pose. A ratio needs nothing of the map.

#include "tasks/drone_response.h"
#include "tasks/servo_task.h"
#include <bole/vpFeatureTrunk.h>

#include <visp3/vs/vpServo.h>

#include <optional>

namespace bole
{
struct TrunkTaskOptions
{
  double ratio = 0;           ///< r/d to be kept, 0 (by distance) to 0.5
  double distance = 3;        ///< camera to axis, where no ratio is given [m], 0.5 to 20
  double bearing = 0;         ///< to be kept, positive right [rad], -0.5 to 0.5
  double speed = 0;           ///< round the trunk, positive to the left [m/s], -2 to 2; 0 holds
  double gain = 1.6;          ///< of vpServo [1/s], 0.05 to 3: leaves a modulus margin of .5
  double largest_speed = 0.9; ///< [m/s], 0.05 to 3
  double free_way = 0.5;      ///< does not go round nearer to another trunk than this, body to bark [m], 0 to 5
  double search_s = 40;       ///< gives up after [s], 1 to 600
  ResponseOptions response;
};

/// Laws (each a test, on exact features): the error decays at the gain, with a drone that obeys at once and with one
/// that is late and slow; circling keeps bearing and log r/d; a steady push moves neither.
class TrunkTask : public ServoTask
{
public:
  TrunkTask(const Pose &bMc, const TrunkTaskOptions &options);
  ~TrunkTask() override;

  int target() const { return m_target; }         ///< id in the map, -1 while searching
  double desiredRatio() const { return m_ratio; } ///< r/d to be kept, by the radius as it is known now
  const TrunkTaskOptions &options() const { return m_options; }
  Values errors() const override;

  /// The control law alone: velocity (vx, vy, vz = 0, wz) of the body for the \p feature of the frame of \p time_s [s],
  /// going round at \p round [m/s], positive to the left.
  /// \p flown: path of the body since the frame before by odometry and images (x, y, z [m], yaw [rad]), where known.
  Eigen::Vector4d velocityFor(const vpFeatureTrunk &feature, double radius, double time_s, double round,
                              const std::optional<Eigen::Vector4d> &flown = {});

protected:
  bool sees(const FrameReport &report) const override;
  void giveUpTarget() override;
  TaskCommand act(const FrameReport &report) override;
  void sent(const Eigen::Vector4d &velocity, const FrameReport &report) override;

private:
  /// To and fro about where it began.
  struct Sway
  {
    double start_s = 0;
    double azimuth = 0; ///< of the drone about the target, world [rad]
    double height = 0;  ///< world [m]
  };

  TaskCommand search(const FrameReport &report, double time_s);
  int choose(const FrameReport &report, double elapsed_s) const;
  int successor(const FrameReport &report) const;
  RelativeTrunk look(const FrameReport &report, const KnownTrunk &trunk);
  std::optional<Eigen::Vector4d> flownTo(const Pose &wMb);
  void forgetFeature();
  void desire(double radius);
  Eigen::Vector2d swayNow(double time_s, const Eigen::Vector3d &place);
  bool isFree(int target, const std::vector<Obstacle> &around, const Pose &wMb, double speed) const;
  void filter(const vpFeatureTrunk &feature, double time_s, const std::optional<Eigen::Vector4d> &flown);
  Eigen::Vector2d lead(const vpFeatureTrunk &feature, double radius, double time_s, double round);
  Eigen::Matrix<double, 2, 4> interactionOf(vpFeatureTrunk feature) const;

  Pose m_bMc;
  TrunkTaskOptions m_options;
  Sidestep m_sidestep;
  vpServo m_servo;
  vpFeatureTrunk m_current, m_desired;  ///< as it will stand when the command acts; as it should
  DroneResponse m_response;             ///< with what is flown of what is sent
  FeatureFilter m_bearing, m_log_ratio; ///< at the frame
  int m_target = -1;
  Eigen::Vector2d m_place = Eigen::Vector2d::Zero(); ///< of the target in the map
  double m_map_log_radius = 0;                       ///< of the target
  double m_time_s = 0, m_ratio = 0;
  std::optional<Pose> m_wMb;          ///< at the frame that the filters stand at
  std::optional<double> m_log_radius; ///< as seen from this side: distance by the map times r/d in the image
  std::int64_t m_radius_ns = 0;       ///< of the frame that told it last
  double m_bearing_noise;             ///< of the feature seen last [rad]
  int m_misread = 0;                  ///< frames in a row
  double m_round = 0;                 ///< ordered sideways last [m/s]
  double m_uncut = 1;                 ///< share of it that the laws of safety left
  double m_turned_back = 1;           ///< -1: goes round the other way, since a trunk stood in it
  int m_blocked = 0;                  ///< frames in a row
  std::optional<Sway> m_sway;         ///< none before it has begun
  bool m_has_feature = false;
};
} // namespace bole
