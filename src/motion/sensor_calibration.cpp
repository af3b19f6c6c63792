// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/sensor_calibration.h"

#include "geometry/constants.h"
#include "geometry/median.h"
#include "motion/inertial_scale.h"
#include "motion/sensor_monitor.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
using Eigen::Matrix3d;
using Eigen::Vector3d;
using Matrix23d = Eigen::Matrix<double, 2, 3>;

namespace calibration
{
namespace
{
constexpr double kLooksThrough_s = 10;
constexpr double kBaseline_s = 0.25; ///< least time between the two frames of a motion

constexpr double kMostLate_s = 0.15, kLateStep_s = 0.01;
constexpr int kLateSteps = 15;
constexpr double kLeastLate_s = 0.01; ///< less turns a body by less than what the points are worth [s]
constexpr double kMostScale = 0.5;    ///< of the log of the odometry's scale that is looked for
constexpr double kWideBias = 0.1;     ///< of the wide part of the prior [rad/s]
constexpr double kMount = 0.017;      ///< of the narrow part of the prior on the odometry's attitude [rad]
constexpr double kWideMount = 0.17;   ///< of the wide one
constexpr double kScale = 0.03;       ///< of the narrow part of the prior on the log of the scale
constexpr double kWideScale = 0.25;   ///< of the wide one
constexpr double kWidePart = 0.1;     ///< of the odometries: those that are not as stated
constexpr double kBetter = 16;        ///< by which twice the log of the likelihood must grow: four standard deviations
constexpr double kSoft = 9;           ///< squared error over its variance from which a measurement loses its say
constexpr double kFails = 30;         ///< ... at which it contradicts what was fitted
constexpr double kMostFailing = 0.15; ///< of the measurements: more, and the constants do not explain the sensor
constexpr double kPointsSigma = 7e-4; ///< of a rotation by points beside their own covariance [rad]
constexpr double kTurnSigma = 0.007;  ///< of the odometry's rotation between two poses [rad]
constexpr std::size_t kLeastMotions = 15;

std::int64_t nsOf(double s) { return static_cast<std::int64_t>(std::llround(s * 1e9)); }
double secondsOf(std::int64_t ns) { return 1e-9 * static_cast<double>(ns); }

double soft(double squares) { return kSoft * std::log1p(squares / kSoft); }
double weightFor(double squares) { return 1 / (1 + squares / kSoft); }

/// The gyro integrated once: its rotation between any two times costs two lookups.
class GyroPath
{
public:
  GyroPath(const std::vector<GyroSample> &samples, const Vector3d &bias) : m_samples(samples), m_bias(bias)
  {
    Matrix3d R = Matrix3d::Identity();
    for (std::size_t i = 0; i < samples.size(); ++i) {
      if (i > 0)
        R = R * turn(i - 1, samples[i].stamp_ns - samples[i - 1].stamp_ns);
      m_turned.push_back(R);
    }
  }

  /// Nothing outside of the samples and where some are missing.
  std::optional<Matrix3d> between(std::int64_t a_ns, std::int64_t b_ns) const
  {
    const auto a = at(a_ns), b = at(b_ns);
    if (!a || !b)
      return std::nullopt;
    for (std::size_t i = a->second; i < b->second; ++i)
      if (secondsOf(m_samples[i + 1].stamp_ns - m_samples[i].stamp_ns) > kMostGap_s)
        return std::nullopt;
    return Matrix3d(a->first.transpose() * b->first);
  }

private:
  /// From sample \p i on for \p ns, the rate linear between the samples.
  Matrix3d turn(std::size_t i, std::int64_t ns) const
  {
    const GyroSample &from = m_samples[i], &to = m_samples[std::min(i + 1, m_samples.size() - 1)];
    const double part = to.stamp_ns > from.stamp_ns ? double(ns) / double(to.stamp_ns - from.stamp_ns) : 0;
    return expSo3((from.rate + 0.5 * part * (to.rate - from.rate) - m_bias) * secondsOf(ns));
  }

  std::optional<std::pair<Matrix3d, std::size_t>> at(std::int64_t stamp_ns) const
  {
    const auto after = std::upper_bound(m_samples.begin(), m_samples.end(), stamp_ns,
                                        [](std::int64_t t, const GyroSample &sample) { return t < sample.stamp_ns; });
    if (after == m_samples.begin() || secondsOf(stamp_ns - (after - 1)->stamp_ns) > kMostGap_s)
      return std::nullopt;
    const auto i = static_cast<std::size_t>(after - m_samples.begin()) - 1;
    return std::make_pair(Matrix3d(m_turned[i] * turn(i, stamp_ns - m_samples[i].stamp_ns)), i);
  }

