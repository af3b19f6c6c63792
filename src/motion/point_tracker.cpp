// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/point_tracker.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
constexpr int kMostPoints = 150;         ///< tracks at a time: more cost time and add little below 0.1 px
constexpr int kColumns = 8, kRows = 6;   ///< cells of the grid that spreads the corners over the image
constexpr double kLeastDistance_px = 8;  ///< between a new corner and any other
constexpr double kQuality = 0.01;        ///< of a corner against the strongest of the image
constexpr double kLeastResponse = 1e-5;  ///< smallest eigenvalue of the gradient moments of a corner, grey 0 to 1
constexpr int kWindow_px = 11;           ///< side of the Lucas-Kanade window, odd
constexpr int kLevels = 3;               ///< pyramid levels above the image: 3 follow 20 px a frame and more
constexpr int kIterations = 10;          ///< of Lucas-Kanade a level
constexpr double kMostBackward_px = 0.3; ///< forward-backward error above which a track ends
constexpr double kMargin_px = 4;         ///< from the border of the image
} // namespace

struct PointTracker::State
{
  PinholeCamera camera;
  std::vector<cv::Mat> pyramid; ///< of the last image
  std::vector<PointTrack> tracks;
  std::uint64_t next_id = 1;
  std::size_t frames = 0;
  cv::Mat response, dilated; ///< kept for their memory

  void follow(const std::vector<cv::Mat> &next, const Eigen::Matrix3d &aRb);
  void replenish(const cv::Mat &image);
};

namespace
{
cv::Mat wrap(const vpImage<unsigned char> &image)
{
  return cv::Mat(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()), CV_8U,
                 const_cast<unsigned char *>(image.bitmap));
}

cv::Point2f toCv(const Eigen::Vector2d &p) { return {float(p.x()), float(p.y())}; }
Eigen::Vector2d toEigen(const cv::Point2f &p) { return {double(p.x), double(p.y)}; }

/// Which parts of the image already hold a point: squares of the minimum distance, looked up in a
/// mask.
class Occupancy
{
public:
  Occupancy(const cv::Size &size, double distance) : m_mask(size, CV_8U, cv::Scalar(0)), m_distance(distance) {}
  void add(const cv::Point2f &p) { cv::circle(m_mask, p, cvRound(m_distance), cv::Scalar(1), cv::FILLED); }
  bool taken(const cv::Point &p) const { return m_mask.at<unsigned char>(p) != 0; }

private:
  cv::Mat m_mask;
  double m_distance;
};

struct Corner
{
  float response;
  cv::Point at;
};

/// The corner to a fraction of a pixel: the vertex of the parabola through the responses, per axis.
Eigen::Vector2d refined(const cv::Mat &response, const cv::Point &at)
{
  const auto vertex = [](float before, float middle, float after) {
    const float curvature = before - 2 * middle + after;
    return curvature < 0 ? std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5) : 0.0;
  };
  const float middle = response.at<float>(at);
  return {at.x + vertex(response.at<float>(at.y, at.x - 1), middle, response.at<float>(at.y, at.x + 1)),
          at.y + vertex(response.at<float>(at.y - 1, at.x), middle, response.at<float>(at.y + 1, at.x))};
}
} // namespace

PointTracker::PointTracker(const PinholeCamera &camera) : m_state(new State) { m_state->camera = camera; }
PointTracker::~PointTracker() = default;
PointTracker::PointTracker(PointTracker &&) noexcept = default;
PointTracker &PointTracker::operator=(PointTracker &&) noexcept = default;

void PointTracker::track(const vpImage<unsigned char> &image, const Eigen::Matrix3d &aRb)
{
  const cv::Mat current = wrap(image);
  if (current.cols != m_state->camera.width || current.rows != m_state->camera.height) {
    throw vpException(vpException::dimensionError,
                      fmt::format("point tracker: image {} x {}, must be {} x {}", current.cols, current.rows,
                                  m_state->camera.width, m_state->camera.height));
  }
  std::vector<cv::Mat> pyramid;
  cv::buildOpticalFlowPyramid(current, pyramid, cv::Size(kWindow_px, kWindow_px), kLevels, true, cv::BORDER_REFLECT_101,
                              cv::BORDER_CONSTANT, false);
  if (!m_state->pyramid.empty() && !m_state->tracks.empty()) {
    m_state->follow(pyramid, aRb);
  }
  m_state->replenish(current);
  m_state->pyramid = std::move(pyramid);
  ++m_state->frames;
}

