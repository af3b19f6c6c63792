// SPDX-License-Identifier: GPL-2.0-or-later

#include "geometry/so3.h"
#include "saliency/saliency.h"
#include "saliency/saliency_loops.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace bole
{
namespace
{
constexpr double kConvergedStep = 1e-4;  // [rad], 0.02 px at f = 200 px
constexpr double kSigmaIntensity = 0.02; // noise of a pixel, 1 = full scale: 1 to 3 % in rendered and real video
constexpr int kIterations = 5;           // of EM, a level
constexpr double kPull = 0.004;          // how far near things pull the rotation [rad]: .1 to .3 degrees in forests
constexpr double kCorrelation = 30;      // pixels that count as one independent measurement: neighbours share errors

/// Gauss-Newton sums of one M-step.
struct NormalEquations
{
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  double textured = 0, used = 0;
};

LevelNoise levelNoise(const SaliencyOptions &options, int level, bool wide)
{
  const double scale = std::ldexp(1.0, -level);
  // Without a gyro the start may be pixels off: the coarse levels accept that as background.
  const double floor_px = wide && level > options.finest_level ? 0.5 : 0.0;
  const double background = std::max(options.sigma_background_px * scale, floor_px);
  const double foreground = std::max(options.sigma_foreground_px * scale, 2 * background);
  // The mean of four pixels has half the noise.
  const double intensity = kSigmaIntensity * std::max(scale, 0.25);
  return {static_cast<float>(background * background), static_cast<float>(foreground * foreground),
          static_cast<float>(intensity * intensity),
          static_cast<float>(std::log(kBackgroundPrior / (1 - kBackgroundPrior)))};
}

LevelImages imagesOf(const PyramidLevel &level, int row)
{
  const std::size_t at = static_cast<std::size_t>(row) * level.image.getWidth();
  return {level.image.bitmap + at, level.gradient_x.bitmap + at, level.gradient_y.bitmap + at};
}

class LevelPass
{
public:
  LevelPass(const PyramidLevel &previous, const PyramidLevel &current, const SaliencyOptions &options, int level,
            bool wide)
      : m_previous(previous), m_current(current), m_noise(levelNoise(options, level, wide))
  {
  }

  /// One E-step at \p pRc and the sums of the M-step; \p log_ratio is filled where given.
  NormalEquations operator()(const Eigen::Matrix3d &pRc, vpImage<float> *log_ratio) const
  {
    const PinholeCamera &camera = m_current.camera;
    const PlaneWarp warp(camera, Pose(pRc, Eigen::Vector3d::Zero()));
    RotationRow row;
    row.previous = imagesOf(m_previous, 0);
    row.width = camera.width;
    row.height = camera.height;
    row.fx = static_cast<float>(camera.fx);
    row.fy = static_cast<float>(camera.fy);
    row.cx = static_cast<float>(camera.cx);
    row.noise = m_noise;
    Eigen::Vector3f::Map(row.by_column) = warp.H.col(0);
    NormalEquations sums;
    for (row.row = 1; row.row + 1 < row.height; ++row.row) {
      row.current = imagesOf(m_current, row.row);
      row.y = static_cast<float>((row.row - camera.cy) / camera.fy);
      Eigen::Vector3f::Map(row.base) = static_cast<float>(row.row) * warp.H.col(1) + warp.H.col(2);
      add(sumsOfRow(row, m_scratch, log_ratio ? (*log_ratio)[row.row] : nullptr), sums);
    }
    return sums;
  }

private:
  static void add(const RotationSums &row, NormalEquations &sums)
  {
    Eigen::Matrix3f H;
    H << row.H[0], row.H[1], row.H[2], row.H[1], row.H[3], row.H[4], row.H[2], row.H[4], row.H[5];
    sums.H += H.cast<double>();
    sums.g += Eigen::Vector3f::Map(row.g).cast<double>();
    sums.used += row.used;
    sums.textured += row.textured;
  }

  const PyramidLevel &m_previous, &m_current;
  LevelNoise m_noise;
  mutable std::vector<float> m_scratch;
};

Eigen::Matrix3d inverseOf(const Eigen::Matrix3d &A) { return A.ldlt().solve(Eigen::Matrix3d::Identity()); }
} // namespace

RotationEm estimateRotation(const ImagePyramid &previous, const ImagePyramid &current,
                            const std::optional<RotationPrior> &prior, const Eigen::Matrix3d &start,
                            const SaliencyOptions &options, bool with_labels)
{
  RotationEm result;
  result.pRc = prior ? prior->pRc : start;
  const bool wide = !prior;
  // A blank image leaves this: any rotation up to half a turn a second or so.
  const Eigen::Matrix3d vague = Eigen::Matrix3d::Identity() / (0.3 * 0.3);
  const Eigen::Matrix3d prior_information = prior ? inverseOf(prior->covariance) : vague;
  const int finest = std::min(options.finest_level, current.levels() - 1);
  const int coarsest = prior ? std::min(finest + 1, current.levels() - 1) : current.levels() - 1;
  Eigen::Matrix3d information = prior_information;
  NormalEquations sums;
  for (int level = coarsest; level >= finest; --level) {
    const LevelPass pass(previous[level], current[level], options, level, wide);
    for (int iteration = 0; iteration < kIterations; ++iteration) {
      sums = pass(result.pRc, nullptr);
      const Eigen::Vector3d off_prior = prior ? logSo3(prior->pRc.transpose() * result.pRc) : Eigen::Vector3d::Zero();
      // The images' own step, trusted no further than near things may pull it.
      const Eigen::Matrix3d H = sums.H + 1e-3 * Eigen::Matrix3d::Identity();
      const Eigen::Vector3d image_step = H.ldlt().solve(sums.g);
      const Eigen::Matrix3d image_information =
          inverseOf(inverseOf(H) * kCorrelation + kPull * kPull * Eigen::Matrix3d::Identity());
      information = image_information + prior_information;
      const Eigen::Vector3d step =
          -information.ldlt().solve(image_information * image_step + prior_information * off_prior);
      if (!step.allFinite() || step.norm() > 0.5)
        break;
      result.pRc = orthonormalized(result.pRc * expSo3(step));
      if (step.norm() < kConvergedStep)
        break;
    }
  }
  result.covariance = inverseOf(information);
  if (with_labels) {
    result.log_ratio.resize(current[finest].image.getHeight(), current[finest].image.getWidth());
    result.log_ratio = 0.f;
    sums = LevelPass(previous[finest], current[finest], options, finest, false)(result.pRc, &result.log_ratio);
  }
  result.texture = sums.used > 0 ? sums.textured / sums.used : 0;
  return result;
}
} // namespace bole
