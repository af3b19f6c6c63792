// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// From frames to a map of trunks and a trajectory: the stages in flow order.
///
/// Idea: predict the pose; reduce the image to its gradient; ask for saliency and relative poses; track the known
/// trunks relative to the camera and replace the image by a summary factor each; smooth; look for new trunks where
/// none is known; review the map (paper, Sections 3 to 7).
///
/// \code
/// bole::AslSource source("data/park-forward");
/// bole::Pipeline pipeline(source.camera(), source.bMc(), bole::Options());
/// bole::Frame frame;
/// while (source.next(frame)) {
///   const bole::FrameResult result = pipeline.process(frame);
///   std::cout << frame.index << ": " << result.trunks.size() << " trunks in view\n";
/// }
/// for (const bole::TrunkRecord &trunk : pipeline.map()) ...
/// \endcode
///
/// Memory: the window of the detector and the graph of the smoother; no image is kept beyond the window.
/// Not thread-safe; no globals.

#include "pipeline/stage_options.h"
#include "saliency/saliency.h"
#include <bole/options.h>
#include <bole/world_reference.h>

#include <deque>
#include <utility>

namespace bole
{
/// A known trunk in one frame.
struct TrackedTrunk
{
  int id = 0;
  TrunkStatus map_status = TrunkStatus::candidate;
  TrackingStatus status = TrackingStatus::not_visible;
  RelativeTrunk relative; ///< the optimum where tracked, else the prediction
  ElevationRange range;   ///< the part looked at
  double distance = 0;    ///< from the camera to the axis by the map [m]; 0 where no range is known
};

struct FrameResult
{
  std::size_t index = 0;
  std::int64_t stamp_ns = 0;
  FrameStatus frame_status = FrameStatus::ok;
  Pose wMb;                          ///< as known right after this frame
  std::vector<TrackedTrunk> trunks;  ///< known trunks that might be in view
  std::vector<Detection> detections; ///< new ones, of the window
  std::vector<LineDetection> lines;  ///< new ones, of this frame alone
  std::optional<Saliency> saliency;
  std::vector<std::pair<const char *, double>> timing_ms; ///< a stage each, in flow order
  UpdateStatus smoother_status = UpdateStatus::ok;
  bool step_from_odometry = false; ///< of a pose filter, or seen by the points of a plain video
};

class Pipeline
{
public:
  Pipeline(const PinholeCamera &camera, const Pose &bMc, const Options &options = {});
  Pipeline(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options); ///< for tests and the ablation

  /// Takes in the next frame. Frames that are not ok pass without vision: their pose is predicted.
  FrameResult process(const Frame &frame);

  /// Smooths the whole flight once more, everything linearised anew.
  void finish();

  const std::vector<MapTrunk> &mapTrunks() const { return m_map.trunks(); }
  /// Log odds that \p trunk is one (TrunkMap::evidence).
  double evidence(const MapTrunk &trunk) const { return m_map.evidence(trunk); }
  /// The trunks, with covariances that carry the common error of the scale: it moves every trunk along its
  /// line from the first pose and changes every radius in proportion, and no camera sees it.
  std::vector<TrunkRecord> map() const;
  /// Where the metre and up come from, as of the last frame.
  WorldReference reference() const;
  struct StampedPose
  {
    std::int64_t stamp_ns = 0;
    Pose wMb;
  };
  std::vector<StampedPose> smoothedTrajectory() const;
  const std::vector<StampedPose> &onlineTrajectory() const { return m_online; }
  struct Sight ///< where a point of the last frame stands, by its parallax
  {
    Eigen::Vector3d ray;         ///< unit vector from the camera, world
    double inverse_distance = 0; ///< [1/m], below 0 by noise
    double sigma = 0;            ///< of it [1/m]
  };
  /// All points of the last frame that have a parallax; none where that frame was not ok or the camera has only turned.
  const std::vector<Sight> &sights() const { return m_sights; }
  Pose cameraPose() const { return cameraAt(m_smoother.poseCount() - 1); } ///< at the last frame, in the world
  /// Points of the last frame whose tracks have parallax enough to be placed within 7 per cent of their distance, no
  /// farther than \p range [m]: world [m]. Bark, branches, ground: whatever has corners.
  std::vector<Eigen::Vector3d> scenePoints(double range) const;
  Graph graph() const { return m_smoother.graph(); }
  const Smoother &smoother() const { return m_smoother; }
  /// Trunk record fields that need the smoother are refreshed from it; called by process() and finish().
  void refreshMap(double seen_since_s);
  void refreshWholeMap();

private:
  struct View ///< a frame of the detector's window
  {
    Gradient gradient;
    LevelProfile profile;
    std::size_t pose = 0;
    double time_s = 0;
  };
  struct Lap;

