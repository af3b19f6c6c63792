// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"

#include "support/h264.h"
#include "support/text.h"
#include "support/units.h"

#include <cmath>
#include <optional>

namespace bole
{
namespace
{
constexpr std::int64_t kImuPeriodNs = 5000000;

FlightPath pathOf(const SceneOptions &scene, int frames)
{
  requireRange("frames", frames, 1, 100000);
  FlightOptions flight = scene.flight;
  flight.duration = (frames - 1) / scene.rate_hz;
  return FlightPath(flight);
}

Forest forestOf(const SceneOptions &scene, const FlightPath &path)
{
  std::vector<SimulatedTrunk> wanted = scene.trunks;
  const std::vector<SimulatedTrunk> gates = path.gates();
  wanted.insert(wanted.end(), gates.begin(), gates.end());
  return Forest::plant(scene.forest, path.waypoints(), wanted);
}
} // namespace

void SceneOptions::setSeed(std::uint64_t seed)
{
  forest.seed = flight.seed = renderer.noise_seed = sensors.seed = seed;
}

void recordFlight(const SceneOptions &scene, const RecordOptions &options, const std::function<void(int)> &progress)
{
  scene.validate();
  const PinholeCamera &camera = scene.renderer.camera.pinhole;
  const Pose bMc = forwardCamera();
  SequenceWriter writer(options.folder, scene.renderer.camera, scene.rate_hz, options.overwrite);
  const FlightPath path = pathOf(scene, options.frames);
  const Forest forest = forestOf(scene, path);
  ForestRenderer renderer(forest, scene.renderer);
  PoseFilter filter(scene.sensors);
  SimulatedImu imu(scene.sensors);
  std::optional<H264Link> link;
  if (scene.h264_kbps > 0)
    link.emplace(camera.width, camera.height, scene.rate_hz, scene.h264_kbps);
  writer.writeForest(forest);
  writer.writeText("scene.yaml", sceneText(scene));
  RenderedFrame rendered;
  std::int64_t imu_ns = 0;
  for (int k = 0; k < options.frames; ++k) {
    const std::int64_t stamp_ns = std::llround(k * 1e9 / scene.rate_hz);
    const double t = secondsOf(stamp_ns), half = 0.5e-3 * scene.exposure_ms;
    renderer.render(path.bodyPose(t - half) * bMc, path.bodyPose(t + half) * bMc, rendered, options.truth_images);
    if (link)
      link->pass(rendered.image);
    for (; imu_ns <= stamp_ns; imu_ns += kImuPeriodNs) {
      const double s = secondsOf(imu_ns);
      writer.writeImu(imu.measure(imu_ns, path.bodyPose(s).R, path.bodyRate(s), path.acceleration(s)));
    }
    const Pose truth = path.bodyPose(t);
    writer.writeFrame(stamp_ns, rendered, truth, filter.report(stamp_ns, truth));
    if (progress)
      progress(k + 1);
  }
  writer.finish();
}
} // namespace bole
