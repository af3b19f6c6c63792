// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/made_flight.h"
#include "motion/synthetic.h"
#include "support/test.h"

#include "motion/camera_gyro.h"
#include "motion/gyro.h"
#include "motion/sensor_calibration.h"

using namespace bole;

namespace
{
using Eigen::Matrix3d;
using Eigen::Vector3d;
using test::late;
using test::MadeFlight;
using test::noisyFlight;
using test::rates;

/// Eight seconds, the stamps of the sensors late by these times; \p damage changes a frame before it is looked at, \p
/// look the rotation that points saw, in the axes of the camera.
SensorCalibration fly(
    MadeFlight flight, const std::function<void(Frame &)> &damage = [](Frame &) {}, double gyro_late_s = 0,
    double odometry_late_s = 0, const std::function<Matrix3d(const Matrix3d &)> &look = nullptr)
{
  std::vector<Frame> frames;
  std::vector<RelativeMotion> motions;
  const std::int64_t gyro_late_ns = nsOf(gyro_late_s);
  std::mt19937 random(3);
  std::normal_distribution<double> turn(0, 0.003);
  std::vector<GyroSample> waiting;
  for (std::size_t i = 0; i < 80; ++i) {
    Frame frame = flight.frame(i);
    const double t = 0.1 * static_cast<double>(i) - odometry_late_s;
    frame.wMb_odometry->R = flight.truth(t).R * expSo3({turn(random), turn(random), turn(random)});
    damage(frame);
    for (GyroSample sample : frame.gyro) {
      sample.stamp_ns += gyro_late_ns;
      waiting.push_back(sample);
    }
    frame.gyro.clear();
    while (!waiting.empty() && waiting.front().stamp_ns <= frame.stamp_ns) {
      frame.gyro.push_back(waiting.front());
      waiting.erase(waiting.begin());
    }
    std::vector<RelativeMotion> seen = flight.seen(i);
    for (RelativeMotion &motion : seen)
      if (look)
        motion.points.aRb = look(motion.points.aRb) * expSo3({turn(random) / 5, turn(random) / 5, turn(random) / 5});
    motions.insert(motions.end(), seen.begin(), seen.end());
    frames.push_back(std::move(frame));
  }
  return calibrate(frames, motions, forwardCamera());
}

const CalibratedConstant *constant(const SensorCalibration &calibration, const std::string &name)
{
  for (const CalibratedConstant &one : calibration.constants)
    if (one.name == name)
      return &one;
  return nullptr;
}

void expectAsStated(const SensorCalibration &calibration)
{
  for (const SensorVerdict &verdict : calibration.verdicts)
    EXPECT_EQ(verdict.kind, "rotation") << verdict.text;
  for (const CalibratedConstant &one : calibration.constants)
    EXPECT_FALSE(one.used) << one.text;
  EXPECT_EQ(calibration.gyro_late_s, 0);
  EXPECT_EQ(calibration.odometry_late_s, 0);
  EXPECT_EQ(calibration.gyro_bias, Vector3d(0, 0, 0));
  EXPECT_EQ(calibration.bRo, Matrix3d(Matrix3d::Identity()));
  EXPECT_EQ(calibration.odometry_scale, 1);
  EXPECT_EQ(calibration.force_bias, Vector3d(0, 0, 0));
}

} // namespace

TEST(SensorCalibration, SensorsInOrderAreReadAsStated)
{
  expectAsStated(fly(MadeFlight()));
  const SensorCalibration calibration = fly(noisyFlight());
  expectAsStated(calibration);
  EXPECT_TRUE(constant(calibration, "gyro_bias"));
  EXPECT_TRUE(constant(calibration, "gyro_late_s"));
  EXPECT_TRUE(constant(calibration, "odometry_scale"));
}