  void addPose(const Frame &frame, const GyroBias &bias, FrameResult &result);
  MotionStep visualStep(const Frame &frame, const MotionStep &predicted, std::vector<VisualLink> &links);
  void learnGround(const Pose &wMb);
  void forgetUnranged();
  bool isTurning() const { return m_visual && !m_visual->hasUnit(); } ///< without any parallax so far
  struct ScaleEstimate
  {
    double log_correction = 0, sigma = 0; ///< of the scale that the map has now
    ScaleSource source = ScaleSource::prior;
  };
  ScaleEstimate estimateScale(bool with_radii) const;
  void reviewScale(double least_correction, bool with_radii);
  void rescale(double factor);
  std::size_t poseOf(std::size_t frame_index) const;
  void addRelativePoses(const std::vector<RelativeMotion> &motions);
  void addTurn(std::size_t a, std::size_t b, const RelativePoseEstimate &estimate);
  void estimateSaliency(const Frame &frame, FrameResult &result);
  void placeSights();
  void lookThroughTrunks();
  void trackKnown(const Gradient &gradient, double time_s, FrameResult &result);
  double misfit(const TrackingResult &tracked, const RelativeTrunk &expected) const;
  bool observe(MapTrunk &trunk, std::size_t pose, const TrackingPrediction &prediction, const TrackingResult &tracked,
               double time_s);
  TrackingPrediction predict(const MapTrunk &trunk, const RelativeTrunk &relative, const Matrix4d &covariance,
                             const Pose &wMc) const;
  double weightOfView(const MapTrunk &trunk, const Eigen::Vector3d &camera) const;
  bool confirmTurn(MapTrunk &trunk, const TrackingPrediction &prediction, const TrackingResult &tracked) const;
  double missedVariance(int misses) const;
  bool insideGate(const TrackingPrediction &prediction, const TrackingResult &tracked) const;
  void hide(TrackingPrediction &prediction, const MapTrunk &trunk, const Pose &wMc) const;
  ElevationRange elevation(const RelativeTrunk &relative, const Trunk &trunk, const Pose &wMc) const;
  void keepView(const Frame &frame, Gradient gradient);
  void detectNew(FrameResult &result);
  void detectSingle(FrameResult &result);
  void adopt(const Detection &detection);
  void adopt(const LineDetection &detection);
  std::vector<InhibitedRange> inhibited(bool by_candidates) const;
  void reviewMap(double time_s);
  Pose cameraAt(std::size_t pose) const { return m_smoother.pose(pose) * m_bMc; }

  PinholeCamera m_camera;
  Pose m_bMc;
  StageOptions m_options;
  MotionModel m_motion;
  PointMotion m_points;
  std::optional<VisualOdometry> m_visual; ///< of a plain video: one that starts without odometry
  SaliencyEstimator m_saliency;
  Smoother m_smoother;
  TrunkMap m_map;
  std::deque<View> m_views; ///< oldest first
  std::vector<StampedPose> m_online;
  std::vector<Sight> m_sights;            ///< of the last frame
  std::vector<std::size_t> m_indices;     ///< Frame::index of each processed frame
  Vector6d m_velocity = Vector6d::Zero(); ///< of the body, in its frame
  std::optional<double> m_ground_z;       ///< height of the ground in the world, where it is known [m]
};
} // namespace bole
