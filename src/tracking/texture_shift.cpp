// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/texture_shift.h"

#include "tracking/tracking_loops.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <vector>

namespace bole
{
namespace
{
constexpr double kInside = 0.7;      ///< part of the half width that is surely inside
constexpr double kFromBorder_px = 3; ///< least distance from the borders
constexpr int kLeastHalf_px = 3;     ///< half width of the pixels looked at
constexpr int kRowsApart = 2;
constexpr int kVertical_px = 10; ///< largest shift along the trunk: of a height that is told to some centimetres
constexpr int kLeastPixels = 150;
constexpr double kShared = 4; ///< pixels that share what is wrong in them
constexpr double kGrey = 2;   ///< least error of a pixel [grey levels]

/// The bark as the image before shows it, at the pixels of the newer one where it is expected.
struct Patch
{
  struct Row
  {
    int y, x, n;
    std::size_t first; ///< of its pixels
  };
  std::vector<Row> rows;
  std::vector<float> pixels; ///< grey levels less their mean
  double squares = 0;        ///< sum of theirs
  Eigen::Vector2d middle_px = Eigen::Vector2d::Zero();
};

/// Takes the mean off the pixels.
void centre(Patch &patch)
{
  const double sum = std::accumulate(patch.pixels.begin(), patch.pixels.end(), 0.0);
  const auto mean = static_cast<float>(sum / double(patch.pixels.size()));
  for (float &pixel : patch.pixels) {
    pixel -= mean;
    patch.squares += double(pixel) * pixel;
  }
}

/// Grey level between pixels by linear interpolation; -1 outside of the image.
double interpolated(const vpImage<unsigned char> &image, const Eigen::Vector2d &u_px)
{
  const int x = static_cast<int>(std::floor(u_px.x())), y = static_cast<int>(std::floor(u_px.y()));
  if (!(x >= 0 && y >= 0 && x + 1 < static_cast<int>(image.getWidth()) && y + 1 < static_cast<int>(image.getHeight())))
    return -1;
  const double dx = u_px.x() - x, dy = u_px.y() - y;
  const unsigned char *top = image[static_cast<unsigned>(y)] + x, *bottom = image[static_cast<unsigned>(y) + 1] + x;
  return (1 - dy) * ((1 - dx) * top[0] + dx * top[1]) + dy * ((1 - dx) * bottom[0] + dx * bottom[1]);
}

/// What moves a pixel of the newer image to where the one before shows the same bark.
class TextureWarp
{
public:
  TextureWarp(const TextureView &before, const TextureView &now, const PinholeCamera &camera, const Trunk &trunk)
      : m_camera(camera),
        m_aMb(before.wMc.inverse() * now.wMc),
        m_relative(relativeTrunk(now.wMc, Pose(), trunk)),
        m_radius(trunk.radius()),
        m_distance(m_radius / m_relative.ratio()),
        m_tRc(m_relative.cRt.transpose())
  {
  }
  const RelativeTrunk &relative() const { return m_relative; }
  Eigen::Vector3d inTrunk(const Eigen::Vector2d &u_px) const { return m_tRc * m_camera.ray(u_px); }

