// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/sensor_monitor.h"

#include "geometry/constants.h"
#include "geometry/median.h"
#include "motion/accelerometer.h"
#include "motion/calibration_fit.h"
#include "motion/camera_gyro.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;

namespace
{
constexpr double kMemory_s = 4;
constexpr double kAgreed_s = 3;                   // after which a gyro that contradicted the points is trusted again
constexpr std::size_t kWindow = 6, kOfWindow = 4; // comparisons that are remembered, and those that make an alarm
constexpr double kLimitPoints = 25;   // of a squared difference with the points, 3 degrees of freedom; measured on 15
                                      // flights: at most 10 without a fault, 20 to 2000 with one
constexpr double kLimitOdometry = 30; // of one with the odometry; at most 17 without a fault
constexpr double kLimitOdds = 3;      // of the log-likelihood ratio that the points err and not the gyro: 20 to 1
constexpr double kBiasSigma = 0.008;  // that a gyro may have [rad/s]
constexpr double kStuck_s = 0.5;      // with one value

double squared(const Matrix3d &aRb, const Matrix3d &aRb_other, const Matrix3d &covariance)
{
  const Vector3d error = logSo3(orthonormalized(aRb.transpose() * aRb_other));
  return error.dot(covariance.ldlt().solve(error));
}
/// \p frame without its rejected sensors: itself, or a copy in \p scratch.
const Frame &withSensors(const Frame &frame, bool gyro, bool odometry, bool force, Frame &scratch)
{
  if (gyro && odometry && force)
    return frame;
  scratch = frame;
  if (!gyro)
    scratch.gyro.clear();
  if (!odometry)
    scratch.wMb_odometry.reset();
  if (!force)
    for (GyroSample &sample : scratch.gyro)
      sample.force.reset();
  return scratch;
}
} // namespace

const char *toString(Sensor sensor)
{
  constexpr const char *kNames[] = {"gyro", "odometry", "images", "accelerometer"};
  return kNames[static_cast<int>(sensor)];
}

void SensorMonitor::process(const Frame &frame, const std::vector<RelativeMotion> &motions)
{
  for (State &state : m_states)
    state.is_wrong_now = false;
  const Turns turns = turnsTo(frame);
  if (const auto wrong = implausibleSensor(turns))
    of(*wrong).is_wrong_now = true;
  collect(frame);
  checkGyroSamples(frame);
  checkSteps(frame, motions);
  for (const RelativeMotion &motion : motions)
    if (motion.points.hasRotation())
      compare(frame, motion);
  rejectOutvoted(frame);
  checkRotations();
  checkStamps();
  checkRecovery(Sensor::gyro);
  checkRecovery(Sensor::odometry);
  checkDirection();
  checkGravity();
  if (turns.gyro && trustsNow(Sensor::gyro))
    m_turning = *turns.gyro / turns.dt;
  else if (turns.odometry && trustsNow(Sensor::odometry))
    m_turning = *turns.odometry / turns.dt;
  m_last_ns = frame.stamp_ns;
}

SensorMonitor::Turns SensorMonitor::turnsTo(const Frame &frame) const
{
  Turns turns;
  if (!m_last_ns || frame.stamp_ns <= *m_last_ns)
    return turns;
  turns.dt = secondsOf(frame.stamp_ns - *m_last_ns);
  const GyroRotation turned = integrateGyro(frame.gyro, *m_last_ns, frame.stamp_ns);
  if (turned.complete)
    turns.gyro = logSo3(turned.R);
  if (!m_steps.empty() && frame.wMb_odometry)
    turns.odometry = logSo3(orthonormalized(m_steps.back().wMb.R.transpose() * frame.wMb_odometry->R));
  return turns;
}

