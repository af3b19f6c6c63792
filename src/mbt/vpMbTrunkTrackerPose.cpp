// SPDX-License-Identifier: GPL-2.0-or-later
// The estimation of vpMbTrunkTracker: predict, scan, choose, judge; the servoing is in vpMbTrunkTrackerServo.cpp.
#include "mbt/camera_twist.h"
#include "tracking/borders.h"

#include <bole/vpMbTrunkTracker.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>

using bole::Border;
using bole::inverted;
using bole::kBorders;
using bole::Matrix6d;
using bole::moved;
using bole::Pose;
using bole::twistBetween;
using bole::Vector6d;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Status = vpMbTrunkTracker::Status;

namespace
{
constexpr double kTrustAgain = 0.06; ///< of agreement beyond Options::min_agreement

/// Cost of following a peak, half a squared deviation: how its contrast differs from what is expected, how far it is.
double peakCost(const bole::ContrastPeak &peak, double expected_offset, double sigma_px, double reference, bool signs)
{
  const double away = (peak.offset_px - expected_offset) / sigma_px;
  double strength = std::log(std::abs(peak.contrast) / std::abs(reference));
  if (!signs)
    strength = std::min(strength, 0.0);
  const double turned = signs && peak.contrast * reference < 0 ? 3 : 0;
  return 0.5 * away * away + 0.5 * strength * strength / (0.6 * 0.6) + turned;
}
} // namespace

/// Mean direction of the trunks, object frame: what they say nothing about moving along.
Vector3d vpMbTrunkTracker::alongTrunks() const
{
  Vector3d sum = Vector3d::Zero();
  for (const vpMbtDistanceTrunk &trunk : m_trunks) {
    const Vector3d axis = trunk.object().axis();
    sum += sum.dot(axis) < 0 ? Vector3d(-axis) : axis;
  }
  return sum.normalized();
}

vpMbTrunkTracker::Prediction vpMbTrunkTracker::predictAlone()
{
  const int frames = m_frames_since_good + 1;
  const int width = int(m_reference_image.getWidth()), height = int(m_reference_image.getHeight());
  if (m_reference.empty())
    m_reference = bole::RotationAligner::reduce(m_reference_image);
  const bole::RotationAlignment turn =
      m_aligner.align(m_reference, m_thumbnails, bole::PinholeCamera::fromVisp(m_cam, width, height));
  const auto expected =
      m_motion.predict(frames, turn.ok ? turn.c2Rc1 : Matrix3d::Identity(),
                       turn.ok ? m_options.turn_sigma_rad : 0.05 * std::sqrt(double(frames)), alongTrunks());
  return {moved(m_cMo, estimated(twistBetween(m_cMo, expected.cMo.toVisp()))), expected.covariance};
}

/// Before the image \p I is looked at for trunks; null: an image that is not to be believed.
vpMbTrunkTracker::Prediction vpMbTrunkTracker::predict(const vpImage<unsigned char> *I)
{
  m_thumbnails = {};
  if (m_prior)
    return {moved(m_cMo, estimated(twistBetween(m_cMo, m_prior->cMo))), m_prior->covariance};
  if (I)
    m_thumbnails = bole::RotationAligner::reduce(*I);
  return predictAlone();
}

