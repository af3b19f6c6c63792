// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpTrunkMapper.h>

#include "input/camera_plausibility.h"
#include "input/frame_builder.h"
#include "input/frame_check.h"
#include <bole/config.h>
#include <bole/cylinder.h>
#include <bole/overlay.h>
#include <bole/pipeline.h>

#include <algorithm>
#include <fmt/format.h>
#include <optional>
#include <visp3/core/vpDisplay.h>
#include <visp3/core/vpImageConvert.h>
#include <visp3/core/vpMeterPixelConversion.h>
#include <visp3/core/vpTrackingException.h>

using namespace bole;

namespace
{
MountedCamera mountedCamera(const vpCameraParameters &cam, const Pose &bMc)
{
  MountedCamera camera;
  camera.bMc = bMc;
  switch (cam.get_projModel()) {
  case vpCameraParameters::perspectiveProjWithoutDistortion:
    break;
  case vpCameraParameters::perspectiveProjWithDistortion:
    camera.model.distortion = Distortion::radial_tangential;
    camera.model.coefficients[0] = cam.get_kud();
    break;
  case vpCameraParameters::ProjWithKannalaBrandtDistortion:
    throw vpException(vpException::notImplementedError, "vpTrunkMapper: Kannala-Brandt distortion is not supported");
  }
  return camera;
}
} // namespace

class vpTrunkMapper::Impl
{
public:
  Impl(const vpCameraParameters &cam, const Pose &bMc) : m_cam(cam), m_mounted(mountedCamera(cam, bMc))
  {
    m_report.frame_status = FrameStatus::missing;
    m_report.reason = "no image was tracked yet";
  }

  void requireUnstarted(const char *what) const
  {
    if (m_pipeline)
      throw vpException(vpException::fatalError, "%s: must come before the first image", what);
  }
  void track(const vpImage<unsigned char> &I, double stamp_s, std::optional<Pose> wMb,
             const std::vector<GyroSample> &gyro);
  const Pipeline &pipeline() const
  {
    if (!m_pipeline)
      throw vpException(vpException::notInitialized, "vpTrunkMapper: no image was tracked yet");
    return *m_pipeline;
  }
  template <typename Pixel> void display(const vpImage<Pixel> &I, const vpColor &color, unsigned int thickness) const;

  vpCameraParameters m_cam;
  MountedCamera m_mounted;
  Options m_options;
  double m_period_s = 1.0 / 25;
  double m_next_s = 0; ///< stamp of the next image that comes without one
  std::optional<FrameBuilder> m_builder;
  std::optional<Pipeline> m_pipeline;
  std::optional<std::int64_t> m_last_stamp_ns;
  std::size_t m_frames = 0;
  bool m_has_odometry = false;
  FrameReport m_report; ///< of the last frame

private:
  void start(const Frame &first);
  template <typename Pixel>
  void displayBorder(const vpImage<Pixel> &I, const TrunkInView &trunk, Border border, const vpColor &color,
                     unsigned int thickness) const;
};

void vpTrunkMapper::Impl::start(const Frame &first)
{
  if (first.image.getSize() == 0)
    throw vpException(vpException::dimensionError, "vpTrunkMapper: the first image is empty");
  MountedCamera mounted = m_mounted;
  mounted.model.pinhole = PinholeCamera::fromVisp(m_cam, static_cast<int>(first.image.getWidth()),
                                                  static_cast<int>(first.image.getHeight()));
  requirePlausible(mounted);
  FrameBuilder builder(mounted, SourceOptions(), Recording());
  m_pipeline.emplace(builder.camera(), mounted.bMc, m_options);
  m_builder.emplace(std::move(builder));
  m_has_odometry = first.wMb_odometry.has_value();
}

void vpTrunkMapper::Impl::track(const vpImage<unsigned char> &I, double stamp_s, std::optional<Pose> wMb,
                                const std::vector<GyroSample> &gyro)
{
  Frame frame;
  frame.index = m_frames;
  frame.stamp_ns = stampOf(stamp_s, fmt::format("frame {}: stamp", m_frames));
  frame.wMb_odometry = wMb;
  frame.gyro = gyro;
  frame.image = I;
  requireSound(frame, m_frames, m_last_stamp_ns);
  if (!m_pipeline)
    start(frame);
  m_builder->complete(frame);
  m_report = m_pipeline->process(frame);
  m_last_stamp_ns = frame.stamp_ns;
  m_next_s = stamp_s + m_period_s;
  ++m_frames;
}

