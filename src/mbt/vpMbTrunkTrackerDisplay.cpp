// SPDX-License-Identifier: GPL-2.0-or-later
// What vpMbTrunkTracker shows, and how well its model lies on the image.
#include "mbt/trunk_tracker_impl.h"

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpDisplay.h>

namespace
{
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

void vpMbTrunkTracker::Impl::add(const bole::Cylinder &trunk)
{
  if (!(trunk.radius > 0))
    throw vpException(vpException::badValue, fmt::format("radius = {}, must be above 0", trunk.radius));
  if (!((trunk.top - trunk.foot).norm() > 1e-6))
    throw vpException(vpException::badValue, "the two points of the axis of a trunk must differ");
  estimator.trunks.emplace_back(trunk);
}

vpColVector vpMbTrunkTracker::Impl::collected(double bole::FoundPiece::*member) const
{
  std::vector<double> values;
  estimator.forEachPiece(
      [&](const bole::FoundPiece &piece, const bole::ModelBorder &) { values.push_back(piece.*member); });
  return vpColVector(values);
}

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
