// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/simulation/simulated_flight.h"

#include "geometry/require_range.h"

#include "lab/simulation/h264_link.h"
#include "lab/simulation/sequence_writer.h"

#include <cmath>
#include <fmt/format.h>
#include <optional>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{

void recordImu(const FlightPath &path, const SensorOptions &options, double duration, SequenceWriter &writer)
{
  constexpr std::int64_t kPeriodNs = 5000000;
  SimulatedImu imu(options);
  for (std::int64_t stamp = 0; stamp <= std::llround(duration * 1e9); stamp += kPeriodNs) {
    const double t = 1e-9 * static_cast<double>(stamp);
    writer.writeImu(stamp, imu.measure(path.bodyPose(t).R, path.bodyRate(t), path.acceleration(t)));
  }
}
} // namespace

void SceneOptions::setSeed(std::uint64_t seed)
{
  forest.seed = flight.seed = renderer.noise_seed = sensors.seed = seed;
}

void SceneOptions::validate() const
{
  forest.validate();
  flight.validate();
  renderer.validate();
  sensors.validate();
  requireRange("rate_hz", rate_hz, 1, 120);
  requireRange("exposure_ms", exposure_ms, 0, 100);
  requireRange("h264_kbps", h264_kbps, 0, 20000);
}

void recordFlight(const SceneOptions &scene, const RecordOptions &options, const std::function<void(int)> &progress)
{
  scene.validate();
  requireRange("frames", options.frames, 1, 100000);
  const Pose bMc = forwardCamera();
  SequenceWriter writer(options.folder, scene.renderer.camera, bMc, scene.rate_hz, options.overwrite);
  FlightOptions flight = scene.flight;
  flight.duration = (options.frames - 1) / scene.rate_hz;
  const FlightPath path(flight);
  std::vector<SimulatedTrunk> wanted = scene.trunks;
  const std::vector<SimulatedTrunk> gates = path.gates();
  wanted.insert(wanted.end(), gates.begin(), gates.end());
  const Forest forest = Forest::plant(scene.forest, path.waypoints(), wanted);
  writer.writeForest(forest);
  writer.writeText("scene.yaml", sceneText(scene));
  recordImu(path, scene.sensors, flight.duration, writer);

  ForestRenderer renderer(forest, scene.renderer);
  PoseFilter filter(scene.sensors);
  std::optional<H264Link> link;
  if (scene.h264_kbps > 0) {
    link.emplace(scene.renderer.camera.pinhole.width, scene.renderer.camera.pinhole.height, scene.rate_hz,
                 scene.h264_kbps);
  }
  RenderedFrame frame;
  const double half = 0.5e-3 * scene.exposure_ms;
  for (int k = 0; k < options.frames; ++k) {
    const std::int64_t stamp = std::llround(k * 1e9 / scene.rate_hz);
    const double t = 1e-9 * static_cast<double>(stamp);
    renderer.render(path.bodyPose(t - half) * bMc, path.bodyPose(t + half) * bMc, frame, options.truth_images);
    if (link) {
      link->pass(frame.image);
    }
    const Pose truth = path.bodyPose(t);
    writer.writeFrame(stamp, frame, truth, filter.report(truth));
    if (progress) {
      progress(k + 1);
    }
  }
  writer.finish();
}
} // namespace bole
