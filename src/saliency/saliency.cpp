// SPDX-License-Identifier: GPL-2.0-or-later
#include "saliency/saliency.h"
#include "geometry/failure.h"
#include "geometry/so3.h"
#include "saliency/saliency_loops.h"

#include <algorithm>
#include <cmath>
#include <cstring>

namespace bole
{
namespace
{
constexpr double kLeastTexture = 0.002;  // share of textured pixels that a rotation needs
constexpr double kEnoughParallax_px = 3; // a pair of frames suffices when a point at near_range moves so much
constexpr double kTranslationNoiseScale =
    0.5;                                 // of the prior's deviation in the sweep: its error moves all depths alike
constexpr double kMaxTurnOffGyro = 0.05; // [rad]; further than any gyro errs within a frame

int workingLevel(const PinholeCamera &camera, const SaliencyOptions &options)
{
  int level = 0;
  for (int size = std::min(camera.width, camera.height); level < options.finest_level && size >= 32; size /= 2)
    ++level;
  return level;
}

PinholeCamera workingCamera(const PinholeCamera &camera, int level)
{
  PinholeCamera result = camera;
  for (int i = 0; i < level; ++i) {
    const int width = result.width / 2, height = result.height / 2;
    result = result.scaled(0.5);
    result.width = width;
    result.height = height;
  }
  return result;
}

/// Where the pixels of a line of \p size lie in one of \p small_size, 1 / \p scale times smaller; pixel centres
/// respected.
ColumnsBetween between(int size, int small_size, float scale, int step)
{
  ColumnsBetween result;
  for (int j = 0; j < size; ++j) {
    const float x = std::clamp(((j + 0.5f) * scale - 0.5f) / step, 0.f, small_size - 1.f);
    result.left.push_back(std::min(static_cast<int>(x), small_size - 2));
    result.share.push_back(x - result.left.back());
  }
  return result;
}

/// Mean over a square window, clipped at the border of the image.
vpImage<float> windowMean(const vpImage<float> &image)
{
  constexpr int kWindow = 7; // [px at the working level]
  const int half = kWindow / 2, height = static_cast<int>(image.getHeight()),
            width = static_cast<int>(image.getWidth());
  vpImage<float> across(image.getHeight(), image.getWidth()), result(image.getHeight(), image.getWidth());
  const float scale = 1.f / kWindow;
  for (int i = 0; i < height; ++i)
    for (int j = 0; j < width; ++j) {
      float sum = 0;
      for (int k = std::max(0, j - half); k <= std::min(width - 1, j + half); ++k)
        sum += image[i][k];
      across[i][j] = scale * sum;
    }
  result = 0.f;
  for (int i = 0; i < height; ++i)
    for (int k = std::max(0, i - half); k <= std::min(height - 1, i + half); ++k)
      for (int j = 0; j < width; ++j)
        result[i][j] += scale * across[k][j];
  return result;
}

double meanDeviation(const Eigen::Matrix3d &covariance) { return std::sqrt(std::max(covariance.trace(), 0.0) / 3); }
} // namespace

SaliencyEstimator::SaliencyEstimator(const PinholeCamera &camera, const SaliencyOptions &options)
    : m_camera(camera),
      m_options(options),
      m_evidence(workingCamera(camera, workingLevel(camera, options)), workingLevel(camera, options), options)
{
}

void SaliencyEstimator::reset()
{
  m_views.clear();
  m_evidence.clear();
  m_last_image.resize(0, 0);
  m_last_turn.setIdentity();
  m_has_pending_motion = false;
}

Saliency SaliencyEstimator::update(const vpImage<unsigned char> &image, const std::optional<RotationPrior> &gyro,
                                   const std::optional<TranslationPrior> &translation)
{
  if (static_cast<int>(image.getWidth()) != m_camera.width || static_cast<int>(image.getHeight()) != m_camera.height)
    throw dimensionError("saliency: image of {} x {} pixels, must be {} x {}", image.getWidth(), image.getHeight(),
                         m_camera.width, m_camera.height);
  addMotion(gyro, translation);
  if (isStale(image)) {
    Saliency result;
    fill(m_labels, result);
    result.covariance.setZero();
    return result;
  }
  Saliency result;
  View view{ImagePyramid(image, m_camera, m_options.levels, m_options.finest_level), {}};
  if (m_views.empty()) {
    const float prior = m_evidence.priorLogOdds();
    m_labels = {vpImage<float>(image.getHeight(), image.getWidth(), prior), 0, 1, prior};
  }
  else {
    const RotationEm rotation = refineRotation(view.pyramid, result);
    if (asksForRange()) {
      view.vMc = m_views.front().vMc * Pose(result.pRc, m_translation->pt);
      m_views.push_front(std::move(view));
      m_labels = labelByRange(m_views.front().pyramid, result);
    }
    else {
      m_labels = labelByMotion(rotation);
      m_views.clear();
      m_evidence.clear();
    }
    m_last_turn = result.pRc;
  }
  if (m_views.empty())
    m_views.push_front(std::move(view));
  while (static_cast<int>(m_views.size()) > m_options.max_frames_apart + 1)
    m_views.pop_back();
  m_last_image = image;
  m_has_pending_motion = false;
  fill(m_labels, result);
  return result;
}

bool SaliencyEstimator::isStale(const vpImage<unsigned char> &image) const
{
  return m_last_image.getSize() == image.getSize() &&
         std::memcmp(m_last_image.bitmap, image.bitmap, image.getSize()) == 0;
}

void SaliencyEstimator::addMotion(const std::optional<RotationPrior> &gyro,
                                  const std::optional<TranslationPrior> &translation)
{
  const bool usable_gyro = gyro && gyro->pRc.allFinite() && gyro->covariance.allFinite();
  const bool usable_translation = translation && translation->pt.allFinite() && translation->covariance.allFinite();
  if (!m_has_pending_motion) {
    m_gyro = usable_gyro ? gyro : std::nullopt;
    m_translation = usable_translation ? translation : std::nullopt;
  }
  else {
    if (m_translation && usable_translation) {
      // Images were stale in between: the way goes on from where the last rotation ended.
      const Eigen::Matrix3d turned = m_gyro ? m_gyro->pRc : Eigen::Matrix3d::Identity();
      m_translation->pt += turned * translation->pt;
      m_translation->covariance += turned * translation->covariance * turned.transpose();
    }
    else
      m_translation.reset();
    if (m_gyro && usable_gyro) {
      m_gyro->covariance = gyro->pRc.transpose() * m_gyro->covariance * gyro->pRc + gyro->covariance;
      m_gyro->pRc = m_gyro->pRc * gyro->pRc;
    }
    else
      m_gyro.reset();
  }
  m_has_pending_motion = true;
}

RotationEm SaliencyEstimator::refineRotation(const ImagePyramid &current, Saliency &result) const
{
  const RotationEm rotation =
      estimateRotation(m_views.front().pyramid, current, m_gyro, m_last_turn, m_options, !asksForRange());
  result.pRc = rotation.pRc;
  result.covariance = rotation.covariance;
  const Eigen::Matrix3d fallback = m_gyro ? m_gyro->pRc : Eigen::Matrix3d::Identity();
  const bool off_gyro = m_gyro && logSo3(fallback.transpose() * rotation.pRc).norm() > kMaxTurnOffGyro;
  if (rotation.texture < kLeastTexture || !rotation.pRc.allFinite() || !rotation.covariance.allFinite() || off_gyro) {
    result.pRc = fallback;
    result.covariance = m_gyro ? m_gyro->covariance : Eigen::Matrix3d(Eigen::Matrix3d::Identity() * 0.1);
  }
  return rotation;
}

SaliencyEstimator::CoarseLabels SaliencyEstimator::labelByRange(const ImagePyramid &current, const Saliency &result)
{
  const int level = workingLevel(m_camera, m_options);
  const PyramidLevel &now = current[level];
  m_evidence.predict(m_views[1].vMc.inverse() * m_views[0].vMc);
  for (std::size_t apart = 1; apart < m_views.size(); ++apart) {
    const Pose oMc = m_views[apart].vMc.inverse() * m_views[0].vMc;
    if (medianParallax(m_camera, oMc, m_options.near_range) < kEnoughParallax_px && apart + 1 < m_views.size())
      continue;
    const MotionNoise noise{meanDeviation(result.covariance) * std::sqrt(static_cast<double>(apart)),
                            kTranslationNoiseScale * meanDeviation(m_translation->covariance)};
    m_evidence.add(m_views[apart].pyramid[level], now, oMc, noise);
    break;
  }
  return {m_evidence.logOddsNear(), level, InverseDepthEvidence::kRowStep, m_evidence.priorLogOdds()};
}

SaliencyEstimator::CoarseLabels SaliencyEstimator::labelByMotion(const RotationEm &rotation) const
{
  const float prior_log_odds = static_cast<float>(std::log((1 - kBackgroundPrior) / kBackgroundPrior));
  vpImage<float> log_odds = windowMean(rotation.log_ratio);
  for (unsigned p = 0; p < log_odds.getSize(); ++p)
    log_odds.bitmap[p] = prior_log_odds - log_odds.bitmap[p];
  return {std::move(log_odds), workingLevel(m_camera, m_options), 1, prior_log_odds};
}

/// The labels at full size.
void SaliencyEstimator::fill(const CoarseLabels &labels, Saliency &result) const
{
  const vpImage<float> &log_odds = labels.log_odds;
  const unsigned height = static_cast<unsigned>(m_camera.height), width = static_cast<unsigned>(m_camera.width);
  result.p_background.resize(height, width);
  result.confidence.resize(height, width);
  const float scale = std::ldexp(1.f, -labels.level);
  const ColumnsBetween columns = between(m_camera.width, static_cast<int>(log_odds.getWidth()), scale, 1);
  const ColumnsBetween rows = between(m_camera.height, static_cast<int>(log_odds.getHeight()), scale, labels.row_step);
  for (unsigned i = 0; i < height; ++i) {
    const int above = rows.left[i];
    labelsOfRow(log_odds[above], log_odds[above + 1], rows.share[i], columns, labels.prior, result.p_background[i],
                result.confidence[i]);
  }
}
} // namespace bole
