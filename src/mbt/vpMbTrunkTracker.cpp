// SPDX-License-Identifier: GPL-2.0-or-later
// The ViSP side of vpMbTrunkTracker; its estimation is in vpMbTrunkTrackerPose.cpp and ...Servo.cpp, its display in
// ...Display.cpp.
#include "geometry/require_range.h"
#include "mbt/cao_reader.h"
#include "mbt/trunk_settings.h"
#include <bole/vpMbTrunkTracker.h>

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpImageConvert.h>
#include <visp3/core/vpTrackingException.h>

using bole::ImageFault;
using bole::Pose;

namespace
{
vpMbTrunkTracker::Status statusOf(ImageFault fault)
{
  using Status = vpMbTrunkTracker::Status;
  switch (fault) {
  case ImageFault::wrong_size:
    return Status::wrong_size;
  case ImageFault::black:
  case ImageFault::saturated:
    return Status::black;
  case ImageFault::noise:
    return Status::noise;
  case ImageFault::frozen:
    return Status::frozen;
  case ImageFault::smeared:
  case ImageFault::blurred:
  case ImageFault::mirrored:
  case ImageFault::upside_down:
  case ImageFault::out_of_order:
  case ImageFault::late:
    return Status::smeared;
  case ImageFault::none:
    break;
  }
  return Status::tracked;
}

[[noreturn]] void refuse(const char *what)
{
  throw vpException(vpException::notImplementedError, fmt::format("{}: a model of trunks holds cylinders only", what));
}
} // namespace

void vpMbTrunkTracker::Options::validate() const
{
  trunk.validate();
  health.validate();
  bole::requireRange("border_sigma_px", border_sigma_px, 0.1, 20);
  bole::requireRange("lean_sigma_rad", lean_sigma_rad, 1e-4, 0.5);
  bole::requireRange("radius_sigma", radius_sigma, 1e-3, 1);
  bole::requireRange("scan_min_px", scan_min_px, 2, 20);
  bole::requireRange("scan_max_px", scan_max_px, 8, 100);
  bole::requireRange("refine_px", refine_px, 2, 20);
  bole::requireRange("refinements", refinements, 0, 5);
  bole::requireRange("step_sigma_m", step_sigma_m, 0.001, 10);
  bole::requireRange("accel_sigma_m", accel_sigma_m, 0.001, 10);
  bole::requireRange("climb_sigma_m", climb_sigma_m, 0.001, 10);
  bole::requireRange("turn_sigma_rad", turn_sigma_rad, 1e-4, 1);
  bole::requireRange("memory_rate", memory_rate, 0.01, 1);
  bole::requireRange("min_support", min_support, 0.05, 1);
  bole::requireRange("min_agreement", min_agreement, 0, 1);
  bole::requireRange("max_jump", max_jump, 0.1, 1000);
  bole::requireRange("max_sigma_m", max_sigma_m, 0.001, 100);
  bole::requireRange("max_sigma_rad", max_sigma_rad, 0.001, 3.2);
  bole::requireRange("unobserved_m", unobserved_m, 0.01, 10);
  bole::requireRange("lever_m", lever_m, 0.1, 100);
}

const char *vpMbTrunkTracker::toString(Status status)
{
  switch (status) {
  case Status::not_initialised:
    return "not initialised";
  case Status::tracked:
    return "tracked";
  case Status::partly_on_prior:
    return "partly on the prior";
  case Status::no_trunk:
    return "no trunk in view";
  case Status::uncertain:
    return "uncertain";
  case Status::lost:
    return "lost";
  case Status::wrong_size:
    return "wrong size";
  case Status::black:
    return "black";
  case Status::noise:
    return "noise";
  case Status::frozen:
    return "frozen";
  case Status::smeared:
    return "smeared";
  }
  return "?";
}

vpMbTrunkTracker::vpMbTrunkTracker() : vpMbTrunkTracker(Options()) {}

vpMbTrunkTracker::vpMbTrunkTracker(const Options &options)
{
  setOptions(options);
  m_lambda = 1.0;
  m_maxIter = 8;
  distNearClip = options.trunk.near_m;
}

vpMbTrunkTracker::~vpMbTrunkTracker() = default;

void vpMbTrunkTracker::setOptions(const Options &options)
{
  options.validate();
  m_options = options;
  m_health = bole::ImageHealth(options.health);
  m_aligner = bole::RotationAligner(options.aligner);
  m_motion = bole::CameraMotion({options.step_sigma_m, options.accel_sigma_m, options.climb_sigma_m});
  if (m_status != Status::not_initialised)
    m_motion.start(Pose::fromVisp(m_cMo), m_posterior);
  for (vpMbtDistanceTrunk &trunk : m_trunks)
    trunk.setOptions(options.trunk);
}

