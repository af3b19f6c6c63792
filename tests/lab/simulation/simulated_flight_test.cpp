// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "simulation/simulated_flight.h"
#include "support/units.h"
#include <bole/open_source.h>

namespace fs = std::filesystem;

using namespace bole;

namespace
{
std::map<std::string, std::string> tree(const fs::path &folder)
{
  std::map<std::string, std::string> files;
  for (const auto &entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file())
      files[fs::relative(entry.path(), folder).string()] = test::textOf(entry.path());
  }
  return files;
}

class SimulatedFlight : public testing::Test
{
protected:
  const test::TemporaryFolder m_temporary;
  const fs::path m_folder = m_temporary.path();
};

TEST_F(SimulatedFlight, SameSceneSameBytes)
{
  SceneOptions scene;
  scene.setSeed(11);
  scene.h264_kbps = 800;
  scene.forest.light = Light::sun;
  for (const char *name : {"a", "b"})
    recordFlight(scene, {(m_folder / name).string(), 3, true, false});
  EXPECT_TRUE(tree(m_folder / "a") == tree(m_folder / "b"));
  EXPECT_EQ(tree(m_folder / "a").count("depth/0000200000000.png"), 1u);
  scene.setSeed(12);
  recordFlight(scene, {(m_folder / "c").string(), 3, false, false});
  EXPECT_NE(test::textOf(m_folder / "a/mav0/cam0/data/0000000000000.png"),
            test::textOf(m_folder / "c/mav0/cam0/data/0000000000000.png"));
}

TEST_F(SimulatedFlight, ItsCameraFileIsReadForEveryLens)
{
  for (const Distortion distortion :
       {Distortion::none, Distortion::radial_tangential, Distortion::equidistant, Distortion::fov}) {
    SceneOptions scene;
    scene.renderer.camera.distortion = distortion;
    scene.renderer.camera.coefficients = {{0.1, 0, 0, 0}};
    if (distortion == Distortion::none)
      scene.renderer.camera.coefficients = {{0, 0, 0, 0}};
    recordFlight(scene, {(m_folder / "flight").string(), 1, false, true});
    const CameraModel read = readCamera((m_folder / "flight/mav0/cam0/sensor.yaml").string()).model;
    EXPECT_EQ(read.distortion, distortion);
    EXPECT_EQ(read.coefficients, scene.renderer.camera.coefficients);
  }
}

TEST_F(SimulatedFlight, DoesNotReplaceAFolderUnasked)
{
  SceneOptions scene;
  fs::create_directories(m_folder / "a");
  EXPECT_THROW(recordFlight(scene, {(m_folder / "a").string(), 1, false, false}), vpException);
  recordFlight(scene, {(m_folder / "a").string(), 1, false, true});
  EXPECT_FALSE(fs::exists(m_folder / "a.partial"));
  EXPECT_TRUE(fs::exists(m_folder / "a/trees.csv"));
}

TEST_F(SimulatedFlight, TreesAreToldAtBreastHeight)
{
  SceneOptions scene;
  scene.trunks.resize(1);
  scene.trunks[0].foot = {4, 3, 0};
  scene.trunks[0].lean = {0.2, -0.1};
  recordFlight(scene, {(m_folder / "a").string(), 1, false, false});
  const std::vector<TruthTrunk> trees = readTruthTrunks((m_folder / "a").string());
  ASSERT_FALSE(trees.empty());
  EXPECT_NEAR(trees[0].xy.x(), 4 + 0.2 * 1.3, 1e-4);
  EXPECT_NEAR(trees[0].xy.y(), 3 - 0.1 * 1.3, 1e-4);
}

TEST_F(SimulatedFlight, SceneFileGivesBackTheScene)
{
  SceneOptions scene;
  scene.setSeed(5);
  scene.forest.bark = Bark::mixed;
  scene.flight.kind = PathKind::slalom;
  scene.renderer.camera.distortion = Distortion::fov;
  scene.renderer.camera.coefficients = {{0.272, 0, 0, 0}};
  scene.trunks.resize(1);
  scene.trunks[0].foot.x() = 3.25;
  std::ofstream(m_folder / "scene.yaml") << sceneText(scene);
  EXPECT_EQ(sceneText(readScene((m_folder / "scene.yaml").string())), sceneText(scene));
}

TEST_F(SimulatedFlight, FaultsOfASceneFileNameTheLine)
{
  const std::map<std::string, std::string> faults{
      {"forest:\n  density: many\n", "scene.yaml:2: density = many, must be a number"},
      {"forest:\n  densty: 1\n", "scene.yaml:2: densty, must be a key of the section forest"},
      {"forst:\n  density: 1\n", "scene.yaml:1: forst, must be one of the sections"},
      {"forest:\n  light: dusk\n", "scene.yaml:2: light = dusk, must be one of sun, overcast"},
      {"forest:\n  density: 9\n", "density = 9, must be in [0, 0.3]"},
      {"forest:\n  density: .nan\n", "density"},
      {"forest: [\n", "scene.yaml:"},
      {"- 1\n", "scene.yaml:1: a scene must be a mapping"},
  };
  for (const auto &[text, message] : faults) {
    const std::string path = m_temporary.write("scene.yaml", text);
    EXPECT_REFUSED(message, readScene(path)) << text;
  }
}

