// SPDX-License-Identifier: GPL-2.0-or-later
#include "simulation/simulated_flight.h"

#include "support/text.h"

#include <cmath>

namespace bole
{
namespace
{
constexpr std::int64_t kImuPeriodNs = 5000000;

FlightPath pathOf(const SceneOptions &scene, int frames)
{
  scene.validate();
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

SceneFrames::SceneFrames(const SceneOptions &scene, int frames)
    : m_scene(scene),
      m_path(pathOf(scene, frames)),
      m_forest(forestOf(scene, m_path)),
      m_renderer(m_forest, scene.renderer),
      m_filter(scene.sensors),
      m_imu(scene.sensors)
{
  const PinholeCamera &camera = scene.renderer.camera.pinhole;
  if (scene.h264_kbps > 0)
    m_link.emplace(camera.width, camera.height, scene.rate_hz, scene.h264_kbps);
}

void SceneFrames::next(Frame &frame, RenderedFrame &rendered, bool truth_images)
{
  frame = Frame();
  frame.index = m_index;
  frame.stamp_ns = std::llround(static_cast<double>(m_index++) * 1e9 / m_scene.rate_hz);
  const double t = 1e-9 * static_cast<double>(frame.stamp_ns), half = 0.5e-3 * m_scene.exposure_ms;
  const Pose bMc = forwardCamera();
  m_renderer.render(m_path.bodyPose(t - half) * bMc, m_path.bodyPose(t + half) * bMc, rendered, truth_images);
  if (m_link)
    m_link->pass(rendered.image);
  frame.image = rendered.image;
  frame.wMb_truth = m_path.bodyPose(t);
  frame.wMb_odometry = m_filter.report(frame.stamp_ns, *frame.wMb_truth);
  for (; m_imu_stamp_ns <= frame.stamp_ns; m_imu_stamp_ns += kImuPeriodNs) {
    const double s = 1e-9 * static_cast<double>(m_imu_stamp_ns);
    frame.gyro.push_back(
        m_imu.measure(m_imu_stamp_ns, m_path.bodyPose(s).R, m_path.bodyRate(s), m_path.acceleration(s)));
  }
}

void recordFlight(const SceneOptions &scene, const RecordOptions &options, const std::function<void(int)> &progress)
{
  scene.validate();
  SequenceWriter writer(options.folder, scene.renderer.camera, forwardCamera(), scene.rate_hz, options.overwrite);
  SceneFrames frames(scene, options.frames);
  writer.writeForest(frames.forest());
  writer.writeText("scene.yaml", sceneText(scene));
  Frame frame;
  RenderedFrame rendered;
  for (int k = 0; k < options.frames; ++k) {
    frames.next(frame, rendered, options.truth_images);
    for (const GyroSample &sample : frame.gyro)
      writer.writeImu(sample);
    writer.writeFrame(frame.stamp_ns, rendered, *frame.wMb_truth, *frame.wMb_odometry);
    if (progress)
      progress(k + 1);
  }
  writer.finish();
}
} // namespace bole