/// The sensor whose rotation is implausible. Where gyro and odometry differ so much that one of them would predict all
/// points elsewhere, it is the one farther from how the body turned until then; a gyro alone is implausible where no
/// body begins to turn so fast.
std::optional<Sensor> SensorMonitor::implausibleSensor(const Turns &turns) const
{
  constexpr double kApart = 0.3, kDrift = 0.1; // [rad], forty times what they err by; [rad/s]
  constexpr double kAcceleration = 100;        // [rad/s^2]: of a racing drone
  if (!turns.gyro || !trusts(Sensor::gyro))
    return std::nullopt;
  const Vector3d expected = turns.dt * m_turning;
  const double off = (*turns.gyro - expected).norm();
  if (!turns.odometry || !trusts(Sensor::odometry))
    return off > kApart + 0.5 * kAcceleration * turns.dt * turns.dt ? std::optional(Sensor::gyro) : std::nullopt;
  if (logSo3(expSo3(-*turns.gyro) * expSo3(*turns.odometry)).norm() < kApart + kDrift * turns.dt)
    return std::nullopt;
  return off > (*turns.odometry - expected).norm() ? Sensor::gyro : Sensor::odometry;
}

const Frame &SensorMonitor::withoutRejectedSensors(const Frame &frame, Frame &scratch) const
{
  const std::optional<Sensor> wrong = implausibleSensor(turnsTo(frame));
  return withSensors(frame, trusts(Sensor::gyro) && wrong != Sensor::gyro,
                     trusts(Sensor::odometry) && wrong != Sensor::odometry, trusts(Sensor::accelerometer), scratch);
}

const Frame &SensorMonitor::trusted(const Frame &frame, Frame &scratch) const
{
  return withSensors(frame, trustsNow(Sensor::gyro), trustsNow(Sensor::odometry), trusts(Sensor::accelerometer),
                     scratch);
}

void SensorMonitor::raise(Sensor sensor, const char *kind, double since_s, const std::string &text, Lasts lasts)
{
  State &state = of(sensor);
  if (state.is_distrusted)
    return;
  state.is_distrusted = lasts != Lasts::no;
  if (lasts == Lasts::until_agree)
    state.may_recover = m_verdicts.size();
  m_verdicts.push_back({toString(sensor), kind, since_s, text});
}

/// The verdict on \p sensor ends at \p time_s.
void SensorMonitor::recover(Sensor sensor, double time_s)
{
  State &state = of(sensor);
  state.is_distrusted = false;
  m_verdicts[*state.may_recover].text += fmt::format(" until {:.1f} s", time_s);
  state.may_recover.reset();
}

/// Whether the gyro agreed with the points for three seconds in which the body turned about each axis by more than both
/// err: at rest, or about one axis, swapped and negated rates agree as well.
bool SensorMonitor::hasGyroAgreedInTurns() const
{
  constexpr double kTurned = 100; // squared turns about an axis over their variance
  const std::int64_t from_ns = m_comparisons.back().b_ns - nsOf(kAgreed_s);
  Vector3d turned = Vector3d::Zero();
  for (const Comparison &c : m_comparisons) {
    if (c.b_ns <= from_ns)
      continue;
    if (!c.gyro || c.gyro_points > 0.5 * kLimitPoints)
      return false;
    turned += logSo3(*c.points).cwiseAbs2().cwiseQuotient(c.error_covariance.diagonal());
  }
  return m_comparisons.front().a_ns <= from_ns && turned.minCoeff() > kTurned;
}

