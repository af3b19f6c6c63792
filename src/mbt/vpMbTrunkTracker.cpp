// SPDX-License-Identifier: GPL-2.0-or-later
// The ViSP side of vpMbTrunkTracker. Its estimation is PoseEstimator.
#include "geometry/failure.h"
#include "geometry/names.h"
#include "geometry/visp_matrix.h"
#include "input/image_health.h"
#include "mbt/model_files.h"
#include "mbt/pose_estimator.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpColVector.h>
#include <visp3/core/vpDisplay.h>
#include <visp3/core/vpImageConvert.h>
#include <visp3/core/vpTrackingException.h>

using bole::ImageFault;
using bole::Matrix6d;
using bole::PinholeCamera;
using bole::Pose;
using bole::toEigen;
using bole::toVisp;

namespace
{
[[noreturn]] void refuse(const char *what)
{
  throw bole::notImplementedError("{}: a model of trunks holds cylinders only", what);
}

template <class Image>
void draw(const Image &I, const std::vector<std::vector<double>> &lines,
          const std::vector<std::vector<double>> &features, const vpColor &colour, unsigned int thickness)
{
  for (const auto &l : lines)
    vpDisplay::displayLine(I, vpImagePoint(l[1], l[2]), vpImagePoint(l[3], l[4]), colour, thickness);
  for (const auto &f : features)
    vpDisplay::displayCross(I, vpImagePoint(f[1], f[2]), 5, f[3] > 0 ? vpColor::red : vpColor::green, 1);
}

/// Angle [degrees] between the edge of the image at \p p and the direction \p along; 90 where there is no edge.
double edgeAngle(const vpImage<unsigned char> &I, const Eigen::Vector2i &p, const Eigen::Vector2d &along)
{
  const auto grey = [&](int du, int dv) { return double(I[unsigned(p.y() + dv)][unsigned(p.x() + du)]); };
  const Eigen::Vector2d g(grey(1, -1) + 2 * grey(1, 0) + grey(1, 1) - grey(-1, -1) - 2 * grey(-1, 0) - grey(-1, 1),
                          grey(-1, 1) + 2 * grey(0, 1) + grey(1, 1) - grey(-1, -1) - 2 * grey(0, -1) - grey(1, -1));
  const double norm = g.norm();
  return norm > 0 ? std::asin(std::min(1.0, std::abs(g.dot(along)) / norm)) * 180 / M_PI : 90;
}
} // namespace

/// The state of the tracker.
struct vpMbTrunkTracker::Impl
{
  bole::PoseEstimator estimator;
  bole::ImageHealth health;
  Status status = Status::not_initialised;
  std::string message;

  /// \throw vpException when \p trunk has no length or no radius.
  void add(const bole::Cylinder &trunk)
  {
    if (!(trunk.radius > 0))
      throw bole::badValue("radius = {}, must be above 0", trunk.radius);
    if (!((trunk.top - trunk.foot).norm() > 1e-6))
      throw bole::badValue("the two points of the axis of a trunk must differ");
    estimator.trunks.emplace_back(trunk);
  }
  /// One number of each found piece of the last frame.
  vpColVector collected(double bole::FoundPiece::*member) const
  {
    std::vector<double> values;
    estimator.forEachPiece(
        [&](const bole::FoundPiece &piece, const bole::ModelBorder &) { values.push_back(piece.*member); });
    return vpColVector(values);
  }
};

const char *vpMbTrunkTracker::toString(Status status)
{
  return bole::nameOf(status, {"not initialised", "tracked", "partly on the prior", "uncertain", "no trunk in view",
                               "lost", "bad image"});
}

vpMbTrunkTracker::vpMbTrunkTracker() : vpMbTrunkTracker(Options()) {}

vpMbTrunkTracker::vpMbTrunkTracker(const Options &options) : m_impl(std::make_unique<Impl>())
{
  setOptions(options);
  m_lambda = 1.0;
  m_maxIter = 8;
}

vpMbTrunkTracker::~vpMbTrunkTracker() = default;

vpMbTrunkTracker::Status vpMbTrunkTracker::getStatus() const { return m_impl->status; }
const std::string &vpMbTrunkTracker::getMessage() const { return m_impl->message; }
vpMatrix vpMbTrunkTracker::getUnobserved() const { return toVisp(m_impl->estimator.unobserved()); }
vpMatrix vpMbTrunkTracker::getPoseCovariance() const { return toVisp(m_impl->estimator.covariance()); }
const vpMbTrunkTracker::Options &vpMbTrunkTracker::getOptions() const { return m_impl->estimator.options; }

void vpMbTrunkTracker::setOptions(const Options &options)
{
  options.validate();
  m_impl->estimator.options = options;
  m_impl->health = bole::ImageHealth(options.detect_frozen > 0.5);
}