  std::vector<GyroSample> m_samples;
  std::vector<Matrix3d> m_turned; ///< since the first sample, at each
  Vector3d m_bias;
};

/// The rotation of the body over an interval, by points.
struct Turn
{
  std::int64_t a_ns = 0, b_ns = 0;
  Matrix3d aRb = Matrix3d::Identity();
  Matrix3d information = Matrix3d::Zero(); ///< without that of the gyro's noise
  double duration() const { return secondsOf(b_ns - a_ns); }
};

/// A least squares fit of P unknowns.
template <int P> struct FittedOf
{
  double cost = 0; ///< robust, counting what overlaps once
  Eigen::Matrix<double, P, 1> value = Eigen::Matrix<double, P, 1>::Zero();
  Eigen::Matrix<double, P, P> covariance = Eigen::Matrix<double, P, P>::Zero();
  double failing = 1; ///< share of the measurements that contradict it
  double scatter = 1; ///< variance of what is left over what it should be
};
using Fitted = FittedOf<3>;

/// Median of the squares of three normal errors each, over what it should be; at least 1.
double scatterOf(const std::vector<double> &squares) { return std::max(1.0, medianOf(squares) / 2.37); }

double failingOf(const std::vector<double> &squares)
{
  const auto failing = std::count_if(squares.begin(), squares.end(), [](double e2) { return e2 > kFails; });
  return squares.empty() ? 1 : double(failing) / double(squares.size());
}

/// A linear measurement r + J x of P unknowns with its information W.
template <int P> struct RowOf
{
  using Unknowns = Eigen::Matrix<double, P, 1>;
  template <int N>
  RowOf(const Eigen::Matrix<double, N, P> &J, const Eigen::Matrix<double, N, 1> &r,
        const Eigen::Matrix<double, N, N> &W, double overlap_)
      : JWJ(J.transpose() * W * J), JWr(J.transpose() * W * r), rWr(r.dot(W * r)), size(N), overlap(overlap_)
  {
  }
  /// Of what is left of it at \p x, as of three numbers.
  double squares(const Unknowns &x) const { return std::max(0.0, rWr + x.dot(2 * JWr + JWJ * x)) * 3 / size; }

  Eigen::Matrix<double, P, P> JWJ;
  Unknowns JWr;
  double rWr = 0;
  int size = 3;
  double overlap = 1; ///< measurements that share what they measured
};
using Row = RowOf<3>;

/// Robust solution; \p prior2: variance of each unknown.
template <int P>
FittedOf<P> solve(const std::vector<RowOf<P>> &rows, const typename RowOf<P>::Unknowns &prior2, double scatter)
{
  FittedOf<P> fit;
  constexpr int kIterations = 6;
  std::vector<double> squares(rows.size());
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    Eigen::Matrix<double, P, P> H = prior2.cwiseInverse().asDiagonal();
    typename RowOf<P>::Unknowns g = RowOf<P>::Unknowns::Zero();
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const RowOf<P> &row = rows[i];
      const double w = (iteration == 0 ? 1 : weightFor(squares[i])) / row.overlap;
      H += w * row.JWJ;
      g += w * row.JWr;
    }
    fit.covariance = H.inverse();
    fit.value = -fit.covariance * g;
    for (std::size_t i = 0; i < rows.size(); ++i)
      squares[i] = rows[i].squares(fit.value);
  }
  fit.failing = failingOf(squares);
  fit.scatter = scatter > 0 ? scatter : scatterOf(squares);
  fit.covariance *= fit.scatter;
  for (std::size_t i = 0; i < rows.size(); ++i)
    fit.cost += soft(squares[i] / fit.scatter) / rows[i].overlap;
  return fit;
}
Fitted solve(const std::vector<Row> &rows, double prior2, double scatter = 0)
{
  return solve<3>(rows, Vector3d::Constant(prior2), scatter);
}

/// The bias of a gyro that is \p late_s, by the rotations of the points.
Fitted fitBias(const GyroPath &path, const std::vector<Turn> &turns, double late_s, double overlap, double scatter)
{
  std::vector<Row> rows;
  for (const Turn &turn : turns) {
    const auto turned = path.between(turn.a_ns + nsOf(late_s), turn.b_ns + nsOf(late_s));
    if (turned) // the rates less the bias: what is left of it turns the other way
      rows.emplace_back(Matrix3d(turn.duration() * Matrix3d::Identity()),
                        logSo3(orthonormalized(turned->transpose() * turn.aRb)), turn.information, overlap);
  }
  return solve(rows, kWideBias * kWideBias, scatter);
}

/// Errors in what relates camera and gyro, which turn the points' rotations against the gyro's by a share of the
/// rotation itself: beside the bias the attitude of the camera on the body, its two focal lengths, and the scale of the
/// gyro.
constexpr int kShares = 9;
constexpr double kFocal = 0.007;    ///< of the narrow part of the prior on the share of a focal length
constexpr double kGyroScale = 0.01; ///< ... of the gyro's rates
constexpr double kMostShare = 0.6;  ///< more is another fault
constexpr double kWideShare = 0.5;  ///< of the wide ones, and of the attitude [rad]
struct Relation
{
  int first, count; ///< of its unknowns
  double narrow;
};
constexpr Relation kAttitude{3, 3, kMount}, kFocalLengths{6, 2, kFocal}, kRates{8, 1, kGyroScale};