/// Ends the verdict on a sensor that was silent or stuck, or on a gyro that contradicted the points for a moment, once
/// it agrees with the points again.
void SensorMonitor::checkRecovery(Sensor sensor)
{
  const std::optional<std::size_t> verdict = of(sensor).may_recover;
  if (!verdict || m_comparisons.size() < kWindow)
    return;
  const std::string &kind = m_verdicts[*verdict].kind;
  if (kind != "ended" && kind != "stuck" && !hasGyroAgreedInTurns())
    return;
  const bool is_gyro = sensor == Sensor::gyro;
  for (auto c = windowBegin(); c != m_comparisons.end(); ++c)
    if (is_gyro ? !c->gyro || c->gyro_points > 0.5 * kLimitPoints
                : !c->odometry || c->odometry_points > 0.5 * kLimitOdometry)
      return;
  const std::int64_t back_ns = windowBegin()->a_ns;
  if (is_gyro && (!m_gyro_changed_ns || secondsOf(m_last_gyro_ns - *m_gyro_changed_ns) > 0.5 * kStuck_s))
    return;
  if (!is_gyro && std::any_of(m_steps.begin(), m_steps.end(),
                              [back_ns](const Step &step) { return step.stamp_ns > back_ns && step.is_held; }))
    return;
  const std::int64_t agreed_ns = m_comparisons.back().b_ns - nsOf(kAgreed_s);
  while (is_gyro && m_comparisons.front().b_ns <= agreed_ns) // what was before is judged
    m_comparisons.pop_front();
  recover(sensor, secondsOf(back_ns));
}

/// Rejects a sensor in this frame that two others contradict.
void SensorMonitor::rejectOutvoted(const Frame &frame)
{
  const bool points_err = logOddsOfPoints() > kLimitOdds;
  for (auto c = m_comparisons.rbegin(); c != m_comparisons.rend() && c->b_ns == frame.stamp_ns; ++c) {
    if (!c->gyro || !c->odometry || !trusts(Sensor::odometry) || c->gyro_points <= kLimitPoints)
      continue;
    if (points_err && c->gyro_odometry < 0.5 * kLimitOdometry)
      of(Sensor::images).is_wrong_now = true;
    else if (c->odometry_points < 0.5 * kLimitOdometry)
      of(Sensor::gyro).is_wrong_now = true;
  }
}

void SensorMonitor::collect(const Frame &frame)
{
  m_samples.insert(m_samples.end(), frame.gyro.begin(), frame.gyro.end());
  const std::int64_t oldest = frame.stamp_ns - nsOf(kMemory_s);
  m_samples.erase(m_samples.begin(),
                  std::find_if(m_samples.begin(), m_samples.end(),
                               [oldest](const GyroSample &sample) { return sample.stamp_ns >= oldest; }));
  while (!m_comparisons.empty() && m_comparisons.front().a_ns < oldest)
    m_comparisons.pop_front();
  while (!m_steps.empty() && m_steps.front().stamp_ns < oldest)
    m_steps.pop_front();
}

/// An image taken tau later than its stamp says turns the points' rotation by rate * tau against the gyro's, at both
/// ends of an interval. Errors tau of each image for itself make the differences larger along the rates alone, by
/// sigma^2 (rate_a rate_a^T + rate_b rate_b^T), and of opposite signs in two intervals that share an image. What a
/// bias, a scale or other axes of the gyro leave lies along other directions, or has one sign. It is the gyro that is
/// left out: it is the only sensor so exact that a wrong time makes it useless.
void SensorMonitor::checkStamps()
{
  constexpr std::size_t kLeast = 10; // comparisons
  constexpr double kMostEach = 6;    // of one comparison: more would be a wrong match
  constexpr double kLimit = 15;      // of the log-likelihood ratio; 42 clean flights stay below 2
  constexpr double kMostTurn = 0.5;  // that an image is late by [rad]: beyond it the rates are wrong
  constexpr double kSigmas_s[] = {0.004, 0.008, 0.016, 0.032};
  if (m_comparisons.size() < kLeast)
    return;
  double best = kLimit, best_sigma_s = 0;
  for (const double sigma_s : kSigmas_s) {
    double ratio = 0, left = 0;
    int count = 0;
    for (const Comparison &c : m_comparisons) {
      if (!c.gyro || c.error.norm() > kMostTurn)
        continue;
      const Matrix3d scattered =
          c.error_covariance + sigma_s * sigma_s * (c.rate_a * c.rate_a.transpose() + c.rate_b * c.rate_b.transpose());
      const double misfit = c.error.dot(scattered.ldlt().solve(c.error));
      ratio += std::min(kMostEach, 0.5 * (c.gyro_points - misfit -
                                          std::log(scattered.determinant() / c.error_covariance.determinant())));
      left += misfit;
      ++count;
    }
    constexpr double kExplained = 3; // mean squared difference of a component that may be left
    if (count >= static_cast<int>(kLeast) && ratio > best && left < kExplained * 3 * count) {
      best = ratio;
      best_sigma_s = sigma_s;
    }
  }
  if (best_sigma_s == 0)
    return;
  double together = 0; // of the errors of two intervals that share an image, along its rate
  for (const Comparison &c : m_comparisons)
    for (const Comparison &next : m_comparisons)
      if (c.gyro && next.gyro && next.a_ns == c.b_ns)
        together += c.error.dot(c.rate_b) * next.error.dot(next.rate_a);
  if (together < 0)
    raise(Sensor::gyro, "stamps", secondsOf(m_comparisons.front().a_ns),
          fmt::format("gyro: the stamps of the images scatter against it, by {:.0f} ms or more", 1e3 * best_sigma_s),
          Lasts::until_agree);
}