TEST(FlightPath, ThrustExplainsTheAccelerationWithoutWobble)
{
  FlightOptions options;
  options.wobble_deg = 0;
  for (PathKind kind : {PathKind::forward, PathKind::lateral, PathKind::loop, PathKind::slalom}) {
    options.kind = kind;
    const FlightPath path(options);
    for (double t = 0; t < 5; t += 0.7) {
      const Eigen::Vector3d force =
          path.bodyPose(t).R.transpose() * (path.acceleration(t) + Eigen::Vector3d(0, 0, 9.81));
      EXPECT_NEAR(force.x(), 0, 1e-6) << toString(kind);
      EXPECT_NEAR(force.y(), 0, 1e-6) << toString(kind);
      EXPECT_GT(force.z(), 5) << toString(kind);
    }
  }
}

TEST(FlightPath, IsContinuousAndItsRateIsTheDerivative)
{
  FlightOptions options;
  options.kind = PathKind::slalom;
  const FlightPath path(options);
  for (double t = 0; t < 5; t += 0.31) {
    const Pose a = path.bodyPose(t), b = path.bodyPose(t + 0.01);
    EXPECT_LT((b.t - a.t).norm(), 0.05);
    const Eigen::Vector3d mean = 0.5 * (path.bodyRate(t) + path.bodyRate(t + 0.01));
    EXPECT_LT((logSo3(a.R.transpose() * b.R) / 0.01 - mean).norm(), 0.01);
  }
}

TEST(FlightPath, LoopEndsWhereItBegan)
{
  FlightOptions options;
  options.kind = PathKind::loop;
  options.duration = 40;
  for (const double laps : {1.0, 2.0}) {
    options.laps = laps;
    const FlightPath path(options);
    EXPECT_LT((path.position(40 / laps) - path.position(0)).head<2>().norm(), 1e-9);
    EXPECT_GT((path.position(20 / laps) - path.position(0)).head<2>().norm(), 5);
  }
}

TEST(SimulatedImu, FeelsGravityAtRestAndTurnsWithTheBody)
{
  SensorOptions options;
  options.gyro_bias = options.gyro_noise = options.accelerometer_bias = options.accelerometer_noise = 0;
  SimulatedImu imu(options);
  const GyroSample sample = imu.measure(0, expSo3({0.1, 0, 0}), {0.2, 0, -0.3}, Eigen::Vector3d::Zero());
  EXPECT_EQ(sample.rate, Eigen::Vector3d(0.2, 0, -0.3));
  EXPECT_NEAR(sample.force->y(), 9.81 * std::sin(0.1), 1e-12);
  EXPECT_NEAR(sample.force->z(), 9.81 * std::cos(0.1), 1e-12);
}

TEST(SimulatedImu, HasAConstantBiasAsItsOptionsSay)
{
  SensorOptions options;
  options.gyro_noise = options.accelerometer_noise = 0;
  constexpr int kRuns = 400;
  double squares = 0;
  for (int run = 0; run < kRuns; ++run) {
    options.seed = 100 + run;
    SimulatedImu imu(options);
    const Eigen::Vector3d bias = *imu.measure(0, Eigen::Matrix3d::Identity(), {0, 0, 0}, {0, 0, -9.81}).force;
    EXPECT_EQ(*imu.measure(0, Eigen::Matrix3d::Identity(), {0, 0, 0}, {0, 0, -9.81}).force, bias);
    squares += bias.squaredNorm() / 3;
  }
  EXPECT_NEAR(std::sqrt(squares / kRuns), options.accelerometer_bias, 0.1 * options.accelerometer_bias);
}

TEST(PoseFilter, DriftsAsItsOptionsSayAtAnyRate)
{
  for (const int frames : {50, 100, 300}) { // in ten seconds
    SensorOptions options;
    double squares = 0, yaw_squares = 0, height_squares = 0;
    constexpr int kRuns = 200;
    for (int run = 0; run < kRuns; ++run) {
      options.seed = 100 + run;
      options.odometry_scale = 0;
      PoseFilter filter(options);
      Pose report;
      for (int k = 0; k <= frames; ++k)
        report = filter.report(k * (10'000'000'000 / frames), Pose());
      squares += report.t.x() * report.t.x();
      height_squares += report.t.z() * report.t.z();
      const double yaw = std::atan2(report.R(1, 0), report.R(0, 0));
      yaw_squares += yaw * yaw;
    }
    EXPECT_NEAR(std::sqrt(squares / kRuns), options.odometry_step_noise * 10, 0.02);
    EXPECT_NEAR(std::sqrt(height_squares / kRuns), options.height_noise, 0.004);
    EXPECT_NEAR(std::sqrt(yaw_squares / kRuns), options.yaw_walk * 10, 0.006);
  }
}
} // namespace
