// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The pipeline itself: from each frame to what is known after it (paper, Sections 3 to 7). Pipeline is its public
/// face.
///
/// The stages are functions of plain values in this folder. The engine holds what lives from frame to frame (motion
/// source, saliency, smoother, window, map) and hands the result of one stage to the next.

#include "pipeline/bark_follower.h"
#include "pipeline/final_pass.h"
#include "pipeline/motion_source.h"
#include "pipeline/recent_columns.h"
#include "pipeline/units.h"
#include "saliency/saliency.h"
#include <bole/pipeline.h>

#include <deque>
#include <map>

namespace bole
{
class Engine
{
public:
  Engine(const PinholeCamera &camera, const Pose &bMc, const StageOptions &options);

  FrameReport process(const Frame &frame);
  void finish();
  FrameReport review(std::size_t index) const;

  std::vector<TrunkRecord> map() const;
  WorldReference reference() const;
  Trajectory smoothedTrajectory() const;
  Trajectory onlineTrajectory() const;
  Graph graph() const;

  const TrunkMap &trunks() const { return m_map; } ///< in units of the motion

  /// What the columns of all frames said of every hypothesis, after finish().
  const std::vector<Judged> &judged() const { return m_judged; }

private:
  std::vector<Judged> judgeAll(const std::vector<LevelView> &views, const std::vector<Judged> &before = {}) const;
  template <typename Frames> std::vector<LevelView> levelViews(const Frames &frames) const;
  Viewpoint viewpointOf(const KeptFrame &frame) const;
  static constexpr int kLeastViews = 4;    ///< of a hypothesis that is judged
  static constexpr double kSettled = 1e-6; ///< of the cost: no view notices

  /// A detection that was taken into the map.
  struct TriedReading
  {
    int id = 0; ///< in the map
    std::size_t pose = 0;
    Trunk trunk; ///< as it was detected
  };

  /// A hypothesis where it stands best, with new views where those are better than what the smoother holds.
  struct Reading
  {
    std::optional<Judged> judged;
    std::optional<Adoption> views;
    bool is_seen = false;
  };

  Motion move(const Frame &frame);
  Motion beginAgain(const Frame &frame);
  Viewpoint extend(const Frame &frame, const Motion &motion);
  std::optional<Saliency> estimateSaliency(const Frame &frame, const Motion &motion);
  void loseUnplaced(std::vector<PredictedTrunk> &predicted, const Viewpoint &view);
  void add(const std::vector<TrackedTrunk> &tracked, const Viewpoint &view);
  void adoptNew(const Viewpoint &view, const vpImage<float> *p_background);
  void adoptBest(std::vector<Detection> found, const DetectionWindow &window, const Viewpoint &view);
  void adoptLeaning(const std::shared_ptr<const Gradient> &gradient, const Viewpoint &view,
                    const vpImage<float> *p_background);
  int adopt(const Adoption &adoption);
  NewTrunk hold(const Adoption &adoption);
  void readAnew(const Hypothesis &doubtful, const std::vector<LevelView> &views, const Viewpoint &view);
  void leaveLinesOnBark(std::vector<PredictedTrunk> &predicted) const;
  void lookAtColumns(const Frame &frame, const std::vector<TrackedTrunk> &tracked, const Viewpoint &view);
  std::vector<TriangulatedRay> points() const;
  std::vector<int> reviewMap(const std::vector<TriangulatedRay> &points, const Viewpoint &view);
  void keepNearby();
  TrunkEstimate estimateOf(const MapTrunk &trunk, bool with_covariance) const;
  void refreshMap(double seen_since_s);
  void refreshWholeMap();
  void apply(const MapUpdate &update);
  double farthestJudged() const;
  std::vector<Adoption> followAll(const std::vector<Hypothesis> &hypotheses, const TrunkMap &map,
                                  AlbumGradients &gradients) const;
  std::vector<Reading> readAgain(const std::vector<Judged> &likely, const std::vector<LevelView> &views,
                                 AlbumGradients &gradients) const;
  void detectLeaning(const TrunkMap &likely, AlbumGradients &gradients);
  void placeByColumns();
  void noteViews();
  bool isSeen(const MapTrunk &trunk, std::size_t pose) const;
  void decideByAllFrames();
  ScaleEstimate estimateScale(bool with_radii) const;
  void followScale(double seconds_passed);
  void measureScale();
  void takeScale();
  void setUnits();
  std::vector<KnownTrunk> known(const std::vector<PredictedTrunk> &predicted, const Viewpoint &view) const;
  FrameReport complete(FrameReport report, const Frame &frame, const Motion &motion);
  std::size_t newest() const { return m_smoother.poseCount() - 1; }
  Pose cameraAt(std::size_t pose) const { return m_smoother.pose(pose) * m_bMc; }

  PinholeCamera m_camera;
  Pose m_bMc;
  StageOptions m_options;        ///< in metres
  StageOptions m_units;          ///< the same in units of the motion
  double m_metres = 1;           ///< in one unit of the motion
  double m_metres_of_units = 1;  ///< for which m_units was made
  std::size_t m_next_scale = 10; ///< frame at which the scale is measured next
  std::unique_ptr<MotionSource> m_motion;
  bool m_awaits_odometry = false; ///< the first frame had none
  SaliencyEstimator m_saliency;
  Smoother m_smoother;
  DetectionWindow m_window;
  DetectionWindow m_leaning[2];     ///< of lines that lean to the left, to the right
  std::deque<TriedReading> m_tried; ///< of the last half window
  BarkFollower m_bark;
  RecentColumns m_columns;
  Album m_album; ///< frames for the last look at the flight
  TrunkMap m_map;
  std::vector<Judged> m_judged;
  std::map<std::size_t, std::vector<std::size_t>> m_views; ///< poses that saw each trunk of the smoother, at the end
  Trajectory m_online;                                     ///< in units of the motion
  Vector6d m_velocity = Vector6d::Zero();                  ///< of the body, in its frame, units of the motion
};

/// Frames that are kept, at the present poses.
template <typename Frames> std::vector<LevelView> Engine::levelViews(const Frames &frames) const
{
  std::vector<LevelView> views;
  views.reserve(frames.size());
  for (const auto &frame : frames)
    views.emplace_back(frame.level, cameraAt(frame.pose), frame.time_s);
  return views;
}
} // namespace bole