/// Checks for a gyro that lost samples in a third of the last second: their spacing is then no longer the usual one.
/// How much of the rotation that leaves open is part of its covariance (see integrateGyro()), so that it stays in use.
void SensorMonitor::checkLostSamples(std::int64_t now_ns)
{
  constexpr std::size_t kLeast = 12; // spacings
  constexpr double kUsual = 2;       // times the median
  constexpr double kMost_s = 0.33;   // of the last second in longer ones; .6 where samples are lost at random
  const auto isHoles = [](const SensorVerdict &verdict) { return verdict.kind == "holes"; };
  if (m_samples.size() <= kLeast || std::any_of(m_verdicts.begin(), m_verdicts.end(), isHoles))
    return;
  std::vector<double> spacings_s;
  for (std::size_t i = 1; i < m_samples.size(); ++i)
    spacings_s.push_back(secondsOf(m_samples[i].stamp_ns - m_samples[i - 1].stamp_ns));
  const double long_s = kUsual * medianOf(spacings_s);
  double lost_s = 0, longest_s = 0;
  for (std::size_t i = 0; i < spacings_s.size(); ++i)
    if (now_ns - m_samples[i + 1].stamp_ns < nsOf(1) && spacings_s[i] > long_s && spacings_s[i] < kSilence_s) {
      lost_s += spacings_s[i];
      longest_s = std::max(longest_s, spacings_s[i]);
    }
  if (lost_s > kMost_s)
    raise(Sensor::gyro, "holes", secondsOf(now_ns) - 1,
          fmt::format("gyro: samples are lost, for up to {:.0f} ms", 1e3 * longest_s), Lasts::no);
}

/// Checks for a gyro that repeats its value or has no more samples.
void SensorMonitor::checkGyroSamples(const Frame &frame)
{
  const GyroSample *before = nullptr;
  for (const GyroSample &sample : m_samples) {
    if (sample.stamp_ns > m_last_gyro_ns && (before == nullptr || sample.rate != before->rate))
      m_gyro_changed_ns = sample.stamp_ns;
    before = &sample;
  }
  if (!frame.gyro.empty()) {
    m_had_gyro = true;
    m_last_gyro_ns = frame.gyro.back().stamp_ns;
  }
  if (!m_had_gyro)
    return;
  checkLostSamples(frame.stamp_ns);
  if (secondsOf(frame.stamp_ns - m_last_gyro_ns) > kSilence_s)
    raise(Sensor::gyro, "ended", secondsOf(m_last_gyro_ns),
          fmt::format("gyro: nothing since {:.1f} s", secondsOf(m_last_gyro_ns)), Lasts::until_agree);
  const bool moves = std::any_of(m_steps.begin(), m_steps.end(), [](const Step &step) { return step.parallax_px > 1; });
  if (moves && m_gyro_changed_ns && secondsOf(m_last_gyro_ns - *m_gyro_changed_ns) > kStuck_s)
    raise(Sensor::gyro, "stuck", secondsOf(*m_gyro_changed_ns),
          fmt::format("gyro: repeats its value since {:.1f} s", secondsOf(*m_gyro_changed_ns)), Lasts::until_agree);
}

