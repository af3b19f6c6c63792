// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The map decided once more when the flight is over and its poses are known.
///
/// Idea: while the drone flies a hypothesis is judged by the few frames since it was found, from poses that are still
/// moving, and most trunks that are missed in the end were such hypotheses. So frames are kept; at the end every
/// hypothesis, rejected ones too, is looked up in all of them (TrunkEvidence), the best that do not stand in one
/// another's place are chosen, and those are measured again in every frame.

#include "detection/trunk_evidence.h"
#include "pipeline/adoption.h"

namespace bole
{
struct KeptFrame
{
  vpImage<unsigned char> image;
  std::size_t pose = 0;
  double time_s = 0;
};

/// Frames from places apart; of a long flight, the last.
class KeptFrames
{
public:
  void push(const vpImage<unsigned char> &image, std::size_t pose, double time_s, const Eigen::Vector3d &camera,
            double spacing);
  const std::deque<KeptFrame> &frames() const { return m_frames; }

private:
  std::deque<KeptFrame> m_frames;
  Eigen::Vector3d m_last = Eigen::Vector3d::Zero();
};

/// A place where a trunk may stand.
struct Hypothesis
{
  int id = -1; ///< in the map
  Trunk trunk;
  TrunkEvidence evidence;
  double log_odds = 0; ///< to be a trunk
};

/// Level images of \p frames with the ranges of their columns, from the poses of \p smoother. \p view: the camera.
std::vector<EvidenceView> lookBack(const KeptFrames &frames, const Smoother &smoother, const Viewpoint &view,
                                   const StageOptions &options, double metres);

/// What the detector finds in windows of \p frames from poses that are known now, one reading of a place.
std::vector<Trunk> detectAgain(const KeptFrames &frames, const Smoother &smoother, const Viewpoint &view,
                               const StageOptions &options);

/// Fills in what the views say of each hypothesis.
void judge(std::vector<Hypothesis> &hypotheses, const std::vector<EvidenceView> &views, const Viewpoint &view,
           const StageOptions &options, double metres);

/// Those with \p least log-odds, the best first; none stands in the place of a better one.
std::vector<Hypothesis> choose(std::vector<Hypothesis> hypotheses, double least, const StageOptions &options);

/// What each of \p chosen shows in all frames.
std::vector<Adoption> measure(const std::vector<Hypothesis> &chosen, const KeptFrames &frames, const Smoother &smoother,
                              const Viewpoint &view, const StageOptions &options);
} // namespace bole