std::vector<RowOf<kShares>> rowsOfShares(const GyroPath &path, const std::vector<Turn> &turns, const Matrix3d &bRc,
                                         double late_s, double overlap)
{
  std::vector<RowOf<kShares>> rows;
  for (const Turn &turn : turns) {
    const auto turned = path.between(turn.a_ns + nsOf(late_s), turn.b_ns + nsOf(late_s));
    if (!turned)
      continue;
    const Vector3d angle = logSo3(*turned), seen = bRc.transpose() * angle;
    Eigen::Matrix<double, 3, kShares> J;
    J << turn.duration() * Matrix3d::Identity(), -skew(angle), bRc.col(1) * seen.y(), bRc.col(0) * seen.x(), angle;
    rows.emplace_back(J, Vector3d(logSo3(orthonormalized(turned->transpose() * turn.aRb))), turn.information, overlap);
  }
  return rows;
}

/// A minimum over offsets of a clock, refined by a parabola.
struct Minimum
{
  double late_s = 0, sigma_s = 0, gain = 0; ///< gain: of the cost against no offset
  bool is_inside = false;
};

template <typename Cost> Minimum minimiseLate(const Cost &cost)
{
  std::vector<double> costs;
  for (int k = -kLateSteps; k <= kLateSteps; ++k)
    costs.push_back(cost(kLateStep_s * k));
  const auto best = std::min_element(costs.begin(), costs.end());
  Minimum minimum;
  minimum.is_inside = best != costs.begin() && best + 1 != costs.end();
  if (!minimum.is_inside)
    return minimum;
  const double before = *(best - 1), after = *(best + 1), curvature = std::max(1e-9, before - 2 * *best + after);
  const double vertex = std::clamp(0.5 * (before - after) / curvature, -0.5, 0.5);
  minimum.late_s = kLateStep_s * (double(best - costs.begin()) - kLateSteps + vertex);
  minimum.sigma_s = kLateStep_s * std::sqrt(2 / curvature);
  minimum.gain = costs[kLateSteps] - (*best - 0.5 * curvature * vertex * vertex);
  return minimum;
}

/// The bias and what \p open holds, the others as they are stated; the cost counts what each is off that.
FittedOf<kShares> fitShares(const std::vector<RowOf<kShares>> &rows, const std::vector<Relation> &open, double scatter)
{
  Eigen::Matrix<double, kShares, 1> prior;
  prior.head<3>().setConstant(kWideBias);
  for (const Relation &relation : {kAttitude, kFocalLengths, kRates})
    prior.segment(relation.first, relation.count).setConstant(relation.narrow);
  for (const Relation &relation : open)
    prior.segment(relation.first, relation.count).setConstant(kWideShare);
  FittedOf<kShares> fit = solve<kShares>(rows, prior.cwiseAbs2(), scatter);
  fit.cost += fit.value.cwiseQuotient(prior).squaredNorm();
  return fit;
}

/// What is left of the frames once the constants are taken out.
std::vector<Frame> corrected(const std::vector<Frame> &frames, const SensorCalibration &calibration)
{
  constexpr std::int64_t kMostOdometryGap_ns = 1'000'000'000;
  Recording recording;
  for (const Frame &frame : frames) {
    recording.gyro.insert(recording.gyro.end(), frame.gyro.begin(), frame.gyro.end());
    if (frame.wMb_odometry)
      recording.odometry.push_back({frame.stamp_ns, *frame.wMb_odometry});
  }
  recording = bole::corrected(std::move(recording), calibration);
  std::vector<Frame> result;
  std::size_t at = 0;
  for (const Frame &frame : frames) {
    Frame now;
    now.stamp_ns = frame.stamp_ns;
    now.index = frame.index;
    now.wMb_odometry = interpolate(recording.odometry, frame.stamp_ns, kMostOdometryGap_ns);
    for (; at < recording.gyro.size() && recording.gyro[at].stamp_ns <= frame.stamp_ns; ++at)
      if (!result.empty())
        now.gyro.push_back(recording.gyro[at]);
    result.push_back(std::move(now));
  }
  return result;
}