template <typename Pixel>
void vpTrunkMapper::Impl::displayBorder(const vpImage<Pixel> &I, const TrunkInView &trunk, Border border,
                                        const vpColor &color, unsigned int thickness) const
{
  constexpr int kSteps = 12;
  std::optional<vpImagePoint> last;
  for (int k = 0; k <= kSteps; ++k) {
    const double elevation = trunk.tan_low + (trunk.tan_high - trunk.tan_low) * k / kSteps;
    const Eigen::Vector3d ray = trunk.relative.borderDirection(border, elevation);
    std::optional<vpImagePoint> point;
    if (ray.z() > 0.05) {
      vpImagePoint pixel;
      vpMeterPixelConversion::convertPoint(m_cam, ray.x() / ray.z(), ray.y() / ray.z(), pixel);
      if (pixel.get_u() >= 0 && pixel.get_v() >= 0 && pixel.get_u() < I.getWidth() && pixel.get_v() < I.getHeight())
        point = pixel;
    }
    if (last && point)
      vpDisplay::displayLine(I, *last, *point, color, thickness);
    last = point;
  }
}

template <typename Pixel>
void vpTrunkMapper::Impl::display(const vpImage<Pixel> &I, const vpColor &color, unsigned int thickness) const
{
  for (const TrunkInView &trunk : m_report.trunks) {
    if (!trunk.is_tracked || !trunk.relative.isFinite())
      continue;
    const bool is_confirmed = trunk.status == TrunkStatus::confirmed;
    const vpRGBa of_id = colourOf(trunk.id);
    const vpColor own = color == vpColor::none ? vpColor(of_id.R, of_id.G, of_id.B) : color;
    for (const Border border : {Border::left, Border::right})
      displayBorder(I, trunk, border, own, is_confirmed ? thickness : 1);
    const Eigen::Vector3d ray = trunk.relative.borderDirection(Border::right, trunk.tan_low);
    if (!is_confirmed || ray.z() < 0.05)
      continue;
    vpImagePoint at;
    vpMeterPixelConversion::convertPoint(m_cam, ray.x() / ray.z(), ray.y() / ray.z(), at);
    at.set_v(std::min(at.get_v(), I.getHeight() - 4.0));
    const std::string distance = trunk.distance > 0 ? fmt::format(" {:.1f} m", trunk.distance) : "";
    vpDisplay::displayText(I, at, fmt::format("{}{}", trunk.id, distance), own);
  }
}

vpTrunkMapper::vpTrunkMapper(const vpCameraParameters &cam) : m_impl(std::make_unique<Impl>(cam, forwardCamera())) {}
vpTrunkMapper::vpTrunkMapper(const vpCameraParameters &cam, const vpHomogeneousMatrix &bMc)
    : m_impl(std::make_unique<Impl>(cam, Pose::fromVisp(bMc)))
{
}
vpTrunkMapper::~vpTrunkMapper() = default;
vpTrunkMapper::vpTrunkMapper(vpTrunkMapper &&) noexcept = default;
vpTrunkMapper &vpTrunkMapper::operator=(vpTrunkMapper &&) noexcept = default;

void vpTrunkMapper::loadConfigFile(const std::string &configFile)
{
  m_impl->requireUnstarted("vpTrunkMapper::loadConfigFile()");
  readConfig(configFile, m_impl->m_options);
}

void vpTrunkMapper::setCameraHeight(double height)
{
  m_impl->requireUnstarted("vpTrunkMapper::setCameraHeight()");
  if (!(height >= 0.1 && height <= 100))
    throw vpException(vpException::badValue, "height = %g, must be 0.1 to 100 m", height);
  m_impl->m_options.camera.height = height;
}

void vpTrunkMapper::setFrameRate(double rate)
{
  if (!(rate >= 0.1 && rate <= 1000))
    throw vpException(vpException::badValue, "rate = %g, must be 0.1 to 1000 Hz", rate);
  m_impl->m_period_s = 1 / rate;
}

void vpTrunkMapper::track(const vpImage<unsigned char> &I) { track(I, m_impl->m_next_s); }