void SensorMonitor::compare(const Frame &frame, const RelativeMotion &motion)
{
  Comparison now;
  now.a_ns = motion.a_ns;
  now.b_ns = motion.b_ns;
  const double dt = secondsOf(now.b_ns - now.a_ns);
  now.points = Matrix3d(m_bMc.R * motion.points.aRb * m_bMc.R.transpose());
  now.points_covariance = m_bMc.R * motion.points.covariance.topLeftCorner<3, 3>() * m_bMc.R.transpose();
  const Matrix3d one = Matrix3d::Identity();
  const double bias2 = std::pow(kBiasSigma * dt, 2) + std::pow(8e-4, 2) * dt;
  const double turn2 = std::pow(odometry::kTurnSigma, 2);
  now.gyro = turnBetween(m_samples, now.a_ns, now.b_ns);
  const auto a = std::find_if(m_steps.begin(), m_steps.end(), [&](const Step &s) { return s.stamp_ns == now.a_ns; });
  if (frame.wMb_odometry && a != m_steps.end()) {
    now.odometry = Matrix3d(a->wMb.R.transpose() * frame.wMb_odometry->R);
    const Vector3d moved = a->wMb.R.transpose() * (frame.wMb_odometry->t - a->wMb.t);
    const double length = moved.norm();
    if (motion.points.hasDirection() && length > 0.05 && motion.points.parallax_px > 1) {
      now.direction = moved / length;
      now.askew = now.direction.cross(m_bMc.R * motion.points.direction);
      now.askew_variance =
          0.5 * motion.points.covariance.bottomRightCorner<2, 2>().trace() + odometry::directionVariance(length, dt);
    }
  }
  if (now.gyro) {
    now.error_covariance = now.points_covariance + bias2 * one;
    now.error = logSo3(orthonormalized(now.gyro->transpose() * *now.points));
    now.gyro_points = now.error.dot(now.error_covariance.ldlt().solve(now.error));
    constexpr std::int64_t kAround_ns = 20'000'000; // that a rate is the mean of
    const auto rateAt = [this](std::int64_t stamp_ns) {
      const GyroRotation turned = integrateGyro(m_samples, stamp_ns - kAround_ns, stamp_ns + kAround_ns);
      return Vector3d(logSo3(turned.R) / turned.duration);
    };
    now.rate_a = now.gyro->transpose() * rateAt(now.a_ns);
    now.rate_b = rateAt(now.b_ns);
  }
  if (now.odometry)
    now.odometry_points = squared(*now.odometry, *now.points, now.points_covariance + turn2 * one);
  if (now.gyro && now.odometry)
    now.gyro_odometry = squared(*now.gyro, *now.odometry, (bias2 + turn2) * one);
  m_comparisons.push_back(now);
}

std::deque<SensorMonitor::Comparison>::const_iterator SensorMonitor::windowBegin() const
{
  return m_comparisons.end() - static_cast<std::ptrdiff_t>(std::min(kWindow, m_comparisons.size()));
}

/// Log-likelihood ratio that the points err and not the gyro, by all of the window where these two differ: 0 without an
/// odometry that is trusted.
double SensorMonitor::logOddsOfPoints() const
{
  if (!trusts(Sensor::odometry))
    return 0;
  double ratio = 0;
  for (auto c = windowBegin(); c != m_comparisons.end(); ++c)
    if (c->gyro_points > kLimitPoints)
      ratio += 0.5 * (c->odometry_points - c->gyro_odometry);
  return ratio;
}