void vpMbTrunkTracker::predictTrunks(const vpImage<unsigned char> &I)
{
  m_in_view.clear();
  const bool far = (clippingFlag & vpPolygon3D::FAR_CLIPPING) != 0;
  for (std::size_t k = 0; k < m_trunks.size(); ++k) {
    vpMbtDistanceTrunk &trunk = m_trunks[k];
    trunk.predict(m_cMo, I.getWidth(), I.getHeight());
    if (trunk.isVisible() && far && trunk.inCamera().radius / trunk.relative().ratio() > distFarClip)
      trunk.border(Border::left).visible = trunk.border(Border::right).visible = false;
    if (trunk.isVisible() && trunk.isTracked())
      m_in_view.push_back(k);
  }
  std::sort(m_in_view.begin(), m_in_view.end(), [&](std::size_t a, std::size_t b) {
    return m_trunks[a].relative().ratio() / m_trunks[a].inCamera().radius >
           m_trunks[b].relative().ratio() / m_trunks[b].inCamera().radius;
  });
  for (std::size_t i = 0; i < m_in_view.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      m_trunks[m_in_view[i]].hideBehind(m_trunks[m_in_view[j]]);
  const auto gone = [&](std::size_t k) { return !m_trunks[k].isVisible(); };
  m_in_view.erase(std::remove_if(m_in_view.begin(), m_in_view.end(), gone), m_in_view.end());
}

/// How far [px] a twist of the camera moves a border sideways at its middle.
Eigen::Matrix<double, 1, 6> vpMbTrunkTracker::rowAtMiddle(const vpMbtDistanceTrunk &trunk, Border side) const
{
  const Eigen::Vector2d middle = trunk.border(side).line.at(0.5);
  Eigen::Matrix<double, 1, 6> row;
  vpMbtDistanceTrunk::residual(
      trunk.inCamera(), side,
      {(middle.x() - m_cam.get_u0()) / m_cam.get_px(), (middle.y() - m_cam.get_v0()) / m_cam.get_py(), 1}, &row);
  return -focal() * row;
}

double vpMbTrunkTracker::expectedSigma(const vpMbtDistanceTrunk &trunk, Border side, const Matrix6d &covariance) const
{
  const Eigen::Matrix<double, 1, 6> row = rowAtMiddle(trunk, side);
  return std::sqrt((row * covariance * row.transpose())(0) + m_options.border_sigma_px * m_options.border_sigma_px);
}

void vpMbTrunkTracker::scanTrunks(const vpImage<unsigned char> &I, const Matrix6d &covariance, double max_half_px)
{
  for (std::size_t k : m_in_view) {
    vpMbtDistanceTrunk &trunk = m_trunks[k];
    double sigma = 0;
    for (Border side : kBorders)
      if (trunk.border(side).visible)
        sigma = std::max(sigma, expectedSigma(trunk, side, covariance));
    trunk.scan(I, int(std::ceil(std::min(std::max(3 * sigma, m_options.scan_min_px), max_half_px))));
  }
}

std::vector<float> vpMbTrunkTracker::response(const vpMbtDistanceTrunk::BorderState &state)
{
  const std::vector<float> &g = state.contrast;
  float reference = float(state.remembered_contrast);
  const bool known = state.remembered_frames >= 2;
  if (!known)
    for (float v : g)
      reference = std::max(reference, std::abs(v));
  std::vector<float> sharp(g.size(), 0.f), wide(g.size(), 0.f);
  for (std::size_t k = 0; k < g.size(); ++k) {
    const float share = reference != 0 ? g[k] / reference : 0;
    sharp[k] = std::min(known ? std::max(share, 0.f) : std::abs(share), 1.f);
    if (!state.remembered_profile.empty()) {
      const float alike = std::max(0.f, float(state.likeness(int(k) - int(g.size()) / 2)));
      sharp[k] = std::min(1.5f * sharp[k], 1.f) * alike * alike;
    }
  }
  for (std::size_t k = 1; k + 1 < g.size(); ++k)
    wide[k] = std::max({sharp[k], 0.9f * sharp[k - 1], 0.9f * sharp[k + 1]});
  return wide;
}

Vector6d vpMbTrunkTracker::agree(const Matrix6d &covariance)
{
  std::vector<bole::BallotBorder> borders;
  for (std::size_t k : m_in_view)
    for (Border side : kBorders) {
      const auto &state = m_trunks[k].border(side);
      if (!state.visible)
        continue;
      borders.push_back({rowAtMiddle(m_trunks[k], side), response(state)});
    }
  m_vote = bole::vote(borders, covariance, m_options.vote);
  return estimated(m_vote.twist);
}

void vpMbTrunkTracker::choosePeaks(const Vector6d &twist, double sigma_px, double reach_px)
{
  for (std::size_t k : m_in_view)
    for (Border side : kBorders) {
      const auto &state = m_trunks[k].border(side);
      if (!state.visible)
        continue;
      const double expected = (rowAtMiddle(m_trunks[k], side) * twist)(0);
      const bool signs = state.remembered_frames >= 2;
      double reference = state.remembered_contrast;
      if (!signs)
        for (const auto &peak : state.peaks)
          if (std::abs(peak.contrast) > std::abs(reference))
            reference = peak.contrast;
      int best = -1;
      double least = 4.5; // three standard deviations
      for (int p = 0; p < int(state.peaks.size()); ++p) {
        const bole::ContrastPeak &peak = state.peaks[std::size_t(p)];
        double cost = peakCost(peak, expected, sigma_px, reference, signs);
        if (!state.remembered_profile.empty())
          cost += 2 * (1 - std::max(0.0, state.likeness(int(std::lround(peak.offset_px)))));
        if (cost < least)
          least = cost, best = p;
      }
      m_trunks[k].choose(side, best, reach_px);
    }
}

Status vpMbTrunkTracker::estimate(const vpImage<unsigned char> &I, const Prediction &prediction)
{
  m_cMo = prediction.cMo;
  predictTrunks(I);
  if (m_in_view.empty()) {
    computeVVSInit();
    return Status::no_trunk;
  }
  scanTrunks(I, prediction.covariance, m_options.scan_max_px);
  const Vector6d twist = agree(prediction.covariance);
  choosePeaks(twist, m_options.border_sigma_px, 4);
  m_cMo = moved(m_cMo, twist);
  servo(prediction);
  for (int k = 0; k < m_options.refinements; ++k) {
    Matrix6d H;
    Vector6d b;
    normalEquations(H, b);
    predictTrunks(I);
    const Matrix6d narrowed = inverted(inverted(prediction.covariance) + H);
    scanTrunks(I, narrowed, m_options.refine_px);
    choosePeaks(Vector6d::Zero(), m_options.border_sigma_px, 3);
    servo(prediction);
  }
  const double agreeing = support();
  judge(0.5 * (m_vote.score + agreeing));
  const Vector6d jump = twistBetween(prediction.cMo, m_cMo);
  const bool has_jumped = !m_prior && jump.dot(prediction.covariance.ldlt().solve(jump)) > m_options.max_jump;
  return has_jumped || agreeing < m_options.min_support ? Status::lost : Status::tracked;
}

/// Whether the borders agree as well as they do where a tracker is right: over the last few frames, and once
/// they did not, clearly better before they are trusted again.
void vpMbTrunkTracker::judge(double agreement)
{
  m_agreement += 0.25 * (agreement - m_agreement);
  m_is_doubtful = m_agreement < m_options.min_agreement + (m_is_doubtful ? kTrustAgain : 0);
}

/// The signed contrast of each border at a pose that the caller vouches for: what the first frame is expected to show.
void vpMbTrunkTracker::learn(const vpImage<unsigned char> &I)
{
  predictTrunks(I);
  for (const std::size_t k : m_in_view) {
    m_trunks[k].scan(I, int(m_options.scan_min_px));
    for (const Border side : kBorders) {
      const auto &peaks = m_trunks[k].border(side).peaks;
      int best = -1;
      double strongest = 0;
      for (int p = 0; p < int(peaks.size()); ++p) {
        const double strength =
            std::abs(peaks[std::size_t(p)].contrast) * (1 - 0.15 * std::abs(peaks[std::size_t(p)].offset_px));
        if (strength > strongest)
          strongest = strength, best = p;
      }
      m_trunks[k].choose(side, best, 3);
    }
    m_trunks[k].remember(m_options.memory_rate);
    m_trunks[k].remember(m_options.memory_rate); // known for good: signs are believed from two frames on
  }
  m_in_view.clear();
}