  /// Where a pixel was in the image before; none beside the trunk or behind that camera.
  std::optional<Eigen::Vector2d> operator()(const Eigen::Vector2d &u_px) const
  {
    const Eigen::Vector3d ray = inTrunk(u_px);
    const double level2 = ray.head<2>().squaredNorm(), along = ray.x() * m_distance / level2;
    const double inner = along * along - (m_distance * m_distance - m_radius * m_radius) / level2;
    if (!(inner > 0))
      return std::nullopt;
    const Eigen::Vector3d a = m_aMb * Eigen::Vector3d(m_relative.cRt * ((along - std::sqrt(inner)) * ray));
    if (a.z() <= 0)
      return std::nullopt;
    return m_camera.project(a);
  }

private:
  PinholeCamera m_camera;
  Pose m_aMb;
  RelativeTrunk m_relative;
  double m_radius, m_distance;
  Eigen::Matrix3d m_tRc;
};

/// \p margin_px: columns that a shift may need beside the patch.
Patch patchOf(const TextureWarp &warp, const TextureView &before, const PinholeCamera &camera,
              const ElevationRange &part, int margin_px)
{
  Patch patch;
  const RelativeTrunk &trunk = warp.relative();
  const auto axisAt = [&](double slope) { return Eigen::Vector3d(trunk.cRt * Eigen::Vector3d(1, 0, slope)); };
  const Eigen::Vector3d low = axisAt(part.low), high = axisAt(part.high);
  if (low.z() <= 0.1 || high.z() <= 0.1)
    return patch;
  const Eigen::Vector2d foot = camera.project(low), top = camera.project(high);
  const double half = camera.fx * trunk.ratio(), inner = std::min(kInside * half, half - kFromBorder_px);
  if (inner < kLeastHalf_px || foot.y() - top.y() < 1)
    return patch;
  const double slope = (foot.x() - top.x()) / (foot.y() - top.y());
  const int last = std::min(static_cast<int>(foot.y()), camera.height - 1 - kVertical_px);
  for (int y = std::max(static_cast<int>(std::ceil(top.y())), kVertical_px); y <= last; y += kRowsApart) {
    const double x = top.x() + slope * (y - top.y());
    const int left = static_cast<int>(std::ceil(x - inner)), right = static_cast<int>(std::floor(x + inner));
    if (left < margin_px || right >= camera.width - margin_px)
      continue;
    const std::size_t first = patch.pixels.size();
    for (int column = left; column <= right; ++column) {
      const auto a_px = warp({column, y});
      const double grey = a_px ? interpolated(before.image, *a_px) : -1;
      if (grey < 0)
        break;
      patch.pixels.push_back(static_cast<float>(grey));
    }
    if (patch.pixels.size() != first + static_cast<std::size_t>(right - left + 1)) {
      patch.pixels.resize(first);
      continue;
    }
    patch.rows.push_back({y, left, right - left + 1, first});
    patch.middle_px += Eigen::Vector2d(x, y);
  }
  if (patch.rows.empty())
    return patch;
  patch.middle_px /= double(patch.rows.size());
  centre(patch);
  return patch;
}

/// Sum of the squared differences at a shift, without the difference of the means.
double differenceAt(const Patch &patch, const vpImage<unsigned char> &image, int dx, int dy)
{
  PatchSums sums;
  for (const Patch::Row &row : patch.rows)
    addPatchRow(image[static_cast<unsigned>(row.y + dy)] + row.x + dx, &patch.pixels[row.first], row.n, sums);
  const double n = double(patch.pixels.size());
  return patch.squares + sums.square - sums.sum * sums.sum / n - 2 * sums.product;
}

struct AcrossMinimum
{
  double shift_px = 0, sigma_px = 0;
};

/// The minimum for the left or the right half of the patch.
std::optional<AcrossMinimum> halfMinimum(const Patch &patch, bool right, const vpImage<unsigned char> &image,
                                         int across, int dy)
{
  Patch half;
  for (const Patch::Row &row : patch.rows) {
    const int n = row.n / 2, skipped = right ? row.n - n : 0;
    half.rows.push_back({row.y, row.x + skipped, n, half.pixels.size()});
    const auto from = patch.pixels.begin() + static_cast<std::ptrdiff_t>(row.first) + skipped;
    half.pixels.insert(half.pixels.end(), from, from + n);
  }
  centre(half);
  std::vector<double> difference;
  for (int dx = -across; dx <= across; ++dx)
    difference.push_back(differenceAt(half, image, dx, dy));
  const auto best = std::min_element(difference.begin(), difference.end());
  if (best == difference.begin() || best + 1 == difference.end())
    return std::nullopt;
  const double curvature = *(best - 1) + *(best + 1) - 2 * *best;
  const double grey2 = std::max(*best / double(half.pixels.size()), kGrey * kGrey);
  if (curvature <= 0)
    return std::nullopt;
  return AcrossMinimum{double(best - difference.begin()) - across + 0.5 * (*(best - 1) - *(best + 1)) / curvature,
                       std::sqrt(2 * kShared * grey2 / curvature)};
}

/// Whether both halves of the patch move alike: what moves otherwise in one half is no bark, or not all of it.
bool isRigid(const Patch &patch, const vpImage<unsigned char> &image, int across, int dy)
{
  constexpr double kSigmas = 3, kLeast_px = 0.3, kMost_px = 1;
  const auto left = halfMinimum(patch, false, image, across, dy), right = halfMinimum(patch, true, image, across, dy);
  if (!left || !right)
    return true; // one half shows too little
  const double sigma = std::hypot(left->sigma_px, right->sigma_px, kLeast_px);
  return sigma > kMost_px || std::abs(left->shift_px - right->shift_px) < kSigmas * sigma;
}
} // namespace

std::optional<TextureShift> textureShift(const TextureView &before, const TextureView &now, const PinholeCamera &camera,
                                         const Trunk &trunk, const ElevationRange &part, double search_px)
{
  constexpr double kUnique = 9; // chi-squared (1) by which another shift must be worse
  constexpr double kLeastSigma_px = 0.15, kMostSigma_px = 0.7;
  const TextureWarp warp(before, now, camera, trunk);
  if (!warp.relative().isFinite())
    return std::nullopt;
  const int across = static_cast<int>(std::ceil(std::clamp(search_px, 1.0, 30.0))) + 1;
  const Patch patch = patchOf(warp, before, camera, part, across);
  if (patch.pixels.size() < kLeastPixels)
    return std::nullopt;
  const int columns = 2 * across + 1, rows = 2 * kVertical_px + 1;
  Eigen::MatrixXd difference(columns, rows);
  for (int dy = 0; dy < rows; ++dy)
    for (int dx = 0; dx < columns; ++dx)
      difference(dx, dy) = differenceAt(patch, now.image, dx - across, dy - kVertical_px);
  Eigen::Index x = 0, y = 0;
  const double least = difference.minCoeff(&x, &y);
  if (x == 0 || y == 0 || x == columns - 1 || y == rows - 1)
    return std::nullopt;
  Eigen::Vector2d gradient(0.5 * (difference(x + 1, y) - difference(x - 1, y)),
                           0.5 * (difference(x, y + 1) - difference(x, y - 1)));
  Eigen::Matrix2d curvature;
  curvature(0, 0) = difference(x + 1, y) + difference(x - 1, y) - 2 * least;
  curvature(1, 1) = difference(x, y + 1) + difference(x, y - 1) - 2 * least;
  curvature(0, 1) = curvature(1, 0) = 0.25 * (difference(x + 1, y + 1) - difference(x - 1, y + 1) -
                                              difference(x + 1, y - 1) + difference(x - 1, y - 1));
  const Eigen::LDLT<Eigen::Matrix2d> solver(curvature);
  if (solver.vectorD().minCoeff() <= 0)
    return std::nullopt;
  const double grey2 = std::max(least / double(patch.pixels.size()), kGrey * kGrey);
  const Eigen::Matrix2d covariance = 2 * kShared * grey2 * solver.solve(Eigen::Matrix2d::Identity());
  const double sigma_px = std::max(std::sqrt(covariance(0, 0)), kLeastSigma_px);
  if (!(sigma_px <= kMostSigma_px))
    return std::nullopt;
  for (Eigen::Index dy = 0; dy < rows; ++dy)
    for (Eigen::Index dx = 0; dx < columns; ++dx)
      if ((std::abs(dx - x) > 2 || std::abs(dy - y) > 2) && difference(dx, dy) < least + kUnique * kShared * grey2)
        return std::nullopt;
  if (!isRigid(patch, now.image, across, static_cast<int>(y) - kVertical_px))
    return std::nullopt;
  const Eigen::Vector2d finer = (-solver.solve(gradient)).cwiseMax(-1.0).cwiseMin(1.0);
  const Eigen::Vector2d shift(double(x) - across + finer.x(), double(y) - kVertical_px + finer.y());
  const Eigen::Vector3d expected = warp.inTrunk(patch.middle_px), real = warp.inTrunk(patch.middle_px + shift);
  return TextureShift{std::atan2(real.y(), real.x()) - std::atan2(expected.y(), expected.x()),
                      std::pow(sigma_px / camera.fx, 2)};
}
} // namespace bole
