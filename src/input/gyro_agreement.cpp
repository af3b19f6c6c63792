// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/gyro_agreement.h"
#include "geometry/median.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

namespace bole
{
namespace
{
constexpr std::size_t kWindow = 10;  // intervals: a second at 10 Hz
constexpr int kLags = 6;             // intervals
constexpr double kEnough_rad = 4e-3; // rms of the gyro's shifts in a window that can tell anything
constexpr double kJump_rad = 0.02;   // more than the parallax of a flight among trees changes between two frames
constexpr double kJumpInSpreads = 5.5;
constexpr double kLargestSpread_rad = 6e-3; // beyond, the flight has not shown that its images agree with the gyro
constexpr double kLeastSpread_rad = 1.5e-3; // they never agree better for long
constexpr double kFollowsInSpreads = 3;     // clean flights stay below 3.5 from frame to frame
constexpr std::size_t kAgreedMost = 12;     // intervals that tell what is usual; five of a fault, not told yet, do not
constexpr std::size_t kAgreedLeast = 6;
constexpr int kShortest = 4, kUntold = 8; // intervals that may tell another hypothesis, and where nothing is usual
constexpr double kClip = 6;               // spreads: an interval farther off is a wrong match of the images
constexpr double kLogRatio = 30;          // of the likelihoods: a dozen hypotheses are tried ten times a second
constexpr double kLogRatioToClear = -8;   // a verdict stands until the images agree again
constexpr double kFitsInSpreads = 2;      // rms of the intervals by the hypothesis that is believed
constexpr double kOdometryAsWellAs = 1.5; // squared differences with the odometry that do not tell two apart
} // namespace

void GyroAgreement::reset()
{
  m_intervals.clear();
  m_held = Verdict::agrees;
}

const std::vector<GyroAgreement::Hypothesis> &GyroAgreement::hypotheses()
{
  static const std::vector<Hypothesis> kAll = [] {
    std::vector<Hypothesis> all = {{}, {Verdict::mirrored, 0, -1, 1}, {Verdict::upside_down, 0, -1, -1}};
    for (int lag = -kLags; lag <= kLags; ++lag)
      if (lag != 0)
        all.push_back({Verdict::late, lag, 1, 1});
    return all;
  }();
  return kAll;
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

GyroAgreement::Usual GyroAgreement::usualOf(const std::vector<Eigen::Vector2d> &differences)
{
  Usual usual;
  usual.centre = medianByAxis(differences);
  std::vector<double> squares;
  for (const Eigen::Vector2d &difference : differences)
    squares.push_back((difference - usual.centre).squaredNorm());
  usual.variance = std::max(medianOf(std::move(squares)), kLeastSpread_rad * kLeastSpread_rad);
  return usual;
}

/// What the flight has shown, where it has shown that its images agree with the gyro.
std::optional<GyroAgreement::Usual> GyroAgreement::usual() const
{
  if (m_agreed.size() < kAgreedLeast)
    return std::nullopt;
  Usual usual = usualOf({m_agreed.begin(), m_agreed.end()});
  usual.is_of_flight = true;
  return std::sqrt(usual.variance) <= kLargestSpread_rad ? std::optional(usual) : std::nullopt;
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
  return off > kJump_rad && off > kJumpInSpreads * spread;
}

/// Differences by \p hypothesis over \p count intervals of the images that end \p back before the last; none where one
/// of them is not known.
std::vector<Eigen::Vector2d> GyroAgreement::differences(const Hypothesis &hypothesis, int count, int back,
                                                        bool is_odometry) const
{
  const auto size = static_cast<int>(m_intervals.size());
  std::vector<Eigen::Vector2d> out;
  for (int k = size - back - count; k < size - back; ++k) {
    if (k < 0 || k - hypothesis.lag < 0)
      return {};
    const Interval &seen = m_intervals[static_cast<std::size_t>(k)];
    const Interval &felt = m_intervals[static_cast<std::size_t>(k - hypothesis.lag)];
    if ((is_odometry && !felt.odometry) || !seen.is_seen)
      return {};
    const Eigen::Vector2d turned = is_odometry ? *felt.odometry : felt.gyro;
    out.emplace_back(seen.image - Eigen::Vector2d(hypothesis.x * turned.x(), hypothesis.y * turned.y()));
  }
  return out;
}

/// Their squares over the variance that is \p usual, each clipped; negative where one is not known. What the
/// translation adds is the centre of the flight, else their median.
double GyroAgreement::misfit(const Hypothesis &hypothesis, const Usual &usual, int count, int back,
                             bool is_odometry) const
{
  const std::vector<Eigen::Vector2d> off = differences(hypothesis, count, back, is_odometry);
  const Eigen::Vector2d of_flight(hypothesis.x * usual.centre.x(), hypothesis.y * usual.centre.y());
  const Eigen::Vector2d centre = usual.is_of_flight ? of_flight : medianByAxis(off);
  double sum = off.empty() ? -1 : 0;
  for (const Eigen::Vector2d &difference : off)
    sum += std::min((difference - centre).squaredNorm() / usual.variance, kClip * kClip);
  return sum;
}

/// By as many of the last intervals as tell most. Where the flight has not shown how well its images agree with the
/// gyro, they are taken to do so as well as by the hypothesis that fits best.
GyroAgreement::Verdict GyroAgreement::judge()
{
  if (variance() < kEnough_rad * kEnough_rad)
    return m_held;
  constexpr int kAll = static_cast<int>(kWindow);
  const bool is_held = m_held != Verdict::agrees; // a verdict stands until the images agree again
  std::optional<Usual> scale = usual();
  const int least = scale || is_held ? kShortest : kUntold;
  if (!scale)
    for (const Hypothesis &hypothesis : hypotheses())
      if (const auto off = differences(hypothesis, kUntold, std::max(0, -hypothesis.lag), false); !off.empty())
        if (const Usual fitted = usualOf(off); !scale || fitted.variance < scale->variance)
          scale = fitted;
  if (!scale)
    return Verdict::agrees;
  double most = is_held ? kLogRatioToClear : kLogRatio;
  Verdict verdict = Verdict::agrees;
  for (int count = least; count <= kAll; ++count)
    for (const Hypothesis &other : hypotheses()) {
      if (is_held && (other.verdict != m_held || std::abs(other.lag - m_lag) > 1))
        continue;
      const int back = std::max(0, -other.lag); // what images will be early by is not felt yet
      const auto misfitOf = [&](const Hypothesis &hypothesis, bool is_odometry) {
        return misfit(hypothesis, *scale, count, back, is_odometry);
      };
      const double as_it_is = misfitOf({}, false), sum = misfitOf(other, false), ratio = 0.5 * (as_it_is - sum);
      if (as_it_is < 0 || sum < 0 || ratio <= most || (!is_held && sum > count * kFitsInSpreads * kFitsInSpreads))
        continue;
      const double by_odometry = misfitOf({}, true);
      if (by_odometry >= 0 && by_odometry < kOdometryAsWellAs * misfitOf(other, true))
        continue;
      most = ratio;
      verdict = other.verdict;
      m_lag = other.lag;
    }
  return verdict;
}

GyroAgreement::Verdict GyroAgreement::add(const Interval &interval, bool is_usual)
{
  m_intervals.push_back(interval);
  if (m_intervals.size() > kWindow + kLags)
    m_intervals.pop_front();
  const bool was_held = m_held != Verdict::agrees;
  m_held = judge();
  if (m_held != Verdict::agrees)
    return m_held;
  if (was_held) { // what the window holds is of the time before
    reset();
    return Verdict::agrees;
  }
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
