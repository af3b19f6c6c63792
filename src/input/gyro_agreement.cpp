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
constexpr double kJump_rad = 0.03;     // more than the parallax of a flight among trees changes between two frames
constexpr double kJumpInSpreads = 8;
constexpr double kLargestSpread_rad = 6e-3; // the images agreed with the gyro so far

Eigen::Vector2d median(const std::vector<Eigen::Vector2d> &values)
{
  std::vector<double> x, y;
  for (const Eigen::Vector2d &value : values) {
    x.push_back(value.x());
    y.push_back(value.y());
  }
  return {medianOf(std::move(x)), medianOf(std::move(y))};
}
} // namespace

void GyroAgreement::reset()
{
  m_intervals.clear();
  m_is_late = false;
  m_same = 0;
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
  const Eigen::Vector2d centre = median(differences);
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

/// The last interval against those before it.
bool GyroAgreement::hasJumped() const
{
  constexpr std::size_t kLeast = 6;
  if (m_intervals.size() < kLeast + 1 || variance() < kEnough_rad * kEnough_rad)
    return false;
  std::vector<Eigen::Vector2d> before;
  const std::size_t first = m_intervals.size() - 1 - std::min(m_intervals.size() - 1, kWindow);
  for (std::size_t k = first; k + 1 < m_intervals.size(); ++k)
    before.push_back(m_intervals[k].image - m_intervals[k].gyro);
  const Eigen::Vector2d centre = median(before);
  std::vector<double> spread;
  for (const Eigen::Vector2d &difference : before)
    spread.push_back((difference - centre).norm());
  const double off = (m_intervals.back().image - m_intervals.back().gyro - centre).norm();
  const double usual = medianOf(std::move(spread));
  return m_intervals.back().is_sure && usual < kLargestSpread_rad && off > kJump_rad && off > kJumpInSpreads * usual;
}

GyroAgreement::Verdict GyroAgreement::judgeWindow()
{
  if (m_intervals.size() < kWindow + kLags)
    return Verdict::agrees;
  if (variance() < kEnough_rad * kEnough_rad)
    return m_is_late ? Verdict::late : Verdict::agrees;

  struct Hypothesis
  {
    Verdict verdict;
    int lag;
    double x, y;
  };
  std::vector<Hypothesis> others = {{Verdict::mirrored, 0, -1, 1}, {Verdict::upside_down, 0, -1, -1}};
  for (int lag = -kLags; lag <= kLags; ++lag)
    if (lag != 0)
      others.push_back({Verdict::late, lag, 1, 1});
  const double as_it_is = cost(0, 1, 1, false);
  double best = std::numeric_limits<double>::max();
  const Hypothesis *winner = nullptr;
  for (const Hypothesis &other : others)
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

GyroAgreement::Verdict GyroAgreement::add(const Interval &interval)
{
  m_intervals.push_back(interval);
  if (m_intervals.size() > kWindow + kLags)
    m_intervals.pop_front();
  const Verdict verdict = judgeWindow();
  const bool is_same = verdict == m_suspected && (verdict != Verdict::late || std::abs(m_lag - m_suspected_lag) <= 1);
  m_same = is_same ? m_same + 1 : 1;
  m_suspected = verdict;
  m_suspected_lag = m_lag;
  if (verdict != Verdict::agrees && m_same >= kConfirm)
    return verdict;
  return hasJumped() ? Verdict::jumped : Verdict::agrees;
}
} // namespace bole