void vpMbTrunkTracker::setMotionPrior(const vpHomogeneousMatrix &cMo, const vpMatrix &covariance)
{
  if (covariance.getRows() != 6 || covariance.getCols() != 6)
    throw bole::dimensionError("covariance = {}x{}, must be 6x6", covariance.getRows(), covariance.getCols());
  const Matrix6d given = toEigen(covariance), P = 0.5 * (given + given.transpose());
  if (!P.allFinite() || Eigen::LLT<Matrix6d>(P).info() != Eigen::Success)
    throw bole::badValue("covariance: must be finite and positive definite");
  const Pose pose = Pose::fromVisp(cMo);
  if (!pose.isFinite())
    throw bole::badValue("cMo: must be finite");
  m_impl->estimator.prior = bole::ExpectedPose{pose, P};
}

vpColVector vpMbTrunkTracker::getError() const { return m_impl->collected(&bole::FoundPiece::residual); }
vpColVector vpMbTrunkTracker::getRobustWeights() const { return m_impl->collected(&bole::FoundPiece::robust); }

vpMatrix vpMbTrunkTracker::getCovarianceMatrix() const
{
  vpMbTracker::getCovarianceMatrix(); // its complaint when the computation is off
  return computeCovariance ? getPoseCovariance() : vpMatrix();
}

void vpMbTrunkTracker::addTrunk(const vpPoint &p1, const vpPoint &p2, double radius)
{
  m_impl->add({{p1.get_oX(), p1.get_oY(), p1.get_oZ()}, {p2.get_oX(), p2.get_oY(), p2.get_oZ()}, radius, ""});
  nbCylinders = unsigned(m_impl->estimator.trunks.size());
}

void vpMbTrunkTracker::loadModel(const std::string &modelFile, bool verbose, const vpHomogeneousMatrix &T)
{
  const std::vector<bole::Cylinder> cylinders = bole::readCao(modelFile);
  const Pose oMm = Pose::fromVisp(T);
  for (const bole::Cylinder &cylinder : cylinders)
    m_impl->add(oMm * cylinder);
  nbCylinders = unsigned(m_impl->estimator.trunks.size());
  if (verbose)
    fmt::print("{}: {} trunks\n", modelFile, cylinders.size());
  modelInitialised = true;
  modelFileName = modelFile;
}