void vpMbTrunkTracker::setMotionPrior(const vpHomogeneousMatrix &cMo, const vpMatrix &covariance)
{
  if (covariance.getRows() != 6 || covariance.getCols() != 6)
    throw vpException(vpException::dimensionError,
                      fmt::format("covariance = {}x{}, must be 6x6", covariance.getRows(), covariance.getCols()));
  MotionPrior prior;
  prior.cMo = cMo;
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      prior.covariance(int(i), int(j)) = 0.5 * (covariance[i][j] + covariance[j][i]);
  if (!prior.covariance.allFinite() || Eigen::LLT<Matrix6d>(prior.covariance).info() != Eigen::Success)
    throw vpException(vpException::badValue, "covariance: must be finite and positive definite");
  if (!Pose::fromVisp(cMo).isFinite())
    throw vpException(vpException::badValue, "cMo: must be finite");
  m_prior = prior;
}

vpMatrix vpMbTrunkTracker::getUnobserved() const
{
  vpMatrix directions(6, unsigned(m_unobserved.cols()));
  for (int i = 0; i < m_unobserved.rows(); ++i)
    for (int j = 0; j < m_unobserved.cols(); ++j)
      directions[unsigned(i)][unsigned(j)] = m_unobserved(i, j);
  return directions;
}

vpMatrix vpMbTrunkTracker::getPoseCovariance() const
{
  vpMatrix covariance(6, 6);
  for (unsigned i = 0; i < 6; ++i)
    for (unsigned j = 0; j < 6; ++j)
      covariance[i][j] = m_posterior(int(i), int(j));
  return covariance;
}

vpMatrix vpMbTrunkTracker::getCovarianceMatrix() const
{
  vpMbTracker::getCovarianceMatrix(); // its complaint when the computation is off
  return computeCovariance ? getPoseCovariance() : vpMatrix();
}

void vpMbTrunkTracker::addTrunk(const bole::Cylinder &cylinder)
{
  vpMbtDistanceTrunk trunk(m_options.trunk);
  vpPoint p1, p2;
  p1.setWorldCoordinates(cylinder.foot.x(), cylinder.foot.y(), cylinder.foot.z());
  p2.setWorldCoordinates(cylinder.top.x(), cylinder.top.y(), cylinder.top.z());
  trunk.buildFrom(p1, p2, cylinder.radius);
  trunk.setName(cylinder.name);
  trunk.setCameraParameters(m_cam);
  m_trunks.push_back(trunk);
  nbCylinders = unsigned(m_trunks.size());
}

void vpMbTrunkTracker::loadModel(const std::string &modelFile, bool verbose, const vpHomogeneousMatrix &T)
{
  const std::vector<bole::Cylinder> cylinders = bole::readCao(modelFile);
  const Pose oMm = Pose::fromVisp(T);
  for (const bole::Cylinder &cylinder : cylinders)
    addTrunk(oMm * cylinder);
  if (verbose)
    fmt::print("{}: {} trunks\n", modelFile, cylinders.size());
  modelInitialised = true;
  modelFileName = modelFile;
}

void vpMbTrunkTracker::loadConfigFile(const std::string &configFile, bool verbose)
{
  const bole::TrunkSettings settings = bole::readTrunkSettings(configFile, m_options, verbose);
  setOptions(settings.options);
  if (settings.has_camera)
    setCameraParameters(settings.camera);
  if (settings.near_clipping)
    setNearClippingDistance(*settings.near_clipping);
  if (settings.far_clipping)
    setFarClippingDistance(*settings.far_clipping);
  if (settings.fov_clipping)
    setClipping(clippingFlag | vpPolygon3D::FOV_CLIPPING);
  angleAppears = settings.angle_appear.value_or(angleAppears);
  angleDisappears = settings.angle_disappear.value_or(angleDisappears);
}

void vpMbTrunkTracker::setCameraParameters(const vpCameraParameters &cam)
{
  m_cam = cam;
  for (vpMbtDistanceTrunk &trunk : m_trunks)
    trunk.setCameraParameters(cam);
}

void vpMbTrunkTracker::init(const vpImage<unsigned char> &I)
{
  if (m_trunks.empty())
    throw vpException(vpException::notInitialized, "no trunks: load a model before the tracker is initialised");
  setCameraParameters(m_cam);
  for (vpMbtDistanceTrunk &trunk : m_trunks)
    trunk.forget();
  m_agreement = kRightAgreement;
  m_is_doubtful = false;
  m_posterior = Matrix6d::Identity() * 1e-4; // 1 cm, 0.6 degrees
  m_frames_since_good = 0;
  m_prior.reset();
  setPose(I, m_cMo);
  learn(I);
}

void vpMbTrunkTracker::setPose(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cdMo)
{
  if (!Pose::fromVisp(cdMo).isFinite())
    throw vpException(vpException::badValue, "cMo: must be finite");
  m_cMo = cdMo;
  m_health.start(I);
  m_reference = {};
  m_reference_image = I;
  m_motion.start(Pose::fromVisp(m_cMo), m_posterior);
  m_frames_since_good = 0;
  m_status = Status::tracked;
  m_message = "initialised";
  m_unobserved.resize(6, 0);
}