TEST(SensorCalibration, ABiasOfTheGyroIsFoundWithItsSigma)
{
  for (const Vector3d &bias : {Vector3d(0, 0, 0.05), Vector3d(0.1, -0.05, 0.02)}) {
    const SensorCalibration calibration = fly(noisyFlight(), rates([&](Vector3d &w) { w += bias; }));
    const CalibratedConstant *found = constant(calibration, "gyro_bias");
    ASSERT_TRUE(found && found->used);
    EXPECT_LT((calibration.gyro_bias - bias).norm(), 3 * std::sqrt(3.0) * found->sigma + 1e-3);
    EXPECT_LT(found->sigma, 0.01);
  }
}

TEST(SensorCalibration, ALateGyroIsFoundToAFewMilliseconds)
{
  for (const double late_s : {-0.1, -0.03, 0.03, 0.1}) {
    const SensorCalibration calibration = fly(
        noisyFlight(), [](Frame &) {}, late_s);
    EXPECT_NEAR(calibration.gyro_late_s, late_s, 0.006);
    EXPECT_EQ(calibration.odometry_late_s, 0) << late_s;
  }
}

TEST(SensorCalibration, GyroAndOdometryThatAreLateTogetherAreBothFound)
{
  for (const double late_s : {0.06, 0.1}) { // less is less than what such an odometry shows
    const SensorCalibration calibration = fly(
        noisyFlight(), [](Frame &) {}, late_s, late_s);
    EXPECT_NEAR(calibration.gyro_late_s, late_s, 0.006);
    EXPECT_NEAR(calibration.odometry_late_s, late_s, 0.012);
  }
}

TEST(SensorCalibration, AScaleFarFromOneIsTakenOver)
{
  for (const double factor : {0.75, 1.15, 1.3}) {
    MadeFlight flight = noisyFlight();
    flight.factor = factor;
    const SensorCalibration calibration = fly(flight);
    EXPECT_NEAR(std::log(calibration.odometry_scale), std::log(factor), 0.06) << factor;
    EXPECT_GT(calibration.odometry_scale_sigma, 0) << factor;
  }
}

TEST(SensorCalibration, ATurnedBodyOfTheOdometryIsFound)
{
  for (const Vector3d &turned : {Vector3d(0.17, 0, 0), Vector3d(0, 0.17, 0), Vector3d(0, 0, -0.17)}) {
    const SensorCalibration calibration =
        fly(noisyFlight(), [&](Frame &f) { f.wMb_odometry->R = f.wMb_odometry->R * expSo3(turned); });
    EXPECT_LT((logSo3(calibration.bRo) - turned).norm(), 0.02) << turned.transpose();
    EXPECT_EQ(calibration.force_bias, Vector3d(0, 0, 0)) << turned.transpose();
    EXPECT_GT(calibration.odometry_rotation_sigma, 0) << turned.transpose();
  }
}

TEST(SensorCalibration, AnAccelerometerThatIsOffIsFoundAndTheOdometryStaysAsStated)
{
  for (const Vector3d &bias : {Vector3d(1, 0.5, 0), Vector3d(0, -1.2, 0), Vector3d(0, 0, 1), Vector3d(-2, 0, 0)}) {
    MadeFlight flight = noisyFlight();
    flight.force_bias = bias;
    const SensorCalibration calibration = fly(flight);
    const CalibratedConstant *found = constant(calibration, "accelerometer_bias");
    ASSERT_TRUE(found && found->used) << bias.transpose();
    EXPECT_LT((calibration.force_bias - bias).norm(), 3 * std::sqrt(3.0) * found->sigma) << bias.transpose();
    EXPECT_LT(found->sigma, 0.25) << bias.transpose();
    EXPECT_EQ(calibration.bRo, Matrix3d(Matrix3d::Identity())) << bias.transpose();
    EXPECT_TRUE(calibration.verdicts.empty()) << calibration.verdicts.front().text;
  }
}