void vpTrunkMapper::track(const vpImage<vpRGBa> &I)
{
  vpImage<unsigned char> grey;
  vpImageConvert::convert(I, grey);
  track(grey);
}

void vpTrunkMapper::track(const vpImage<unsigned char> &I, double stamp_s)
{
  m_impl->track(I, stamp_s, std::nullopt, {});
}

void vpTrunkMapper::track(const vpImage<unsigned char> &I, double stamp_s, const vpHomogeneousMatrix &wMb)
{
  m_impl->track(I, stamp_s, Pose::fromVisp(wMb), {});
}

void vpTrunkMapper::track(const vpImage<unsigned char> &I, double stamp_s, const vpHomogeneousMatrix &wMb,
                          const std::vector<GyroSample> &gyro)
{
  m_impl->track(I, stamp_s, Pose::fromVisp(wMb), gyro);
}

void vpTrunkMapper::testTracking() const
{
  const FrameReport &report = m_impl->m_report;
  const auto lost = [](const std::string &why) {
    return vpTrackingException(vpTrackingException::featureLostError, "vpTrunkMapper: %s", why.c_str());
  };
  if (report.frame_status != FrameStatus::ok)
    throw lost(fmt::format("frame is {}{}{}", toString(report.frame_status), report.reason.empty() ? "" : ": ",
                           report.reason));
  if (!report.wMb.isFinite())
    throw lost("the pose is not finite");
  for (const SensorVerdict &verdict : report.verdicts)
    if (verdict.sensor == "images")
      throw lost(verdict.text);
  if (m_impl->m_has_odometry && report.index > 0 && !report.is_odometry_used) {
    const auto last = std::find_if(report.verdicts.rbegin(), report.verdicts.rend(),
                                   [](const SensorVerdict &verdict) { return verdict.sensor == "odometry"; });
    throw lost(last != report.verdicts.rend() ? last->text : "no odometry that can be believed");
  }
}

std::vector<SensorVerdict> vpTrunkMapper::getVerdicts() const { return m_impl->m_report.verdicts; }

void vpTrunkMapper::finish()
{
  if (!m_impl->m_pipeline)
    return;
  m_impl->m_pipeline->finish();
  const auto trajectory = m_impl->m_pipeline->smoothedTrajectory();
  if (!trajectory.empty())
    m_impl->m_report.wMb = trajectory.back().wMb;
}

void vpTrunkMapper::getPose(vpHomogeneousMatrix &wMb) const { wMb = getPose(); }
vpHomogeneousMatrix vpTrunkMapper::getPose() const { return m_impl->m_report.wMb.toVisp(); }

void vpTrunkMapper::getCameraPose(vpHomogeneousMatrix &cMw) const
{
  cMw = (m_impl->m_report.wMb * m_impl->m_mounted.bMc).inverse().toVisp();
}

std::vector<TrunkRecord> vpTrunkMapper::getTrunks() const
{
  std::vector<TrunkRecord> trunks;
  if (m_impl->m_pipeline)
    for (const TrunkRecord &trunk : m_impl->m_pipeline->map())
      if (trunk.status == TrunkStatus::confirmed)
        trunks.push_back(trunk);
  return trunks;
}

WorldReference vpTrunkMapper::getReference() const { return m_impl->pipeline().reference(); }

void vpTrunkMapper::display(const vpImage<unsigned char> &I, const vpColor &color, unsigned int thickness) const
{
  m_impl->display(I, color, thickness);
}

void vpTrunkMapper::display(const vpImage<vpRGBa> &I, const vpColor &color, unsigned int thickness) const
{
  m_impl->display(I, color, thickness);
}

void vpTrunkMapper::saveModel(const std::string &modelFile) const
{
  const WorldReference reference = getReference();
  if (!reference.has_ranges)
    throw vpException(vpException::badValue, "%s: the camera only rotated, so that no range is known",
                      modelFile.c_str());
  std::vector<Cylinder> cylinders;
  for (const TrunkRecord &trunk : getTrunks())
    cylinders.push_back(cylinderOf(trunk));
  if (cylinders.empty())
    throw vpException(vpException::badValue, "%s: no trunk is confirmed yet", modelFile.c_str());
  writeCao(modelFile, cylinders, "map of trunks; " + describe(reference));
}