void PointTracker::State::follow(const std::vector<cv::Mat> &next, const Eigen::Matrix3d &aRb)
{
  const std::size_t n = tracks.size();
  std::vector<cv::Point2f> from(n), to(n), back(n);
  for (std::size_t i = 0; i < n; ++i) {
    from[i] = toCv(tracks[i].current());
    const Eigen::Vector3d turned = aRb.transpose() * camera.ray(tracks[i].current());
    to[i] = turned.z() > 0.1 ? toCv(camera.project(turned)) : from[i];
  }
  const cv::Size window(kWindow_px, kWindow_px);
  const cv::TermCriteria stop(cv::TermCriteria::COUNT | cv::TermCriteria::EPS, kIterations, 0.01);
  std::vector<unsigned char> found, found_back;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(pyramid, next, from, to, found, error, window, kLevels, stop, cv::OPTFLOW_USE_INITIAL_FLOW,
                           1e-4);
  // Back again from where it arrived, started at where it came from: one level settles whether it
  // is the same corner.
  back = from;
  cv::calcOpticalFlowPyrLK(next, pyramid, to, back, found_back, error, window, std::min(1, kLevels), stop,
                           cv::OPTFLOW_USE_INITIAL_FLOW, 1e-4);
  std::vector<PointTrack> kept;
  kept.reserve(n);
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d at = toEigen(to[i]);
    if (!found[i] || !found_back[i] || !camera.contains(at, kMargin_px) ||
        cv::norm(back[i] - from[i]) > kMostBackward_px) {
      continue;
    }
    PointTrack track = std::move(tracks[i]);
    if (track.positions_px.size() >= static_cast<std::size_t>(PointTracker::kHistory)) {
      track.positions_px.erase(track.positions_px.begin());
    }
    track.positions_px.push_back(at);
    kept.push_back(std::move(track));
  }
  tracks = std::move(kept);
}

void PointTracker::State::replenish(const cv::Mat &image)
{
  int missing = kMostPoints - static_cast<int>(tracks.size());
  if (missing <= kMostPoints / 6) {
    return;
  }
  cv::cornerMinEigenVal(image, response, 5, 3);
  cv::dilate(response, dilated, cv::Mat());
  double strongest = 0;
  cv::minMaxLoc(response, nullptr, &strongest);
  const float threshold = float(std::max(kQuality * strongest, kLeastResponse));

  Occupancy occupied(image.size(), kLeastDistance_px);
  const int cells = kColumns * kRows;
  std::vector<int> held(static_cast<std::size_t>(cells), 0);
  const auto cellOf = [&](double x, double y) {
    const int column = std::clamp(int(x * kColumns / image.cols), 0, kColumns - 1);
    const int row = std::clamp(int(y * kRows / image.rows), 0, kRows - 1);
    return static_cast<std::size_t>(row * kColumns + column);
  };
  for (const PointTrack &track : tracks) {
    occupied.add(toCv(track.current()));
    ++held[cellOf(track.current().x(), track.current().y())];
  }
  std::vector<std::vector<Corner>> corners(static_cast<std::size_t>(cells));
  const int margin = std::max(2, cvCeil(kMargin_px) + 1);
  for (int y = margin; y < image.rows - margin; ++y) {
    const float *r = response.ptr<float>(y), *d = dilated.ptr<float>(y);
    for (int x = margin; x < image.cols - margin; ++x) {
      if (r[x] > threshold && r[x] >= d[x]) {
        corners[cellOf(x, y)].push_back({r[x], {x, y}});
      }
    }
  }
  for (auto &cell : corners) {
    std::sort(cell.begin(), cell.end(), [](const Corner &a, const Corner &b) { return a.response < b.response; });
  }
  // Fill the emptiest cells first, one corner a cell and round.
  for (int level = 0; missing > 0; ++level) {
    bool any_left = false;
    for (std::size_t cell = 0; cell < corners.size() && missing > 0; ++cell) {
      any_left = any_left || !corners[cell].empty();
      while (held[cell] <= level && !corners[cell].empty()) {
        const Corner corner = corners[cell].back();
        corners[cell].pop_back();
        if (occupied.taken(corner.at)) {
          continue;
        }
        PointTrack track;
        track.id = next_id++;
        track.response = corner.response;
        track.positions_px.push_back(refined(response, corner.at));
        occupied.add(toCv(track.current()));
        tracks.push_back(std::move(track));
        ++held[cell];
        --missing;
        break;
      }
    }
    if (!any_left) {
      break;
    }
  }
}

const std::vector<PointTrack> &PointTracker::tracks() const { return m_state->tracks; }

std::vector<PointMatch> PointTracker::matches(int frames_back) const
{
  std::vector<PointMatch> matches;
  for (const PointTrack &track : m_state->tracks) {
    if (frames_back >= 1 && track.age() >= frames_back) {
      matches.push_back({*(track.positions_px.rbegin() + frames_back), track.current(), track.id});
    }
  }
  return matches;
}

std::size_t PointTracker::frames() const { return m_state->frames; }

void PointTracker::reset()
{
  m_state->tracks.clear();
  m_state->pyramid.clear();
  m_state->frames = 0;
}
} // namespace bole
