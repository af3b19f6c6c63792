// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The pipeline itself: from each frame to what is known after it (paper, Sections 3 to 7). Pipeline is its public
/// face.
///
/// The stages are functions of plain values in this folder. The engine holds what lives from frame to frame (motion
/// source, saliency, smoother, window, map) and hands the result of one stage to the next.

#include "pipeline/consistency_window.h"
#include "pipeline/final_pass.h"
#include "pipeline/motion_source.h"
#include "pipeline/texture_tracker.h"
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

  /// The score that all keyframes gave every hypothesis, filled by finish().
  const std::vector<ScoredHypothesis> &scored() const { return m_scored; }

private:
  std::optional<double> continuity(const ScoredHypothesis &one) const;
  std::optional<ScoredHypothesis> score(const Hypothesis &hypothesis, double first_s, double last_s,
                                        const std::vector<ColumnView> &views) const;
  std::vector<ScoredHypothesis> scoreAll(const std::vector<ColumnView> &views,
                                         const std::vector<ScoredHypothesis> &before = {}) const;
  template <typename Frames> std::vector<ColumnView> columnViews(const Frames &frames) const;
  Viewpoint viewpointOf(std::size_t pose, double time_s) const;
  std::optional<GroundPlane> groundUnder(const Frame &frame, const Motion &motion);
  static constexpr int kLeastViews = 4;    ///< that a hypothesis needs to be scored
  static constexpr double kSettled = 1e-6; ///< relative fall of the cost at which optimisation ends

  /// A detection that became a candidate, remembered so that it is not tried again at once.
  struct TriedDetection
  {
    int id = 0; ///< in the map
    std::size_t pose = 0;
    Trunk trunk; ///< as it was detected
  };

  /// A hypothesis after it was tracked again through all keyframes: its score, and its new views where they score
  /// better than those in the smoother.
  struct RetrackedHypothesis
  {
    int id = 0; ///< in the map
    std::optional<ScoredHypothesis> scored;
    std::optional<CandidateTrack> views;
    bool is_seen = false;
  };

  Motion estimateMotion(const Frame &frame);
  const Frame &asUsuallyExposed(const Frame &frame, const Motion &motion, Frame &scratch);
  Viewpoint extendTrajectory(const Frame &frame, const Motion &motion);
  std::optional<Saliency> estimateSaliency(const Frame &frame, const Motion &motion);
  void dropUncertain(std::vector<PredictedTrunk> &predicted, const Viewpoint &view);
  void add(const std::vector<TrackedTrunk> &tracked, const Viewpoint &view);
  void addNewCandidates(const Viewpoint &view, const vpImage<float> *p_background);
  void addBestCandidates(std::vector<Detection> found, const DetectionWindow &window, const Viewpoint &view);
  void addLeaningCandidates(const std::shared_ptr<const Gradient> &gradient, const Viewpoint &view,
                            const vpImage<float> *p_background);
  int addCandidate(const CandidateTrack &track);
  NewTrunk addToSmoother(const CandidateTrack &track);
  void redetectBorders(const Hypothesis &suspect, const std::vector<ColumnView> &views, const Viewpoint &view);
  void maskTextureEdges(std::vector<PredictedTrunk> &predicted) const;
  void scoreByConsistency(const Frame &frame, const std::vector<TrackedTrunk> &tracked, const Viewpoint &view);
  std::vector<TriangulatedRay> points() const;
  double groundAt(const Eigen::Vector2d &xy) const;
  std::vector<int> reviewMap(const std::vector<TriangulatedRay> &points, const Viewpoint &view);
  void keepConfirmed();
  TrunkEstimate estimateOf(const MapTrunk &trunk, bool with_covariance) const;
  void refreshMap(double seen_since_s);
  void refreshWholeMap();
  void apply(const MapUpdate &update);
  double farthestScored() const;
  std::vector<CandidateTrack> trackThroughKeyframes(const std::vector<Hypothesis> &hypotheses, const TrunkMap &map,
                                                    KeyframeGradients &gradients) const;
  std::vector<RetrackedHypothesis> retrack(const std::vector<ScoredHypothesis> &likely,
                                           const std::vector<ScoredHypothesis> &best,
                                           const std::vector<ColumnView> &views, KeyframeGradients &gradients) const;
  void detectLeaning(const TrunkMap &likely, KeyframeGradients &gradients);
  void refineByConsistency();
  void indexViews();
  bool isSeen(const MapTrunk &trunk, std::size_t pose) const;
  bool isPlaced(const Eigen::Matrix2d &covariance) const;
  void runFinalPass();
  ScaleEstimate estimateScale(bool with_radii) const;
  void updateScale(double seconds_passed);
  void fixScale();
  void setUnits();
  std::vector<KnownTrunk> knownTrunks(const std::vector<PredictedTrunk> &predicted, const Viewpoint &view) const;
  FrameReport completeReport(FrameReport report, const Frame &frame, const Motion &motion);
  std::size_t newest() const { return m_smoother.poseCount() - 1; }
  Pose cameraAt(std::size_t pose) const { return m_smoother.pose(pose) * m_bMc; }

  PinholeCamera m_camera;
  Pose m_bMc;
  StageOptions m_options;       ///< in metres
  StageOptions m_units;         ///< the same with lengths in units of the motion
  double m_metres = 1;          ///< in one unit of the motion
  double m_metres_of_units = 1; ///< value of m_metres for which m_units was made
  std::unique_ptr<MotionSource> m_motion;
  double m_brightness = 0; ///< logarithm of that of the images over that of the images of the last ten seconds
  SaliencyEstimator m_saliency;
  Smoother m_smoother;
  DetectionWindow m_window;
  DetectionWindow m_leaning[2];       ///< of lines that lean to the left, to the right
  std::deque<TriedDetection> m_tried; ///< detections of the last half window
  TextureTracker m_texture;
  ConsistencyWindow m_consistency;
  KeyframeStore m_keyframes; ///< keyframes for the final pass
  GroundFilter m_ground_filter;
  std::vector<std::optional<GroundPlane>> m_ground; ///< by pose
  TrunkMap m_map;
  std::vector<ScoredHypothesis> m_scored;
  std::map<std::size_t, std::vector<std::size_t>> m_views; ///< poses that saw each trunk of the smoother, at the end
  Trajectory m_online;                                     ///< in units of the motion
  Vector6d m_velocity = Vector6d::Zero();                  ///< of the body, in its frame, units of the motion
};

/// The rectified column images of \p frames, at the present estimates of their poses.
template <typename Frames> std::vector<ColumnView> Engine::columnViews(const Frames &frames) const
{
  std::vector<ColumnView> views;
  views.reserve(frames.size());
  for (const auto &frame : frames)
    views.emplace_back(frame.level, cameraAt(frame.pose), frame.time_s);
  return views;
}
} // namespace bole