/// The estimation itself.
class Estimation
{
public:
  Estimation(const std::vector<Frame> &frames, const std::vector<RelativeMotion> &motions, const Pose &bMc,
             const GyroOptions &gyro)
      : m_frames(frames), m_motions(motions), m_bMc(bMc), m_gyro(gyro)
  {
    for (const Frame &frame : frames)
      m_samples.insert(m_samples.end(), frame.gyro.begin(), frame.gyro.end());
    for (const RelativeMotion &motion : motions) {
      if (!motion.points.hasRotation())
        continue;
      Turn turn;
      turn.a_ns = motion.a_ns;
      turn.b_ns = motion.b_ns;
      turn.aRb = bMc.R * motion.points.aRb * bMc.R.transpose();
      const double white = std::pow(kPointsSigma, 2) + std::pow(gyro.noise_density, 2) * turn.duration();
      turn.information =
          (bMc.R * motion.points.covariance.topLeftCorner<3, 3>() * bMc.R.transpose() + white * Matrix3d::Identity())
              .inverse();
      m_turns.push_back(turn);
      m_overlap = std::max(m_overlap, static_cast<double>(motion.b_index - motion.a_index));
    }
  }

  SensorCalibration run()
  {
    if (!m_samples.empty() && m_turns.size() >= kLeastMotions)
      calibrateGyro();
    const SensorCalibration gyro_alone = m_result;
    if (!m_result.verdicts.empty())
      return m_result; // whatever else is measured rests on camera and gyro
    if (m_is_gyro_explained) {
      calibrateOdometryClock();
      calibrateRotation();
      calibrateScale();
    }
    judge();
    const auto is_odometry = [](const SensorVerdict &verdict) { return verdict.sensor == toString(Sensor::odometry); };
    if (std::none_of(m_result.verdicts.begin(), m_result.verdicts.end(), is_odometry))
      return m_result;
    SensorCalibration without_odometry = gyro_alone;
    without_odometry.verdicts = m_result.verdicts;
    return without_odometry;
  }

private:
  void calibrateGyro();
  void judgeCamera(const GyroPath &path, const std::vector<Turn> &turns);
  void calibrateRotation();
  void calibrateOdometryClock();
  void calibrateScale();
  void judge();
  template <typename Take> void replay(const Take &take) const;
  void addDirections(const std::vector<Frame> &frames, std::vector<Row> &rows) const;
  void addGravity(const std::vector<Frame> &frames, std::vector<Row> &rows) const;
  void addTurns(const std::vector<Frame> &frames, const GyroPath &path, double late_s, std::vector<Row> &rows) const;

  void tell(const char *name, double value, double sigma, bool used, std::string text)
  {
    m_result.constants.push_back({name, value, sigma, used, std::move(text)});
  }

  const std::vector<Frame> &m_frames;
  const std::vector<RelativeMotion> &m_motions;
  Pose m_bMc;
  GyroOptions m_gyro;
  std::vector<GyroSample> m_samples;
  std::vector<Turn> m_turns;
  double m_overlap = 1; ///< turns that share an interval
  bool m_is_gyro_explained = false;
  SensorCalibration m_result;
};

void Estimation::calibrateGyro()
{
  Vector3d bias = Vector3d::Zero();
  Minimum late;
  Fitted fit;
  std::vector<Turn> turns;                  // that every offset can be tried on
  for (int round = 0; round < 2; ++round) { // the second one with the bias taken off exactly
    const GyroPath path(m_samples, bias);
    turns.clear();
    for (const Turn &turn : m_turns)
      if (path.between(turn.a_ns - nsOf(kMostLate_s), turn.b_ns + nsOf(kMostLate_s)))
        turns.push_back(turn);
    if (turns.size() < kLeastMotions)
      return;
    double best = std::numeric_limits<double>::max(), scatter = 1;
    for (int k = -kLateSteps; k <= kLateSteps; ++k) { // the scatter of the best offset is that of the noise
      const Fitted tried = fitBias(path, turns, kLateStep_s * k, m_overlap, 1);
      if (tried.cost < best) {
        best = tried.cost;
        scatter = 0;
        fit = fitBias(path, turns, kLateStep_s * k, m_overlap, scatter);
        scatter = std::sqrt(fit.covariance.trace() / tried.covariance.trace());
        scatter *= scatter;
      }
    }
    late = minimiseLate([&](double late_s) { return fitBias(path, turns, late_s, m_overlap, scatter).cost; });
    fit = fitBias(path, turns, late.is_inside ? late.late_s : 0, m_overlap, scatter);
    bias += fit.value;
  }
  judgeCamera(GyroPath(m_samples, bias), turns);
  m_is_gyro_explained = fit.failing < kMostFailing;
  if (!m_is_gyro_explained)
    return;
  const bool is_late = late.is_inside && late.gain > kBetter && std::abs(late.late_s) > kLeastLate_s;
  if (late.is_inside)
    tell("gyro_late_s", late.late_s, late.sigma_s, is_late,
         fmt::format("gyro: clock {:.0f} +- {:.0f} ms {}", 1e3 * std::abs(late.late_s), std::ceil(1e3 * late.sigma_s),
                     late.late_s > 0 ? "late" : "early"));
  if (is_late)
    m_result.gyro_late_s = late.late_s;
  const Matrix3d expected = fit.covariance + std::pow(m_gyro.bias_sigma, 2) * Matrix3d::Identity();
  const bool is_biased = bias.dot(expected.ldlt().solve(bias)) > kBetter;
  const double sigma = std::sqrt(fit.covariance.trace() / 3);
  tell("gyro_bias", bias.norm(), sigma, is_biased,
       fmt::format("gyro: bias {:.3f} +- {:.3f} rad/s", bias.norm(), sigma));
  if (is_biased)
    m_result.gyro_bias = bias;
}

