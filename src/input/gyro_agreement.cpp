// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/gyro_agreement.h"
#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <vector>

namespace bole
{
namespace
{
constexpr std::size_t kWindow = 10;    // intervals: a second at 10 Hz
constexpr int kLags = 6;               // intervals
constexpr std::size_t kBelieved = 8;   // of them; the others are wrong matches of the images
constexpr double kFloor_rad = 3e-4;    // the shifts are no better
constexpr double kEnough_rad = 4e-3;   // rms of the gyro's shifts in a window that can tell anything
constexpr double kFactor = 4;          // between the sums; clean flights stay below 2.4
constexpr double kFits = 0.3;          // of the variance of the gyro's shifts: what another hypothesis may leave
constexpr double kFactorToClear = 1.5; // a verdict is taken back only when the images agree again
constexpr int kConfirm = 3;            // intervals that must say the same of the window
constexpr double kJump_rad = 0.02;     // more than the parallax of a flight among trees changes between two frames
constexpr double kJumpInSpreads = 5.5;
constexpr double kLargestSpread_rad = 6e-3; // the images agreed with the gyro so far
constexpr double kLeastSpread_rad = 1.5e-3; // they never agree better for long
constexpr double kFollowsInSpreads = 3;     // clean flights stay below 3.5 from frame to frame
constexpr std::size_t kAgreedMost = 10;     // intervals that tell what is usual
constexpr std::size_t kAgreedLeast = 6;
constexpr int kShortest = 4;            // intervals that may tell another hypothesis
constexpr double kClip = 6;             // spreads: an interval farther off is a wrong match of the images
constexpr double kLogRatio = 30;        // of the likelihoods: a dozen hypotheses are tried ten times a second
constexpr double kLogRatioToClear = -8; // a verdict stands until the images agree again
constexpr double kFitsInSpreads = 2;    // rms of the intervals by the hypothesis that is believed
} // namespace

void GyroAgreement::reset()
{
  m_intervals.clear();
  m_is_late = false;
  m_held = Verdict::agrees;
  m_same = 0;
}

const std::vector<GyroAgreement::Hypothesis> &GyroAgreement::hypotheses()
{
  static const std::vector<Hypothesis> kAll = [] {
    std::vector<Hypothesis> all = {{Verdict::mirrored, 0, -1, 1}, {Verdict::upside_down, 0, -1, -1}};
    for (int lag = -kLags; lag <= kLags; ++lag)
      if (lag != 0)
        all.push_back({Verdict::late, lag, 1, 1});
    return all;
  }();
  return kAll;
}

/// Mean squared difference over the window at the end of the intervals.
double GyroAgreement::cost(int lag, double sign_x, double sign_y, bool is_odometry) const
{
  const auto size = static_cast<int>(m_intervals.size());
  const int back_image = std::max(0, -lag), back_gyro = std::max(0, lag);
  std::vector<Eigen::Vector2d> differences;
  for (int k = size - static_cast<int>(kWindow); k < size; ++k) {
    const Interval &seen = m_intervals[static_cast<std::size_t>(k - back_image)];
    const Interval &felt = m_intervals[static_cast<std::size_t>(k - back_gyro)];
    if (is_odometry && !felt.odometry)
      return -1;
    const Eigen::Vector2d expected = is_odometry ? *felt.odometry : felt.gyro;
    differences.emplace_back(seen.image - Eigen::Vector2d(sign_x * expected.x(), sign_y * expected.y()));
  }
  const Eigen::Vector2d centre = medianByAxis(differences);
  std::vector<double> squares;
  for (const Eigen::Vector2d &difference : differences)
    squares.push_back((difference - centre).squaredNorm());
  std::sort(squares.begin(), squares.end());
  double sum = 0;
  for (std::size_t k = 0; k < kBelieved; ++k)
    sum += squares[k];
  return sum / static_cast<double>(kBelieved) + kFloor_rad * kFloor_rad;
}

/// Variance of the gyro's shifts in the window [rad^2].
double GyroAgreement::variance() const
{
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();
  double squares = 0;
  const std::size_t count = std::min(m_intervals.size(), kWindow);
  for (std::size_t k = m_intervals.size() - count; k < m_intervals.size(); ++k) {
    mean += m_intervals[k].gyro / static_cast<double>(count);
    squares += m_intervals[k].gyro.squaredNorm() / static_cast<double>(count);
  }
  return squares - mean.squaredNorm();
}

std::optional<GyroAgreement::Usual> GyroAgreement::usual() const
{
  if (m_agreed.size() < kAgreedLeast)
    return std::nullopt;
  Usual usual;
  usual.centre = medianByAxis({m_agreed.begin(), m_agreed.end()});
  std::vector<double> squares;
  for (const Eigen::Vector2d &difference : m_agreed)
    squares.push_back((difference - usual.centre).squaredNorm());
  usual.variance = std::max(medianOf(std::move(squares)), kLeastSpread_rad * kLeastSpread_rad);
  return usual;
}

Eigen::Vector2d GyroAgreement::usualOffset() const
{
  const std::optional<Usual> known = usual();
  return known ? known->centre : Eigen::Vector2d::Zero();
}

bool GyroAgreement::follows(const Eigen::Vector2d &image, const Eigen::Vector2d &gyro, int frames) const
{
  const std::optional<Usual> known = usual();
  if (!known)
    return false;
  const double off = (image - gyro - frames * known->centre).norm();
  return off < kFollowsInSpreads * std::sqrt(frames * known->variance);
}

/// The last interval against what is usual.
bool GyroAgreement::hasJumped() const
{
  const std::optional<Usual> known = usual();
  const Interval &last = m_intervals.back();
  if (!known || !last.is_sure || m_intervals.size() < kAgreedLeast || variance() < kEnough_rad * kEnough_rad)
    return false;
  const double off = (last.image - last.gyro - known->centre).norm(), spread = std::sqrt(known->variance);
  return spread < kLargestSpread_rad && off > kJump_rad && off > kJumpInSpreads * spread;
}

/// Squared differences of the last \p count intervals by \p hypothesis, each clipped; negative where one is not known.
double GyroAgreement::clippedSum(const Hypothesis &hypothesis, const Usual &usual, int count, bool is_odometry) const
{
  const auto size = static_cast<int>(m_intervals.size());
  const int back_image = std::max(0, -hypothesis.lag), back_gyro = std::max(0, hypothesis.lag);
  double sum = 0;
  for (int k = size - count; k < size; ++k) {
    if (k - std::max(back_image, back_gyro) < 0)
      return -1;
    const Interval &felt = m_intervals[static_cast<std::size_t>(k - back_gyro)];
    if ((is_odometry && !felt.odometry) || !m_intervals[static_cast<std::size_t>(k - back_image)].is_seen)
      return -1;
    const Eigen::Vector2d turned = (is_odometry ? *felt.odometry : felt.gyro) + usual.centre;
    const Eigen::Vector2d &seen = m_intervals[static_cast<std::size_t>(k - back_image)].image;
    sum += std::min((seen - Eigen::Vector2d(hypothesis.x * turned.x(), hypothesis.y * turned.y())).squaredNorm(),
                    kClip * kClip * usual.variance);
  }
  return sum;
}

/// By as many of the last intervals as tell most, where it is known how well the images agree with the gyro.
GyroAgreement::Verdict GyroAgreement::judgeSuffix()
{
  const std::optional<Usual> known = usual();
  if (!known || std::sqrt(known->variance) > kLargestSpread_rad)
    return Verdict::agrees;
  if (variance() < kEnough_rad * kEnough_rad)
    return m_held;
  const bool is_held = m_held != Verdict::agrees; // a verdict stands until the images agree again
  double most = is_held ? kLogRatioToClear : kLogRatio;
  Verdict verdict = Verdict::agrees;
  for (int count = kShortest; count <= (is_held ? kShortest : static_cast<int>(kWindow)); ++count)
    for (const Hypothesis &other : hypotheses()) {
      if (is_held && (other.verdict != m_held || std::abs(other.lag - m_lag) > 1))
        continue;
      const double as_it_is = clippedSum({}, *known, count, false), sum = clippedSum(other, *known, count, false);
      const double largest = count * kFitsInSpreads * kFitsInSpreads * known->variance;
      if (as_it_is < 0 || sum < 0 || (!is_held && sum > largest))
        continue;
      const double by_odometry = clippedSum({}, *known, count, true);
      const bool odometry_agrees =
          by_odometry >= 0 && by_odometry < kFactorToClear * clippedSum(other, *known, count, true);
      if (const double ratio = 0.5 * (as_it_is - sum) / known->variance; ratio > most && !odometry_agrees) {
        most = ratio;
        verdict = other.verdict;
        m_lag = other.lag;
      }
    }
  return verdict;
}

GyroAgreement::Verdict GyroAgreement::judgeWindow()
{
  const bool is_seen = std::all_of(m_intervals.begin(), m_intervals.end(), [](const Interval &i) { return i.is_seen; });
  if (!is_seen || m_intervals.size() < kWindow + kLags)
    return Verdict::agrees;
  if (variance() < kEnough_rad * kEnough_rad)
    return m_is_late ? Verdict::late : Verdict::agrees;

  const double as_it_is = cost(0, 1, 1, false);
  double best = std::numeric_limits<double>::max();
  const Hypothesis *winner = nullptr;
  for (const Hypothesis &other : hypotheses())
    if (const double value = cost(other.lag, other.x, other.y, false); value < best) {
      best = value;
      winner = &other;
    }
  const double by_odometry = cost(0, 1, 1, true);
  const bool odometry_agrees =
      by_odometry >= 0 && by_odometry < kFactorToClear * cost(winner->lag, winner->x, winner->y, true);
  const double factor = m_is_late && winner->verdict == Verdict::late ? kFactorToClear : kFactor;
  const bool is_believed = as_it_is > factor * best && best < kFits * variance() && !odometry_agrees;
  m_is_late = is_believed && winner->verdict == Verdict::late;
  m_lag = winner->lag;
  return is_believed ? winner->verdict : Verdict::agrees;
}

GyroAgreement::Verdict GyroAgreement::add(const Interval &interval, bool is_usual)
{
  m_intervals.push_back(interval);
  if (m_intervals.size() > kWindow + kLags)
    m_intervals.pop_front();
  const bool was_held = m_held != Verdict::agrees;
  m_held = judgeSuffix();
  if (m_held != Verdict::agrees)
    return m_held;
  if (was_held) { // what the window holds is of the time before
    reset();
    return Verdict::agrees;
  }
  const Verdict verdict = judgeWindow();
  const bool is_same = verdict == m_suspected && (verdict != Verdict::late || std::abs(m_lag - m_suspected_lag) <= 1);
  m_same = is_same ? m_same + 1 : 1;
  m_suspected = verdict;
  m_suspected_lag = m_lag;
  if (verdict != Verdict::agrees && m_same >= kConfirm)
    return verdict;
  if (!is_usual || !interval.is_seen)
    return Verdict::agrees;
  if (hasJumped())
    return Verdict::jumped;
  m_agreed.push_back(interval.image - interval.gyro);
  if (m_agreed.size() > kAgreedMost)
    m_agreed.pop_front();
  return Verdict::agrees;
}
} // namespace bole