void vpMbTrunkTracker::loadConfigFile(const std::string &configFile, bool verbose)
{
  const bole::TrunkSettings settings = bole::readTrunkSettings(configFile, getOptions(), verbose);
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

void vpMbTrunkTracker::init(const vpImage<unsigned char> &I)
{
  if (m_impl->estimator.trunks.empty())
    throw bole::notInitialized("no trunks: load a model before the tracker is initialised");
  setPose(I, m_cMo);
  m_impl->estimator.start(I, PinholeCamera::fromVisp(m_cam, int(I.getWidth()), int(I.getHeight())),
                          Pose::fromVisp(m_cMo));
}

void vpMbTrunkTracker::setPose(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cdMo)
{
  const Pose pose = Pose::fromVisp(cdMo);
  if (!pose.isFinite())
    throw bole::badValue("cMo: must be finite");
  m_cMo = cdMo;
  m_impl->health.start(I);
  m_impl->estimator.setPose(pose);
  m_impl->status = Status::tracked;
  m_impl->message = "initialised";
}

void vpMbTrunkTracker::setPose(const vpImage<vpRGBa> &I_color, const vpHomogeneousMatrix &cdMo)
{
  vpImageConvert::convert(I_color, m_I);
  setPose(m_I, cdMo);
}

void vpMbTrunkTracker::resetTracker()
{
  m_impl->estimator.forget();
  m_impl->status = Status::not_initialised;
  m_impl->message.clear();
  nbCylinders = 0;
  m_cMo.eye();
  modelInitialised = false;
}

void vpMbTrunkTracker::reInitModel(const vpImage<unsigned char> &I, const std::string &cad_name,
                                   const vpHomogeneousMatrix &cMo)
{
  resetTracker();
  loadModel(cad_name);
  initFromPose(I, cMo);
}

void vpMbTrunkTracker::track(const vpImage<unsigned char> &I)
{
  if (m_impl->status == Status::not_initialised)
    throw bole::notInitialized("the trunk tracker has no pose to start from");
  bole::PoseEstimator &estimator = m_impl->estimator;
  estimator.gain = m_lambda;
  estimator.iterations = int(m_maxIter);
  estimator.is_all_free = toEigen(oJo).isIdentity(0);
  estimator.free_in_object = toEigen(oJo);
  estimator.far_m = (clippingFlag & vpPolygon3D::FAR_CLIPPING) != 0 ? distFarClip : 0;
  const ImageFault fault = m_impl->health.check(I);
  if (fault != ImageFault::none) {
    estimator.skip();
    m_impl->status = Status::bad_image;
    m_impl->message = fmt::format("the image is {}: the pose is predicted", bole::toString(fault));
  }
  else {
    m_impl->status = estimator.track(I, PinholeCamera::fromVisp(m_cam, int(I.getWidth()), int(I.getHeight())));
    m_impl->message = estimator.message();
  }
  m_cMo = estimator.pose().toVisp();
  projectionError = computeProjError && fault == ImageFault::none ? computeCurrentProjectionError(I, m_cMo, m_cam) : 90;
  testTracking();
}

void vpMbTrunkTracker::track(const vpImage<vpRGBa> &I)
{
  vpImageConvert::convert(I, m_I);
  track(m_I);
}

void vpMbTrunkTracker::testTracking()
{
  if (m_impl->status == Status::tracked || m_impl->status == Status::partly_on_prior)
    return;
  throw vpTrackingException(vpTrackingException::fatalError,
                            fmt::format("{}: {}", toString(m_impl->status), m_impl->message));
}

void vpMbTrunkTracker::initCylinder(const vpPoint &p1, const vpPoint &p2, double radius, int, const std::string &)
{
  addTrunk(p1, p2, radius);
}

void vpMbTrunkTracker::initCircle(const vpPoint &, const vpPoint &, const vpPoint &, double, int, const std::string &)
{
  refuse("circle");
}

void vpMbTrunkTracker::initFaceFromCorners(vpMbtPolygon &) { refuse("face from corners"); }
void vpMbTrunkTracker::initFaceFromLines(vpMbtPolygon &) { refuse("face from lines"); }

// The base class declares these two for trackers that servo in its own loop; PoseEstimator has its own.
void vpMbTrunkTracker::computeVVSInit() {}
void vpMbTrunkTracker::computeVVSInteractionMatrixAndResidu() {}

std::vector<std::vector<double>> vpMbTrunkTracker::getModelForDisplay(unsigned int width, unsigned int height,
                                                                      const vpHomogeneousMatrix &cMo,
                                                                      const vpCameraParameters &cam,
                                                                      bool displayFullModel)
{
  Options options = getOptions();
  if (displayFullModel)
    options.min_length_px = 4, options.min_width_px = 1;
  const bole::PinholeCamera camera = bole::PinholeCamera::fromVisp(cam, int(width), int(height));
  std::vector<std::vector<double>> lines;
  for (bole::ModelTrunk trunk : m_impl->estimator.trunks) {
    trunk.predict(bole::Pose::fromVisp(cMo), camera, options, 0);
    for (const bole::ModelBorder &border : trunk.borders())
      if (border.visible) {
        const bole::BorderLine &line = border.image.line;
        const Eigen::Vector2d a = border.image.at(line.row_begin), b = border.image.at(line.row_end - 1);
        lines.push_back({0, a.y(), a.x(), b.y(), b.x()});
      }
  }
  return lines;
}

std::vector<std::vector<double>> vpMbTrunkTracker::getFeaturesForDisplay()
{
  std::vector<std::vector<double>> features;
  m_impl->estimator.forEachPiece([&](const bole::FoundPiece &piece, const bole::ModelBorder &) {
    features.push_back({0, m_cam.get_py() * piece.m.y() + m_cam.get_v0(), m_cam.get_px() * piece.m.x() + m_cam.get_u0(),
                        piece.robust > 0.3 ? 0.0 : 3.0});
  });
  return features;
}

void vpMbTrunkTracker::display(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo,
                               const vpCameraParameters &cam, const vpColor &col, unsigned int thickness,
                               bool displayFullModel)
{
  draw(I, getModelForDisplay(I.getWidth(), I.getHeight(), cMo, cam, displayFullModel),
       displayFeatures ? getFeaturesForDisplay() : std::vector<std::vector<double>>(), col, thickness);
}

void vpMbTrunkTracker::display(const vpImage<vpRGBa> &I, const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam,
                               const vpColor &col, unsigned int thickness, bool displayFullModel)
{
  draw(I, getModelForDisplay(I.getWidth(), I.getHeight(), cMo, cam, displayFullModel),
       displayFeatures ? getFeaturesForDisplay() : std::vector<std::vector<double>>(), col, thickness);
}

double vpMbTrunkTracker::computeCurrentProjectionError(const vpImage<unsigned char> &I, const vpHomogeneousMatrix &cMo,
                                                       const vpCameraParameters &cam)
{
  double sum = 0;
  int n = 0;
  for (const auto &l : getModelForDisplay(I.getWidth(), I.getHeight(), cMo, cam)) {
    const Eigen::Vector2d foot(l[2], l[1]), top(l[4], l[3]), along = (top - foot).normalized();
    for (int k = 0; k < int((top - foot).norm()); k += 2) {
      const Eigen::Vector2i p = (foot + k * along).array().round().cast<int>();
      if (p.x() < 1 || p.y() < 1 || p.x() + 1 >= int(I.getWidth()) || p.y() + 1 >= int(I.getHeight()))
        continue;
      sum += edgeAngle(I, p, along);
      ++n;
    }
  }
  return n > 0 ? sum / n : 90;
}