/// What \p relation was found to be, with its sigma, for the user.
SensorVerdict verdictOf(const Relation &relation, const Eigen::VectorXd &x, double sigma)
{
  if (relation.first == kFocalLengths.first) {
    const Eigen::Array2d percent = 100 * (1 / (1 - x.array()) - 1);
    return {
        "images", "focal", 0,
        fmt::format("images: focal lengths of the camera file off by {:+.1f} % (fx) and {:+.1f} % (fy), +- {:.1f} %, "
                    "by the gyro",
                    percent[0], percent[1], 100 * sigma)};
  }
  if (relation.first == kAttitude.first)
    return {"images", "mount", 0,
            fmt::format("images: the camera stands {:.1f} +- {:.1f} degrees otherwise to the gyro than T_BS says (roll "
                        "{:.1f}, pitch {:.1f}, yaw {:.1f})",
                        x.norm() / kDegree, sigma / kDegree, x[0] / kDegree, x[1] / kDegree, x[2] / kDegree)};
  return {"gyro", "scale", 0,
          fmt::format("gyro: its rates are off by {:+.1f} +- {:.1f} %", 100 * x[0] / (1 - x[0]), 100 * sigma)};
}

/// A camera file or a scale of the gyro under which images and gyro would agree, in both halves of what was looked
/// through. The user's numbers are not changed.
void Estimation::judgeCamera(const GyroPath &path, const std::vector<Turn> &turns)
{
  constexpr double kAsGood = 9;   // the data do not tell one from the other: three standard deviations
  constexpr double kInHalves = 6; // two and a half: what begins later is no constant
  const std::vector<Relation> all = {kAttitude, kFocalLengths, kRates};
  const auto rowsAt = [&](double late_s) { return rowsOfShares(path, turns, m_bMc.R, late_s, m_overlap); };
  const Minimum late = minimiseLate([&](double late_s) { return fitShares(rowsAt(late_s), all, 1).cost; });
  if (!late.is_inside)
    return;
  const std::vector<RowOf<kShares>> rows = rowsAt(late.late_s);
  const auto middle = rows.begin() + static_cast<std::ptrdiff_t>(rows.size() / 2);
  const double scatter = fitShares(rows, all, 0).scatter;
  const auto gainOf = [&](const std::vector<RowOf<kShares>> &some, const Relation &relation) {
    return fitShares(some, {}, scatter).cost - fitShares(some, {relation}, scatter).cost;
  };
  double best = 0;
  for (const Relation &relation : all) {
    const FittedOf<kShares> fit = fitShares(rows, {relation}, scatter);
    const Eigen::VectorXd x = fit.value.segment(relation.first, relation.count);
    const double variance = fit.covariance.diagonal().segment(relation.first, relation.count).mean();
    const double gain = gainOf(rows, relation);
    if (gain < std::max(kBetter, best - kAsGood) || fit.failing >= kMostFailing || x.maxCoeff() > kMostShare ||
        gainOf({rows.begin(), middle}, relation) < kInHalves || gainOf({middle, rows.end()}, relation) < kInHalves)
      continue;
    if (gain > best + kAsGood)
      m_result.verdicts.clear();
    m_result.verdicts.push_back(verdictOf(relation, x, std::sqrt(variance)));
    m_result.verdicts.back().since_s = secondsOf(m_frames.front().stamp_ns);
    best = std::max(best, gain);
  }
}

/// Direction of flight: bRo takes that of the odometry to that of the points.
void Estimation::addDirections(const std::vector<Frame> &frames, std::vector<Row> &rows) const
{
  const SensorMonitorOptions noise;
  for (const RelativeMotion &motion : m_motions) {
    const Frame &a = frames[motion.a_index], &b = frames[motion.b_index];
    if (!motion.points.hasDirection() || motion.points.parallax_px < 1 || !a.wMb_odometry || !b.wMb_odometry)
      continue;
    const Vector3d moved = a.wMb_odometry->R.transpose() * (b.wMb_odometry->t - a.wMb_odometry->t);
    const double length = moved.norm(), dt = secondsOf(motion.b_ns - motion.a_ns);
    if (length < 0.05)
      continue;
    const Vector3d by_odometry = moved / length, by_points = m_bMc.R * motion.points.direction;
    const double variance =
        0.5 * motion.points.covariance.bottomRightCorner<2, 2>().trace() +
        (std::pow(noise.odometry_walk, 2) * dt + std::pow(noise.odometry_height_sigma, 2)) / (length * length) +
        std::pow(noise.odometry_relative, 2);
    Matrix23d across;
    across.row(0) = by_points.unitOrthogonal().transpose();
    across.row(1) = by_points.cross(Vector3d(across.row(0))).transpose();
    rows.emplace_back(Matrix23d(-across * skew(by_odometry)), Eigen::Vector2d(across * (by_odometry - by_points)),
                      Eigen::Matrix2d(Eigen::Matrix2d::Identity() / variance), m_overlap);
  }
}