TEST(SensorCalibration, ATurnedOdometryAndAnAccelerometerThatIsOffAreToldApart)
{
  const Vector3d turned(0, 0.17, 0), bias(0, 1.2, 0);
  MadeFlight flight = noisyFlight();
  flight.force_bias = bias;
  const SensorCalibration calibration =
      fly(flight, [&](Frame &f) { f.wMb_odometry->R = f.wMb_odometry->R * expSo3(turned); });
  EXPECT_LT((logSo3(calibration.bRo) - turned).norm(), 0.03);
  EXPECT_LT((calibration.force_bias - bias).norm(), 0.4);
  EXPECT_TRUE(calibration.verdicts.empty()) << calibration.verdicts.front().text;
}

TEST(SensorCalibration, AnOdometryInTheAxesOfTheCameraIsNotTheAccelerometersFault)
{
  const Matrix3d A = forwardCamera().R.transpose();
  const SensorCalibration calibration = fly(noisyFlight(), [&](Frame &f) {
    *f.wMb_odometry = {A * f.wMb_odometry->R * A.transpose(), A * f.wMb_odometry->t};
  });
  EXPECT_EQ(calibration.force_bias, Vector3d(0, 0, 0));
  ASSERT_FALSE(calibration.verdicts.empty());
  EXPECT_EQ(calibration.verdicts[0].sensor, "odometry") << calibration.verdicts[0].text;
}

TEST(SensorCalibration, WhatBeginsLaterIsNoConstant)
{
  expectAsStated(fly(noisyFlight(), late(rates([](Vector3d &w) { w.z() += 0.05; }))));
  expectAsStated(fly(noisyFlight(), late(rates([](Vector3d &w) { w.setZero(); }))));
}

TEST(SensorCalibration, ACameraFileOfAnotherFocalLengthIsNamed)
{
  for (const double factor : {0.5, 0.8, 0.95, 1.05, 1.2, 2.0}) { // of the file's focal length over the true one
    const auto look = [&](const Matrix3d &aRb) {
      const Vector3d angle = logSo3(aRb);
      return expSo3({angle.x() / factor, angle.y() / factor, angle.z()});
    };
    const SensorCalibration calibration = fly(
        noisyFlight(), [](Frame &) {}, 0, 0, look);
    ASSERT_EQ(calibration.verdicts.size(), 1u) << factor;
    EXPECT_EQ(calibration.verdicts[0].sensor, "images") << factor;
    EXPECT_EQ(calibration.verdicts[0].kind, "focal") << calibration.verdicts[0].text;
    const double told = std::stod(calibration.verdicts[0].text.substr(calibration.verdicts[0].text.find("by ") + 3));
    EXPECT_NEAR(std::log(1 + told / 100), std::log(factor), 0.03) << calibration.verdicts[0].text;
  }
}

TEST(SensorCalibration, ACameraThatStandsOtherwiseOnTheBodyIsNamed)
{
  for (const Vector3d &turned : {Vector3d(0.17, 0, 0), Vector3d(0, 0.17, 0), Vector3d(0, 0, -0.17)}) {
    const Matrix3d R = expSo3(turned);
    const SensorCalibration calibration = fly(
        noisyFlight(), [](Frame &) {}, 0, 0, [&](const Matrix3d &aRb) { return Matrix3d(R.transpose() * aRb * R); });
    ASSERT_EQ(calibration.verdicts.size(), 1u);
    EXPECT_EQ(calibration.verdicts[0].kind, "mount") << calibration.verdicts[0].text;
    EXPECT_NE(calibration.verdicts[0].text.find("9."), std::string::npos) << calibration.verdicts[0].text;
  }
}

TEST(SensorCalibration, AScaleOfTheGyroIsNamedAndNoCameraBlamed)
{
  for (const double factor : {0.8, 1.1, 1.3}) {
    const SensorCalibration calibration = fly(noisyFlight(), rates([&](Vector3d &w) { w *= factor; }));
    ASSERT_EQ(calibration.verdicts.size(), 1u) << factor;
    EXPECT_EQ(calibration.verdicts[0].sensor, "gyro") << factor;
    EXPECT_EQ(calibration.verdicts[0].kind, "scale") << calibration.verdicts[0].text;
  }
}