void vpMbTrunkTracker::setPose(const vpImage<vpRGBa> &I_color, const vpHomogeneousMatrix &cdMo)
{
  vpImageConvert::convert(I_color, m_I);
  setPose(m_I, cdMo);
}

void vpMbTrunkTracker::resetTracker()
{
  m_trunks.clear();
  m_in_view.clear();
  nbCylinders = 0;
  m_cMo.eye();
  m_prior.reset();
  m_frames_since_good = 0;
  m_reference = {};
  m_unobserved.resize(6, 0);
  m_posterior.setZero();
  m_error.resize(0);
  m_w.resize(0);
  modelInitialised = false;
  m_status = Status::not_initialised;
  m_message.clear();
}

void vpMbTrunkTracker::reInitModel(const vpImage<unsigned char> &I, const std::string &cad_name,
                                   const vpHomogeneousMatrix &cMo, bool verbose, const vpHomogeneousMatrix &T)
{
  resetTracker();
  loadModel(cad_name, verbose, T);
  initFromPose(I, cMo);
}

/// Why the pose just found is not to be vouched for; empty: it is.
std::string vpMbTrunkTracker::doubt() const
{
  const double metres =
      std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m_posterior.topLeftCorner<3, 3>()).eigenvalues()(2));
  const double radians =
      std::sqrt(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(m_posterior.bottomRightCorner<3, 3>()).eigenvalues()(2));
  if (metres > m_options.max_sigma_m)
    return fmt::format("the position is known to {:.2g} m only", metres);
  if (radians > m_options.max_sigma_rad)
    return fmt::format("the attitude is known to {:.2g} rad only", radians);
  if (!m_prior && m_is_doubtful)
    return fmt::format("the borders agree to {:.2f} only: the trunks found may be others", m_agreement);
  return "";
}

void vpMbTrunkTracker::finish(Status status, const std::string &message)
{
  m_status = status;
  m_message = message;
  m_prior.reset();
  testTracking();
}

void vpMbTrunkTracker::track(const vpImage<unsigned char> &I)
{
  if (m_status == Status::not_initialised)
    throw vpException(vpException::notInitialized, "the trunk tracker has no pose to start from");
  const ImageFault fault = m_health.check(I);
  if (fault != ImageFault::none) {
    const Prediction prediction = predict(nullptr);
    m_cMo = prediction.cMo;
    m_posterior = prediction.covariance;
    ++m_frames_since_good;
    m_in_view.clear();
    computeVVSInit();
    finish(statusOf(fault), fmt::format("image is {}: the pose is predicted", bole::toString(fault)));
    return;
  }
  const Prediction prediction = predict(&I);
  const Status status = estimate(I, prediction);
  if (status != Status::tracked) {
    m_cMo = prediction.cMo;
    m_posterior = prediction.covariance;
    ++m_frames_since_good;
    finish(status, status == Status::lost ? "the borders of the trunks are not where they can be"
                                          : "no trunk of the model is in view");
    return;
  }
  keep(prediction);
  if (m_prior)
    m_motion.replace(Pose::fromVisp(m_cMo), m_posterior, m_frames_since_good + 1);
  else
    m_motion.update(Pose::fromVisp(m_cMo), m_posterior);
  m_frames_since_good = 0;
  for (std::size_t k : m_in_view)
    m_trunks[k].remember(m_options.memory_rate);
  m_reference = m_thumbnails;
  if (m_reference.empty())
    m_reference_image = I;
  projectionError = computeProjError ? computeCurrentProjectionError(I, m_cMo, m_cam) : 90.0;
  if (const std::string why = doubt(); !why.empty())
    finish(Status::uncertain, why);
  else if (m_unobserved.cols() == 0)
    finish(Status::tracked, "all directions are observed");
  else
    finish(Status::partly_on_prior, fmt::format("{} directions are not observed", m_unobserved.cols()));
}

void vpMbTrunkTracker::track(const vpImage<vpRGBa> &I)
{
  vpImageConvert::convert(I, m_I);
  track(m_I);
}

void vpMbTrunkTracker::testTracking()
{
  if (m_status == Status::tracked || m_status == Status::partly_on_prior)
    return;
  throw vpTrackingException(vpTrackingException::fatalError, fmt::format("{}: {}", toString(m_status), m_message));
}

void vpMbTrunkTracker::initCylinder(const vpPoint &p1, const vpPoint &p2, double radius, int, const std::string &name)
{
  addTrunk({{p1.get_oX(), p1.get_oY(), p1.get_oZ()}, {p2.get_oX(), p2.get_oY(), p2.get_oZ()}, radius, name});
}

void vpMbTrunkTracker::initCircle(const vpPoint &, const vpPoint &, const vpPoint &, double, int, const std::string &)
{
  refuse("circle");
}

void vpMbTrunkTracker::initFaceFromCorners(vpMbtPolygon &) { refuse("face from corners"); }

void vpMbTrunkTracker::initFaceFromLines(vpMbtPolygon &) { refuse("face from lines"); }