/// Gravity: over all frames the mean force, turned by the odometry, is up.
void Estimation::addGravity(const std::vector<Frame> &frames, std::vector<Row> &rows) const
{
  constexpr double kSigma = 0.012; // of the tilt by the bias of an accelerometer, 0.1 m/s^2 [rad]
  constexpr std::size_t kParts = 3;
  for (std::size_t part = 0; part < kParts; ++part) {
    const std::size_t first = part * (frames.size() - 1) / kParts, last = (part + 1) * (frames.size() - 1) / kParts;
    Vector3d sum = Vector3d::Zero();
    Matrix3d by_rotation = Matrix3d::Zero();
    int count = 0;
    bool varies = false;
    std::optional<Vector3d> before;
    if (last < first + 8)
      return;
    for (std::size_t i = first + 1; i <= last; ++i) {
      if (!frames[i].wMb_odometry)
        return;
      for (const GyroSample &sample : frames[i].gyro) {
        if (!sample.force)
          return;
        varies = varies || (before && *before != *sample.force);
        before = sample.force;
        sum += frames[i].wMb_odometry->R * *sample.force;
        by_rotation += frames[i].wMb_odometry->R * skew(*sample.force);
        ++count;
      }
    }
    if (count < 40 || !varies || !frames[first].wMb_odometry)
      return;
    const auto velocity = [&](std::size_t i) { // over three steps
      return Vector3d((frames[i + 3].wMb_odometry->t - frames[i].wMb_odometry->t) /
                      secondsOf(frames[i + 3].stamp_ns - frames[i].stamp_ns));
    };
    const double dt = secondsOf(frames[last].stamp_ns - frames[first].stamp_ns);
    const double lag = secondsOf(frames[first + 3].stamp_ns - frames[first].stamp_ns);
    const Vector3d acceleration = (velocity(last - 3) - velocity(first)) / std::max(0.1, dt - lag);
    const Vector3d up = sum / count - acceleration;
    const double sigma = std::hypot(kSigma, 0.1 / (kGravity * dt)); // 0.1 m/s: of a velocity
    rows.emplace_back(Matrix23d(by_rotation.topRows<2>() / count / kGravity), Eigen::Vector2d(up.head<2>() / kGravity),
                      Eigen::Matrix2d(Eigen::Matrix2d::Identity() / (sigma * sigma)), double(kParts));
  }
}

/// Rotations over half a second: bRo carries those of the odometry to those of the gyro.
void Estimation::addTurns(const std::vector<Frame> &frames, const GyroPath &path, double late_s,
                          std::vector<Row> &rows) const
{
  constexpr std::int64_t kApart_ns = 500'000'000;
  constexpr double kShared = 2; // turns that have an end in common
  std::size_t b = 0;
  for (std::size_t a = 0; a < frames.size(); ++a) {
    while (b < frames.size() && frames[b].stamp_ns < frames[a].stamp_ns + kApart_ns)
      ++b;
    if (b == frames.size())
      return;
    if (!frames[a].wMb_odometry || !frames[b].wMb_odometry)
      continue;
    const auto turned = path.between(frames[a].stamp_ns - nsOf(late_s), frames[b].stamp_ns - nsOf(late_s));
    if (!turned)
      continue;
    const Vector3d by_gyro = logSo3(*turned);
    const Vector3d by_odometry =
        logSo3(orthonormalized(frames[a].wMb_odometry->R.transpose() * frames[b].wMb_odometry->R));
    const double dt = secondsOf(frames[b].stamp_ns - frames[a].stamp_ns);
    const double variance = kTurnSigma * kTurnSigma + std::pow(m_gyro.bias_sigma * dt, 2);
    rows.emplace_back(Matrix3d(-skew(by_odometry)), Vector3d(by_odometry - by_gyro),
                      Matrix3d(Matrix3d::Identity() / variance), kShared);
  }
}

