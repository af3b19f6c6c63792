// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A few corners, spread over the image and tracked from frame to frame: the paper's own future
/// work
/// ("track a small number of point features to aid in pose estimation", Section 9).
///
/// Idea: Shi-Tomasi corners, the strongest of each cell of a grid, followed by pyramidal
/// Lucas-Kanade (both OpenCV's). A track lives as long as it, followed forward and back again, ends
/// where it began. Lost tracks are replaced where the image is empty of them, so a wall in view
/// costs tracks there and nowhere else.
///
/// Positions are pixels of the rectified image, pixel centres whole. One instance a video; not
/// thread-safe. Cost: about 2 ms a frame at 320x240 with 150 points in one thread
/// (benchmark_motion).

#include <bole/camera.h>

#include <cstdint>
#include <memory>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// A corner over the last frames.
struct PointTrack
{
  std::uint64_t id = 0;                      ///< never used twice
  std::vector<Eigen::Vector2d> positions_px; ///< oldest first; the last one is in the current frame

  const Eigen::Vector2d &current() const { return positions_px.back(); }
  /// Number of frames back to which the track reaches: 0 for a new one.
  int age() const { return static_cast<int>(positions_px.size()) - 1; }
};

/// One corner in two frames, a (earlier) and b (later).
struct PointMatch
{
  Eigen::Vector2d a_px, b_px;
};

/// Example:
/// \code
/// PointTracker points(camera);
/// while (source.next(frame)) {
///   points.track(frame.image);
///   const auto matches = points.matches(3); // between the current frame and the third before it
/// }
/// \endcode
class PointTracker
{
public:
  static constexpr int kHistory = 32; ///< frames that a track remembers

  explicit PointTracker(const PinholeCamera &camera);
  ~PointTracker();
  PointTracker(PointTracker &&) noexcept;
  PointTracker &operator=(PointTracker &&) noexcept;

  /// Follows the tracks into \p image and replenishes them. \p aRb is the expected rotation from
  /// this frame (b) to the one before (a), camera axes: it moves the start of the search. An image
  /// of another size than the camera's throws vpException.
  void track(const vpImage<unsigned char> &image, const Eigen::Matrix3d &aRb = Eigen::Matrix3d::Identity());

  const std::vector<PointTrack> &tracks() const;
  /// Tracks seen in the current frame and in the one \p frames_back before it (1: the last one).
  std::vector<PointMatch> matches(int frames_back) const;
  /// Logarithm of the brightness of the current image over that of the one before it: the camera's exposure.
  double brightnessChange() const;
  /// Forgets the last image: the next one is tracked from the one before it. Tracks that it ended stay ended. Once
  /// after each track().
  void forgetLast();

private:
  struct State;
  std::unique_ptr<State> m_state;
};
} // namespace bole
