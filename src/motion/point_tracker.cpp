// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/point_tracker.h"

#include "geometry/failure.h"
#include "geometry/median.h"
#include "motion/coarse_shift.h"
#include "motion/image_view.h"
#include "motion/lucas_kanade.h"
#include "motion/window_loops.h"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cstring>
#include <optional>

namespace bole
{
namespace
{
constexpr int kMostPoints = 150;         ///< tracks at a time: more cost time and add little below 0.1 px
constexpr int kColumns = 8, kRows = 6;   ///< cells of the grid that spreads the corners over the image
constexpr double kLeastDistance_px = 8;  ///< between a new corner and any other
constexpr double kQuality = 0.01;        ///< of a corner against the strongest of the image
constexpr double kLeastResponse = 1e-5;  ///< smallest eigenvalue of the gradient moments of a corner, grey 0 to 1
constexpr int kLevels = 3;               ///< pyramid levels above the image: 3 follow 20 px a frame and more
constexpr double kMostBackward_px = 0.3; ///< forward-backward error above which a track ends
constexpr double kEnough = 0.5;          ///< of the tracks: fewer, and the picture may have turned out of their reach
constexpr double kMargin_px = 4;         ///< from the border of the image

struct Corner
{
  float response;
  cv::Point at;
};
} // namespace

struct PointTracker::State
{
  PinholeCamera camera;
  GreyPyramid pyramid, next; ///< of the last image and of the one before it
  std::vector<PointTrack> tracks;
  std::uint64_t next_id = 1;
  double brightness_change = 0;
  cv::Mat response; ///< kept for its memory
  CornerScratch scratch;
  std::vector<unsigned char> peaks;         ///< of a row
  std::vector<std::vector<Corner>> corners; ///< of each cell

  template <typename Start>
  std::pair<std::vector<std::optional<Eigen::Vector2d>>, std::size_t> search(const Start &start) const;
  void follow(const Eigen::Matrix3d &aRb);
  void replenish(const cv::Mat &image);
};

namespace
{
cv::Point2f toCv(const Eigen::Vector2d &p) { return {float(p.x()), float(p.y())}; }
Eigen::Vector2d toEigen(const cv::Point2f &p) { return {double(p.x), double(p.y)}; }

/// Logarithm of the brightness of \p now over that of \p before, whose picture has moved by \p shift [px]. What comes
/// into view changes the mean, and hardly the median of all ratios. 0 where too little is neither dark nor saturated.
double changeOfBrightness(const GreyPyramid &before, const GreyPyramid &now, const Eigen::Vector2d &shift)
{
  constexpr int kDarkest = 4, kBrightest = 245; // grey levels that tell how much light there is
  constexpr double kLeastShare = 0.1;           // of the pixels
  const cv::Mat &a = before.back(), &b = now.back();
  const Eigen::Vector2d coarse = std::ldexp(1.0, 1 - static_cast<int>(now.size())) * shift;
  cv::Mat moved;
  cv::warpAffine(a, moved, cv::Matx23d(1, 0, coarse.x(), 0, 1, coarse.y()), a.size(), cv::INTER_LINEAR,
                 cv::BORDER_CONSTANT, cv::Scalar(0));
  const auto tells = [](int level) { return level >= kDarkest && level <= kBrightest; };
  std::vector<double> ratios;
  for (int y = 0; y < b.rows; ++y)
    for (int x = 0; x < b.cols; ++x)
      if (const int from = moved.at<unsigned char>(y, x), to = b.at<unsigned char>(y, x); tells(from) && tells(to))
        ratios.push_back(static_cast<double>(to) / from);
  return static_cast<double>(ratios.size()) < kLeastShare * static_cast<double>(b.total())
             ? 0
             : std::log(medianOf(std::move(ratios)));
}

/// Makes the image \p before brighter by the factor \p ratio.
void brighten(GreyPyramid &before, double ratio)
{
  cv::Mat brighter;
  before.front().convertTo(brighter, CV_8U, ratio);
  buildPyramid(brighter, kLevels, before);
}

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
  const cv::Mat current = viewOf(image);
  if (current.cols != m_state->camera.width || current.rows != m_state->camera.height)
    throw dimensionError("point tracker: image {} x {}, must be {} x {}", current.cols, current.rows,
                         m_state->camera.width, m_state->camera.height);
  buildPyramid(current, kLevels, m_state->next);
  m_state->brightness_change = 0;
  if (!m_state->pyramid.empty() && !m_state->tracks.empty())
    m_state->follow(aRb);
  m_state->replenish(current);
  m_state->pyramid.swap(m_state->next);
}

/// Where each track is now, searched from \p start on; nothing where it ended. Second: how many go on.
template <typename Start>
std::pair<std::vector<std::optional<Eigen::Vector2d>>, std::size_t>
PointTracker::State::search(const Start &start) const
{
  constexpr int kBack = 1; // started where it came from, one level settles whether it is the same corner
  std::vector<std::optional<Eigen::Vector2d>> places(tracks.size());
  std::size_t found = 0;
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    const cv::Point2f from = toCv(tracks[i].current());
    cv::Point2f to = start(tracks[i].current()), again = from;
    if (!followWindow(pyramid, next, from, to, kLevels) || !camera.contains(toEigen(to), kMargin_px) ||
        !followWindow(next, pyramid, to, again, kBack) || cv::norm(again - from) > kMostBackward_px)
      continue;
    places[i] = toEigen(to);
    ++found;
  }
  return {std::move(places), found};
}