TEST(SensorCalibration, CameraAndGyroWithinWhatTheyAreStatedToAreNotNamed)
{
  const Matrix3d R = expSo3({0.012, -0.012, 0.012});
  const SensorCalibration calibration =
      fly(noisyFlight(), rates([](Vector3d &w) { w *= 1.01; }), 0, 0, [&](const Matrix3d &aRb) {
        const Vector3d angle = logSo3(R.transpose() * aRb * R);
        return expSo3({angle.x() / 1.01, angle.y() / 1.01, angle.z()});
      });
  EXPECT_TRUE(calibration.verdicts.empty());
}

TEST(SensorCalibration, AxesThatAreExchangedAreNoConstant)
{
  expectAsStated(fly(noisyFlight(), rates([](Vector3d &w) { w.z() *= -1; })));
}

namespace
{
std::vector<GyroSample> samplesOf(const Eigen::Vector3d &rate, double noise, std::int64_t end_ns, unsigned seed = 3)
{
  std::mt19937 random(seed);
  std::normal_distribution<double> normal(0, noise);
  std::vector<GyroSample> samples;
  for (std::int64_t stamp = 0; stamp <= end_ns; stamp += 5000000)
    samples.push_back({stamp, rate + Eigen::Vector3d(normal(random), normal(random), normal(random))});
  return samples;
}

/// What is found of a lens with the distortion \p k1 that nothing tells.
std::optional<double> foundDistortion(double k1, const Pose &aMb = test::typicalMotion())
{
  const PinholeCamera camera;
  std::vector<std::vector<PointMatch>> pairs;
  for (unsigned seed = 0; seed < 12; ++seed) {
    test::CloudOptions cloud;
    cloud.noise_px = 0.1;
    cloud.outliers = 0.1;
    cloud.seed = seed;
    pairs.push_back(test::cloudMatches(camera, aMb, cloud));
    for (PointMatch &match : pairs.back())
      for (Eigen::Vector2d *px : {&match.a_px, &match.b_px}) {
        const Eigen::Vector2d straight = camera.ray(*px).head<2>();
        *px = camera.project(Eigen::Vector2d(straight * (1 + k1 * straight.squaredNorm())).homogeneous());
      }
  }
  return calibration::findDistortion(pairs, camera);
}

TEST(Lens, ADistortionThatNothingTellsIsFoundAndNoneWhereThereIsNone)
{
  for (const double k1 : {-0.25, 0.2}) {
    const auto found = foundDistortion(k1);
    ASSERT_TRUE(found) << k1;
    EXPECT_NEAR(*found, k1, 0.05);
  }
  EXPECT_FALSE(foundDistortion(0));
  EXPECT_FALSE(foundDistortion(0.01));
}

TEST(Lens, ACameraThatStandsStillTellsNothingOfIt) { EXPECT_FALSE(foundDistortion(-0.25, Pose())); }

TEST(Gyro, AConstantRateIntegratesToItsExponential)
{
  const Eigen::Vector3d rate(0.3, -0.5, 1.0);
  const auto turned = integrateGyro(samplesOf(rate, 0, 200000000), 12000000, 112000000);
  EXPECT_LT(logSo3(turned.R.transpose() * expSo3(0.1 * rate)).norm(), 1e-12);
  EXPECT_TRUE(turned.complete);
}

TEST(Gyro, AdjoiningIntervalsMultiply)
{
  const auto samples = samplesOf({0.3, -0.5, 1.0}, 0.1, 300000000);
  const auto first = integrateGyro(samples, 0, 105000000), second = integrateGyro(samples, 105000000, 290000000);
  const auto both = integrateGyro(samples, 0, 290000000), joined = first.then(second);
  EXPECT_LT(logSo3(joined.R.transpose() * both.R).norm(), 1e-9);
  EXPECT_NEAR(joined.duration, both.duration, 1e-12);
  EXPECT_NEAR(joined.white(0, 0), both.white(0, 0), 1e-12);
}

TEST(Gyro, AGapIsNotBridgedAsKnown)
{
  auto samples = samplesOf({0.3, -0.5, 1.0}, 0, 1000000000);
  const auto whole = integrateGyro(samples, 0, 1000000000);
  samples.erase(samples.begin() + 40, samples.begin() + 160);
  const auto torn = integrateGyro(samples, 0, 1000000000);
  EXPECT_TRUE(whole.complete);
  EXPECT_FALSE(torn.complete);
  EXPECT_GT(torn.white(0, 0), 1e3 * whole.white(0, 0));
  EXPECT_FALSE(integrateGyro({}, 0, 1000000000).complete);
}

TEST(Gyro, TurnsThatAreLookedUpAreThoseThatAreIntegrated)
{
  std::vector<GyroSample> samples;
  for (int i = 0; i <= 200; ++i)
    if (i < 100 || i > 130) // a gap of 0.15 s
      samples.push_back({i * 5000000LL, {std::sin(0.01 * i), std::cos(0.007 * i), 0.3}});
  const GyroTurns turns(samples);
  for (std::int64_t from_ns = -200000000; from_ns < 1200000000; from_ns += 7300000)
    for (const std::int64_t duration_ns : {2000000LL, 33000000LL, 150000000LL, 400000000LL}) {
      const std::optional<Eigen::Matrix3d> looked_up = turns.between(from_ns, from_ns + duration_ns),
                                           integrated = turnBetween(samples, from_ns, from_ns + duration_ns);
      ASSERT_EQ(looked_up.has_value(), integrated.has_value()) << from_ns << " " << duration_ns;
      if (integrated) {
        EXPECT_LT(logSo3(looked_up->transpose() * *integrated).norm(), 1e-3) // [rad]: rates of the gap do not commute
            << from_ns << " " << duration_ns;
      }
    }
  EXPECT_FALSE(GyroTurns({}).between(0, 10000000));
}

TEST(Gyro, TheGyrosOwnRotationTeachesNothing)
{
  GyroBias bias = GyroBias::unknown({});
  bias.mean = {0.01, 0, -0.01};
  const auto turned = integrateGyro(samplesOf({0.1, 0.2, 0.3}, 0, 100000000), 0, 100000000, bias);
  const GyroBias after = refineBias(bias, turned, turned.R, turned.covariance());
  EXPECT_LT((after.mean - bias.mean).norm(), 1e-12);
  EXPECT_GE(after.covariance(0, 0), bias.covariance(0, 0));
}

TEST(Gyro, RotationsBetterThanTheGyroGiveItsBiasBack)
{
  const GyroOptions options;
  const Eigen::Vector3d rate(0.1, -0.2, 0.4), truth(0.009, -0.006, 0.003);
  const auto samples = samplesOf(rate + truth, options.noise_density / std::sqrt(0.005), 5000000000);
  GyroBias bias = GyroBias::unknown(options);
  const double sigma = 3e-4;
  std::mt19937 random(5);
  std::normal_distribution<double> normal(0, sigma);
  for (int i = 0; i < 16; ++i) {
    const std::int64_t from = i * 300000000LL;
    const auto prior = integrateGyro(samples, from, from + 300000000, bias, options);
    // Fuse the prior with an independent rotation, as the estimator does.
    const Eigen::Matrix3d seen = expSo3(0.3 * rate) * expSo3({normal(random), normal(random), normal(random)});
    const Eigen::Matrix3d S = prior.covariance(),
                          gain = S * (S + sigma * sigma * Eigen::Matrix3d::Identity()).inverse();
    const Eigen::Matrix3d fused = prior.R * expSo3(gain * logSo3(prior.R.transpose() * seen));
    bias = refineBias(bias, prior, fused, S - gain * S);
  }
  const Eigen::Vector3d error = bias.mean - truth;
  EXPECT_LT(error.norm(), 0.002);
  EXPECT_LT(error.dot(bias.covariance.inverse() * error), 16);
}
} // namespace