void Estimation::calibrateRotation()
{
  Matrix3d bRo = Matrix3d::Identity();
  Fitted fit;
  for (int round = 0; round < 4; ++round) {
    SensorCalibration tried = m_result;
    tried.bRo = bRo;
    const std::vector<Frame> frames = corrected(m_frames, tried);
    std::vector<GyroSample> samples;
    for (const Frame &frame : frames)
      samples.insert(samples.end(), frame.gyro.begin(), frame.gyro.end());
    std::vector<Row> rows;
    addDirections(frames, rows);
    if (rows.size() < kLeastMotions) // the images must bear witness
      return;
    addGravity(frames, rows);
    addTurns(frames, GyroPath(samples, Vector3d::Zero()), 0, rows);
    fit = solve(rows, kWideMount * kWideMount);
    bRo = expSo3(fit.value) * bRo;
  }
  if (fit.failing >= kMostFailing)
    return;
  const Vector3d rotation = logSo3(bRo);
  const Matrix3d expected = fit.covariance + kMount * kMount * Matrix3d::Identity();
  const bool is_turned = rotation.dot(expected.ldlt().solve(rotation)) > kBetter;
  const double sigma = std::sqrt(fit.covariance.trace() / 3);
  tell("odometry_rotation", rotation.norm(), sigma, is_turned,
       fmt::format("odometry: body turned by {:.1f} +- {:.1f} degrees (roll {:.1f}, pitch {:.1f}, yaw {:.1f})",
                   rotation.norm() / kDegree, sigma / kDegree, rotation.x() / kDegree, rotation.y() / kDegree,
                   rotation.z() / kDegree));
  if (!is_turned)
    return;
  m_result.bRo = bRo;
  m_result.odometry_rotation_sigma = sigma;
}

void Estimation::calibrateOdometryClock()
{
  SensorCalibration tried = m_result;
  tried.odometry_late_s = 0;
  const std::vector<Frame> frames = corrected(m_frames, tried);
  std::vector<GyroSample> samples;
  for (const Frame &frame : frames)
    samples.insert(samples.end(), frame.gyro.begin(), frame.gyro.end());
  const GyroPath path(samples, Vector3d::Zero());
  std::vector<Frame> usable; // that every offset can be tried on
  for (const Frame &frame : frames)
    if (path.between(frame.stamp_ns - nsOf(kMostLate_s), frame.stamp_ns + nsOf(kMostLate_s)))
      usable.push_back(frame);
  if (usable.size() < 2 * kLeastMotions)
    return;
  const auto fitAt = [&](double late_s, double scatter) {
    std::vector<Row> rows;
    addTurns(usable, path, late_s, rows);
    return solve(rows, kWideMount * kWideMount, scatter); // whatever its body stands like
  };
  double best = std::numeric_limits<double>::max(), scatter = 1;
  for (int k = -kLateSteps; k <= kLateSteps; ++k) {
    const Fitted plain = fitAt(kLateStep_s * k, 1);
    if (plain.cost < best) {
      best = plain.cost;
      scatter = fitAt(kLateStep_s * k, 0).covariance.trace() / plain.covariance.trace();
    }
  }
  const auto cost = [&](double late_s) { return fitAt(late_s, scatter).cost; };
  const Minimum late = minimiseLate(cost);
  if (!late.is_inside || fitAt(late.late_s, scatter).failing >= kMostFailing)
    return;
  constexpr double kSameClock = 4, kNoWorse = 9; // gyro and odometry often come from one computer
  const double with_gyro = cost(m_result.gyro_late_s), least = cost(late.late_s);
  const bool shares_clock =
      m_result.gyro_late_s != 0 && cost(0) - with_gyro > kSameClock && with_gyro - least < kNoWorse;
  const double late_s = shares_clock ? m_result.gyro_late_s : late.late_s;
  const bool is_late = shares_clock || (late.gain > kBetter && std::abs(late.late_s) > kLeastLate_s);
  tell("odometry_late_s", late_s, late.sigma_s, is_late,
       fmt::format("odometry: clock {:.0f} +- {:.0f} ms {}{}", 1e3 * std::abs(late_s), std::ceil(1e3 * late.sigma_s),
                   late_s > 0 ? "late" : "early", shares_clock ? ", as the gyro's" : ""));
  if (is_late)
    m_result.odometry_late_s = late_s;
}

/// The frames as they would be read now, each with what points say of it.
template <typename Take> void Estimation::replay(const Take &take) const
{
  const std::vector<Frame> frames = corrected(m_frames, m_result);
  std::size_t next = 0;
  for (std::size_t i = 0; i < frames.size(); ++i) {
    std::vector<RelativeMotion> seen;
    for (; next < m_motions.size() && m_motions[next].b_index == i; ++next)
      seen.push_back(m_motions[next]);
    take(frames[i], seen);
  }
}

