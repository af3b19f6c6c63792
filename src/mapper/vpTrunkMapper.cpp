// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/vpTrunkMapper.h>

#include "input/frame_builder.h"
#include "mbt/cao_reader.h"
#include "output/palette.h"
#include <bole/config.h>
#include <bole/pipeline.h>

#include <cmath>
#include <cstdlib>
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

vpColor colorOf(int id)
{
  const char *hex = palette::kLines[static_cast<std::size_t>(id) % palette::kLines.size()];
  const long value = std::strtol(hex + 1, nullptr, 16);
  return vpColor(static_cast<unsigned char>(value >> 16), static_cast<unsigned char>(value >> 8 & 255),
                 static_cast<unsigned char>(value & 255));
}
} // namespace

class vpTrunkMapper::Impl
{
public:
  Impl(const vpCameraParameters &cam, const Pose &bMc) : m_cam(cam), m_mounted(mountedCamera(cam, bMc)) {}

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
  FrameStatus m_status = FrameStatus::missing;
  std::string m_message = "no image was tracked yet";
  Pose m_wMb;
  std::vector<TrunkInView> m_trunks; ///< of the last frame

private:
  void start(const vpImage<unsigned char> &I);
  template <typename Pixel>
  void displayBorder(const vpImage<Pixel> &I, const TrunkInView &trunk, Border border, const vpColor &color,
                     unsigned int thickness) const;
};

void vpTrunkMapper::Impl::start(const vpImage<unsigned char> &I)
{
  if (I.getSize() == 0)
    throw vpException(vpException::dimensionError, "vpTrunkMapper: the first image is empty");
  m_mounted.model.pinhole =
      PinholeCamera::fromVisp(m_cam, static_cast<int>(I.getWidth()), static_cast<int>(I.getHeight()));
  m_builder.emplace(m_mounted, SourceOptions(), Recording());
  m_pipeline.emplace(m_builder->camera(), m_mounted.bMc, m_options);
}

void vpTrunkMapper::Impl::track(const vpImage<unsigned char> &I, double stamp_s, std::optional<Pose> wMb,
                                const std::vector<GyroSample> &gyro)
{
  if (!m_pipeline)
    start(I);
  m_next_s = stamp_s + m_period_s;
  ImageFile file;
  file.image = I;
  if (I.getSize() == 0) {
    file.status = FrameStatus::missing;
    file.message = "the image is empty";
  }
  Frame frame;
  m_builder->build(std::llround(stamp_s * 1e9), std::move(file), frame);
  frame.wMb_odometry = wMb;
  frame.gyro = gyro;
  m_message = frame.message;
  const FrameReport report = m_pipeline->process(frame);
  m_status = report.frame_status;
  if (!report.reason.empty())
    m_message = report.reason;
  m_wMb = report.wMb;
  m_trunks = report.trunks;
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
  for (const TrunkInView &trunk : m_trunks) {
    if (!trunk.is_tracked || !trunk.relative.isFinite())
      continue;
    const bool is_confirmed = trunk.status == TrunkStatus::confirmed;
    const vpColor &own = color == vpColor::none ? colorOf(trunk.id) : color;
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
  if (m_impl->m_status != FrameStatus::ok)
    throw vpTrackingException(vpTrackingException::featureLostError, "vpTrunkMapper: frame is %s%s%s",
                              toString(m_impl->m_status), m_impl->m_message.empty() ? "" : ": ",
                              m_impl->m_message.c_str());
  if (!m_impl->m_wMb.isFinite())
    throw vpTrackingException(vpTrackingException::fatalError, "vpTrunkMapper: the pose is not finite");
}

void vpTrunkMapper::finish()
{
  if (!m_impl->m_pipeline)
    return;
  m_impl->m_pipeline->finish();
  const auto trajectory = m_impl->m_pipeline->smoothedTrajectory();
  if (!trajectory.empty())
    m_impl->m_wMb = trajectory.back().wMb;
}

void vpTrunkMapper::getPose(vpHomogeneousMatrix &wMb) const { wMb = m_impl->m_wMb.toVisp(); }
vpHomogeneousMatrix vpTrunkMapper::getPose() const { return m_impl->m_wMb.toVisp(); }

void vpTrunkMapper::getCameraPose(vpHomogeneousMatrix &cMw) const
{
  cMw = (m_impl->m_wMb * m_impl->m_mounted.bMc).inverse().toVisp();
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