/// Raises a verdict on the sensor that is in all failing pairs.
void SensorMonitor::checkRotations()
{
  if (m_comparisons.size() < kOfWindow)
    return;
  std::size_t gyro_points = 0, gyro_odometry = 0, odometry_points = 0;
  double since_s = secondsOf(m_comparisons.back().a_ns);
  for (auto c = windowBegin(); c != m_comparisons.end(); ++c) {
    gyro_points += c->gyro_points > kLimitPoints;
    gyro_odometry += c->gyro_odometry > kLimitOdometry;
    odometry_points += c->odometry_points > kLimitOdometry;
    if (c->gyro_points > kLimitPoints || c->odometry_points > kLimitOdometry)
      since_s = std::min(since_s, secondsOf(c->a_ns));
  }
  const bool gyro_failed = gyro_points >= kOfWindow && trusts(Sensor::gyro);
  const bool odometry_failed = odometry_points >= kOfWindow && trusts(Sensor::odometry);
  if (gyro_failed && odometry_points * 2 >= gyro_points && odometry_points > 0 && gyro_odometry == 0)
    raise(Sensor::images, "rotation", since_s,
          fmt::format("images: contradict gyro and odometry since {:.1f} s (late, skewed or of another camera)",
                      since_s));
  else if (gyro_failed && logOddsOfPoints() < kLimitOdds && trusts(Sensor::images)) {
    raise(Sensor::gyro, "rotation", since_s,
          fmt::format("gyro: contradicts the points {}since {:.1f} s", gyro_odometry > 0 ? "and the odometry " : "",
                      since_s),
          Lasts::until_agree);
    diagnoseGyro();
  }
  else if (odometry_failed && gyro_points == 0 && trusts(Sensor::images))
    raise(Sensor::odometry, "rotation", since_s,
          fmt::format("odometry: its rotation contradicts the points since {:.1f} s", since_s));
}

/// Diagnoses a gyro that contradicts the others: a constant bias, a clock offset, or something else.
void SensorMonitor::diagnoseGyro()
{
  constexpr double kExplained = 6; // mean squared difference that is left when the cause is found
  constexpr std::size_t kLeast = 3;
  const GyroTurns gyro(m_samples);
  std::vector<calibration::Turn> turns, at_any_time;
  for (const Comparison &c : m_comparisons) {
    if (c.gyro_points <= 0.5 * kLimitPoints)
      continue;
    const double white = std::pow(1e-3 * secondsOf(c.b_ns - c.a_ns), 2); // of the gyro
    turns.push_back({c.a_ns, c.b_ns, *c.points, (c.points_covariance + white * Matrix3d::Identity()).inverse()});
    const std::int64_t most_ns = nsOf(calibration::kMostLate_s);
    if (gyro.between(c.a_ns - most_ns, c.b_ns + most_ns))
      at_any_time.push_back(turns.back());
  }
  SensorVerdict &verdict = m_verdicts.back();
  const calibration::Fitted constant = calibration::fitBias(gyro, turns, 0, 1, 0);
  if (turns.size() >= kLeast && constant.scatter < kExplained && constant.value.norm() > 3 * kBiasSigma) {
    verdict.kind = "bias";
    verdict.text = fmt::format("gyro: bias {:.2f} rad/s", constant.value.norm());
    return;
  }
  const auto fitAt = [&](double late_s) { return calibration::fitBias(gyro, at_any_time, late_s, 1, 1); };
  const calibration::Minimum late = calibration::minimiseLate([&](double late_s) { return fitAt(late_s).cost; });
  if (at_any_time.size() >= kLeast && late.is_inside && fitAt(late.late_s).failing == 0 &&
      fitAt(late.late_s).cost < 0.3 * fitAt(0).cost) {
    verdict.kind = "time";
    verdict.text = fmt::format("camera and gyro {:.0f} ms apart", 1e3 * std::abs(late.late_s));
  }
  else if (verdict.since_s < secondsOf(m_comparisons.front().b_ns)) {
    verdict.text = "gyro: axes, sign or units wrong";
  }
}
} // namespace bole