void PointTracker::State::follow(const Eigen::Matrix3d &aRb)
{
  constexpr double kLeastChange = 0.1;   // of brightness: less is followed as it is
  constexpr std::size_t kLeastFound = 8; // that tell how the picture moved
  const auto turned = [&](const Eigen::Vector2d &from) {
    const Eigen::Vector3d ray = aRb.transpose() * camera.ray(from);
    return ray.z() > 0.1 ? Eigen::Vector2d(camera.project(ray)) : from;
  };
  const Eigen::Vector2d middle(0.5 * camera.width, 0.5 * camera.height);
  brightness_change = changeOfBrightness(pyramid, next, turned(middle) - middle);
  const bool is_brighter = std::abs(brightness_change) > kLeastChange;
  if (is_brighter)
    brighten(pyramid, std::exp(brightness_change));
  auto [places, found] = search([&](const Eigen::Vector2d &from) { return toCv(turned(from)); });
  if (double(found) < kEnough * double(tracks.size())) { // turned farther than was expected?
    const Eigen::Vector2d shift = coarseShift(pyramid.front(), next.front());
    auto shifted = search([&](const Eigen::Vector2d &from) { return toCv(from + shift); });
    if (shifted.second > found)
      places = std::move(shifted.first);
  }
  std::vector<Eigen::Vector2d> moved;
  for (std::size_t i = 0; i < tracks.size(); ++i)
    if (places[i])
      moved.push_back(*places[i] - tracks[i].current());
  if (moved.size() >= kLeastFound)
    brightness_change = (is_brighter ? brightness_change : 0) + changeOfBrightness(pyramid, next, medianByAxis(moved));
  std::vector<PointTrack> kept;
  kept.reserve(kMostPoints);
  for (std::size_t i = 0; i < tracks.size(); ++i) {
    PointTrack &track = tracks[i];
    if (!places[i])
      continue;
    if (track.positions_px.size() >= static_cast<std::size_t>(PointTracker::kHistory))
      track.positions_px.erase(track.positions_px.begin());
    track.positions_px.push_back(*places[i]);
    kept.push_back(std::move(track));
  }
  tracks = std::move(kept);
}

void PointTracker::State::replenish(const cv::Mat &image)
{
  int missing = kMostPoints - static_cast<int>(tracks.size());
  if (missing <= kMostPoints / 6)
    return;
  response.create(image.size(), CV_32F);
  const double strongest = cornerResponse(image.ptr(), image.cols, image.rows, scratch, response.ptr<float>());
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
  corners.resize(static_cast<std::size_t>(cells));
  for (auto &cell : corners)
    cell.clear();
  const int margin = std::max(2, cvCeil(kMargin_px) + 1);
  peaks.resize(static_cast<std::size_t>(image.cols));
  for (int y = margin; y < image.rows - margin; ++y) {
    const float *r = response.ptr<float>(y);
    peaksOfRow(r, image.cols, threshold, peaks.data());
    for (int x = margin - 1;;) {
      const void *peak = std::memchr(&peaks[static_cast<std::size_t>(x + 1)], 1,
                                     static_cast<std::size_t>(image.cols - margin - x - 1));
      if (!peak)
        break;
      x = static_cast<int>(static_cast<const unsigned char *>(peak) - peaks.data());
      corners[cellOf(x, y)].push_back({r[x], {x, y}});
    }
  }
  for (auto &cell : corners)
    std::sort(cell.begin(), cell.end(), [](const Corner &a, const Corner &b) { return a.response < b.response; });
  // Fill the emptiest cells first, one corner a cell and round.
  for (int level = 0; missing > 0; ++level) {
    bool any_left = false;
    for (std::size_t cell = 0; cell < corners.size() && missing > 0; ++cell) {
      any_left = any_left || !corners[cell].empty();
      while (held[cell] <= level && !corners[cell].empty()) {
        const Corner corner = corners[cell].back();
        corners[cell].pop_back();
        if (occupied.taken(corner.at) || roundness(next.front(), corner.at) < kLeastRoundness)
          continue;
        PointTrack track;
        track.id = next_id++;
        track.positions_px.push_back(refined(response, corner.at));
        occupied.add(toCv(track.current()));
        tracks.push_back(std::move(track));
        ++held[cell];
        --missing;
        break;
      }
    }
    if (!any_left)
      break;
  }
}

const std::vector<PointTrack> &PointTracker::tracks() const { return m_state->tracks; }

std::vector<PointMatch> PointTracker::matches(int frames_back) const
{
  std::vector<PointMatch> matches;
  for (const PointTrack &track : m_state->tracks)
    if (frames_back >= 1 && track.age() >= frames_back)
      matches.push_back({*(track.positions_px.rbegin() + frames_back), track.current()});
  return matches;
}

double PointTracker::brightnessChange() const { return m_state->brightness_change; }

void PointTracker::forgetLast()
{
  std::vector<PointTrack> &tracks = m_state->tracks;
  for (PointTrack &track : tracks)
    track.positions_px.pop_back();
  tracks.erase(
      std::remove_if(tracks.begin(), tracks.end(), [](const PointTrack &track) { return track.positions_px.empty(); }),
      tracks.end());
  m_state->pyramid.swap(m_state->next);
}
} // namespace bole