/// A sensor that contradicts the others from the start on, and for which no constant helps.
void Estimation::judge()
{
  constexpr double kAtOnce_s = 1.5;
  SensorMonitor monitor(m_bMc);
  replay([&](const Frame &frame, const std::vector<RelativeMotion> &seen) { monitor.process(frame, seen); });
  for (const SensorVerdict &verdict : monitor.verdicts())
    for (const Sensor sensor : {Sensor::gyro, Sensor::odometry})
      if (verdict.sensor == toString(sensor) && !monitor.trusts(sensor) && verdict.kind != "jump" &&
          verdict.kind != "ended" && verdict.kind != "stuck" &&
          verdict.since_s < secondsOf(m_frames.front().stamp_ns) + kAtOnce_s)
        m_result.verdicts.push_back(verdict);
}

void Estimation::calibrateScale()
{
  InertialScaleOptions options;
  options.start_sigma = kMostScale;
  InertialScale inertial(m_bMc, options, m_gyro);
  replay([&](const Frame &frame, const std::vector<RelativeMotion> &seen) { inertial.process(frame, seen); });
  const std::optional<LogScale> measured = inertial.scale(kMostScale);
  if (!measured || std::abs(measured->mean) > kMostScale)
    return;
  const auto density = [&](double prior_sigma) {
    const double variance = std::pow(measured->sigma, 2) + prior_sigma * prior_sigma;
    return std::exp(-0.5 * measured->mean * measured->mean / variance) / std::sqrt(variance);
  };
  const bool is_scaled = kWidePart * density(kWideScale) > (1 - kWidePart) * density(kScale);
  tell("odometry_scale", std::exp(measured->mean), measured->sigma, is_scaled,
       fmt::format("odometry: scale {:.3f} +- {:.3f}", std::exp(measured->mean), measured->sigma));
  if (!is_scaled)
    return;
  m_result.odometry_scale = std::exp(measured->mean);
  m_result.odometry_scale_sigma = measured->sigma;
}
} // namespace
} // namespace calibration

SensorCalibrator::SensorCalibrator(const Pose &bMc, const GyroOptions &gyro) : m_bMc(bMc), m_gyro(gyro) {}

void SensorCalibrator::add(const Frame &frame, const std::optional<RelativeMotion> &motion)
{
  Frame kept;
  kept.stamp_ns = frame.stamp_ns;
  kept.index = m_frames.size();
  kept.wMb_odometry = frame.wMb_odometry;
  kept.gyro = frame.gyro;
  m_frames.push_back(std::move(kept));
  if (motion)
    m_motions.push_back(*motion);
}

double SensorCalibrator::duration_s() const
{
  return m_frames.empty() ? 0 : calibration::secondsOf(m_frames.back().stamp_ns - m_frames.front().stamp_ns);
}

SensorCalibration SensorCalibrator::estimate() const
{
  if (m_frames.size() < calibration::kLeastMotions)
    return {};
  return calibration::Estimation(m_frames, m_motions, m_bMc, m_gyro).run();
}

SensorCalibration calibrateSensors(FrameSource &source, bool use_gyro, bool use_odometry)
{
  if (!(use_gyro && source.hasGyro()) && !(use_odometry && source.hasOdometry()))
    return {};
  SensorCalibrator calibrator(source.bMc());
  const PinholeCamera camera = source.camera();
  PointTracker tracker(camera);
  struct Tracked
  {
    std::int64_t stamp_ns;
    std::size_t index;
  };
  std::vector<Tracked> tracked;
  Frame frame;
  for (std::size_t index = 0; calibrator.duration_s() < calibration::kLooksThrough_s && source.next(frame); ++index) {
    // an image that contradicts the gyro is the one that is asked
    const bool is_seen = (frame.status == FrameStatus::ok || frame.status == FrameStatus::doubtful) &&
                         frame.image.getWidth() == static_cast<unsigned>(camera.width) &&
                         frame.image.getHeight() == static_cast<unsigned>(camera.height);
    std::optional<RelativeMotion> motion;
    if (is_seen) {
      tracker.track(frame.image);
      tracked.push_back({frame.stamp_ns, index});
      int back = 1;
      while (back < std::min<int>(PointTracker::kHistory, static_cast<int>(tracked.size())) - 1 &&
             calibration::secondsOf(frame.stamp_ns - (tracked.rbegin() + back)->stamp_ns) < calibration::kBaseline_s)
        ++back;
      if (back < static_cast<int>(tracked.size())) {
        const Tracked &a = *(tracked.rbegin() + back);
        motion.emplace();
        motion->frames_back = back;
        motion->a_ns = a.stamp_ns;
        motion->b_ns = frame.stamp_ns;
        motion->a_index = a.index;
        motion->b_index = index;
        motion->points = motion->estimate = estimateRelativePose(tracker.matches(back), camera);
      }
    }
    if (!use_gyro)
      frame.gyro.clear();
    if (!use_odometry)
      frame.wMb_odometry.reset();
    calibrator.add(frame, motion);
  }
  return calibrator.estimate();
}
} // namespace bole
