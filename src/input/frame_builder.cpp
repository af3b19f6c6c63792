// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/frame_builder.h"
#include "geometry/failure.h"
#include "input/camera_plausibility.h"
#include "input/frame_check.h"

#include <cmath>
#include <fmt/format.h>

namespace bole
{
Recording corrected(Recording recording, const SensorCalibration &calibration)
{
  const auto gyro_late_ns = static_cast<std::int64_t>(std::llround(calibration.gyro_late_s * 1e9));
  const auto odometry_late_ns = static_cast<std::int64_t>(std::llround(calibration.odometry_late_s * 1e9));
  for (GyroSample &sample : recording.gyro) {
    sample.stamp_ns -= gyro_late_ns;
    sample.rate -= calibration.gyro_bias;
    if (sample.force)
      *sample.force -= calibration.force_bias;
  }
  const bool is_scaled = calibration.odometry_scale != 1, is_turned = !calibration.bRo.isIdentity(0);
  const Eigen::Vector2d first =
      recording.odometry.empty() ? Eigen::Vector2d(0, 0) : Eigen::Vector2d(recording.odometry.front().wMb.t.head<2>());
  for (StampedPose &pose : recording.odometry) { // what is as stated keeps its bits
    pose.stamp_ns -= odometry_late_ns;
    if (is_turned)
      pose.wMb.R = pose.wMb.R * calibration.bRo.transpose();
    if (is_scaled)
      pose.wMb.t.head<2>() = first + (pose.wMb.t.head<2>() - first) / calibration.odometry_scale;
  }
  return recording;
}

namespace
{
/// A log that begins a hair after the first picture, by its own clock or by the correction of it, begins with it: the
/// first picture decides what is measured by what.
Trajectory withFirstPicture(Trajectory odometry, std::int64_t stamp_ns)
{
  constexpr std::int64_t kLongest_ns = 150'000'000; // the body goes on as it went: a frame and a half at 10 Hz
  if (odometry.size() < 2 || odometry.front().stamp_ns <= stamp_ns ||
      odometry.front().stamp_ns - stamp_ns > kLongest_ns)
    return odometry;
  const StampedPose &a = odometry[0], &b = odometry[1];
  const double part = static_cast<double>(stamp_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  odometry.insert(odometry.begin(), {stamp_ns, a.wMb.plus(part * b.wMb.minus(a.wMb))});
  return odometry;
}
} // namespace

FrameBuilder::FrameBuilder(const MountedCamera &camera, const SourceOptions &options, Recording recording)
    : m_lens(camera.model),
      m_rectifier(camera.model, options.max_width_px),
      m_bMc(camera.bMc),
      m_recording(corrected(std::move(recording), options.calibration)),
      m_judge(camera.model.pinhole, camera.bMc)
{
}

void FrameBuilder::build(std::int64_t stamp_ns, ImageFile file, Frame &frame)
{
  frame = Frame();
  frame.stamp_ns = stamp_ns;
  frame.index = m_index++;
  frame.status = file.status;
  frame.message = std::move(file.message);
  frame.image = std::move(file.image);
  if (frame.index == 0)
    m_recording.odometry = withFirstPicture(std::move(m_recording.odometry), stamp_ns);
  frame.wMb_odometry = interpolate(m_recording.odometry, stamp_ns);
  frame.wMb_truth = interpolate(m_recording.truth, stamp_ns);

  const auto &gyro = m_recording.gyro;
  for (; m_gyro_at < gyro.size() && gyro[m_gyro_at].stamp_ns <= stamp_ns; ++m_gyro_at)
    if (m_last_stamp_ns && gyro[m_gyro_at].stamp_ns > *m_last_stamp_ns)
      frame.gyro.push_back(gyro[m_gyro_at]);
  m_last_stamp_ns = stamp_ns;
  complete(frame);
}

void FrameBuilder::complete(Frame &frame)
{
  judgePicture(frame, m_rectifier.inputWidth(), m_rectifier.inputHeight());
  m_judge.judge(frame);
  if (frame.image.getSize() > 0)
    m_rectifier.apply(frame.image);
}

Trajectory readOdometry(const SourceOptions &options)
{
  if (options.odometry_path.empty())
    return {};
  Trajectory odometry = readTrajectory(options.odometry_path);
  for (StampedPose &pose : odometry)
    pose.stamp_ns += std::llround(options.odometry_offset_s * 1e9);
  return odometry;
}

void requireOverlap(const Trajectory &odometry, std::int64_t first_ns, std::int64_t last_ns,
                    const std::string &odometry_path, const std::string &source)
{
  if (odometry.empty() || (odometry.front().stamp_ns <= last_ns && odometry.back().stamp_ns >= first_ns))
    return;
  throw badValue("{}: its stamps {:.3f} to {:.3f} s never meet those of {}, {:.3f} to {:.3f} s (odometry_offset_s, "
                 "--odometry-offset, shifts them)",
                 odometry_path, odometry.front().stamp_ns * 1e-9, odometry.back().stamp_ns * 1e-9, source,
                 first_ns * 1e-9, last_ns * 1e-9);
}

MountedCamera cameraFor(const SourceOptions &options, int width, int height, std::string &note, double pixel_aspect)
{
  if (options.camera_path.empty()) {
    constexpr double kUsual_deg = 65;
    const double view_deg = options.field_of_view_deg.value_or(kUsual_deg);
    const double f = 0.5 * width / std::tan(0.5 * view_deg * M_PI / 180);
    note = fmt::format("no camera file: assuming a field of view of {:g} degrees (f = {:.0f} px)", view_deg, f);
    if (std::abs(pixel_aspect - 1) > 1e-3)
      note += fmt::format("; a pixel is {:.3g} times as wide as high, as the video says", pixel_aspect);
    CameraModel model;
    model.pinhole = {f, f * pixel_aspect, 0.5 * (width - 1), 0.5 * (height - 1), width, height};
    if (options.distortion_k1 != 0)
      model.distortion = Distortion::radial_tangential;
    model.coefficients[0] = options.distortion_k1;
    const MountedCamera guess = {model, forwardCamera()};
    requirePlausible(guess); // pictures of a few pixels hold no trunk
    return guess;
  }
  const MountedCamera camera = readCamera(options.camera_path, width, height);
  const PinholeCamera &pinhole = camera.model.pinhole;
  if (pinhole.width != width || pinhole.height != height)
    throw dimensionError("{}: resolution = {}x{}, must be {}x{} as the images are", options.camera_path, pinhole.width,
                         pinhole.height, width, height);
  return camera;
}
} // namespace bole
