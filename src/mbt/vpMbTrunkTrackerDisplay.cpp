// SPDX-License-Identifier: GPL-2.0-or-later
// What vpMbTrunkTracker shows, and how well its model lies on the image.
#include "tracking/borders.h"

#include <bole/vpMbTrunkTracker.h>

#include <algorithm>
#include <cmath>
#include <visp3/core/vpDisplay.h>

using bole::Border;
using bole::kBorders;

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
} // namespace

void vpMbTrunkTracker::drawBorders(const vpHomogeneousMatrix &cMo, const vpCameraParameters &cam, unsigned int width,
                                   unsigned int height, bool all, std::vector<std::vector<double>> &lines) const
{
  vpMbtDistanceTrunk::Options options = m_options.trunk;
  options.margin_px = 0;
  if (all)
    options.min_length_px = 4, options.min_width_px = 1;
  for (const vpMbtDistanceTrunk &own : m_trunks) {
    vpMbtDistanceTrunk trunk(options);
    trunk.buildFrom(own.object());
    trunk.setCameraParameters(cam);
    trunk.predict(cMo, width, height);
    for (Border side : kBorders)
      if (trunk.border(side).visible) {
        const bole::VisibleBorder &line = trunk.border(side).line;
        lines.push_back({0, line.foot_px.y(), line.foot_px.x(), line.top_px.y(), line.top_px.x()});
      }
  }
}

std::vector<std::vector<double>> vpMbTrunkTracker::getModelForDisplay(unsigned int width, unsigned int height,
                                                                      const vpHomogeneousMatrix &cMo,
                                                                      const vpCameraParameters &cam,
                                                                      bool displayFullModel)
{
  std::vector<std::vector<double>> lines;
  drawBorders(cMo, cam, width, height, displayFullModel, lines);
  return lines;
}

std::vector<std::vector<double>> vpMbTrunkTracker::getFeaturesForDisplay()
{
  std::vector<std::vector<double>> features;
  unsigned int at = 0;
  for (std::size_t k : m_in_view)
    for (Border side : kBorders) {
      const auto &state = m_trunks[k].border(side);
      if (!state.visible)
        continue;
      for (const auto &piece : state.pieces)
        if (piece.used) {
          features.push_back({0, piece.found_px.y(), piece.found_px.x(), m_w[at] > 0.3 ? 0.0 : 3.0});
          ++at;
        }
    }
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
  std::vector<std::vector<double>> lines;
  drawBorders(cMo, cam, I.getWidth(), I.getHeight(), false, lines);
  double sum = 0;
  int n = 0;
  for (const auto &l : lines) {
    const Eigen::Vector2d foot(l[2], l[1]), top(l[4], l[3]);
    const Eigen::Vector2d along = (top - foot).normalized();
    const int length = int((top - foot).norm());
    for (int k = 0; k < length; k += 2) {
      const Eigen::Vector2d p = foot + k * along;
      const int u = int(std::lround(p.x())), v = int(std::lround(p.y()));
      if (u < 1 || v < 1 || u + 1 >= int(I.getWidth()) || v + 1 >= int(I.getHeight()))
        continue;
      const auto grey = [&](int du, int dv) { return double(I[unsigned(v + dv)][unsigned(u + du)]); };
      const Eigen::Vector2d g(grey(1, -1) + 2 * grey(1, 0) + grey(1, 1) - grey(-1, -1) - 2 * grey(-1, 0) - grey(-1, 1),
                              grey(-1, 1) + 2 * grey(0, 1) + grey(1, 1) - grey(-1, -1) - 2 * grey(0, -1) - grey(1, -1));
      const double norm = g.norm();
      sum += norm > 0 ? std::asin(std::min(1.0, std::abs(g.dot(along)) / norm)) * 180 / M_PI : 90;
      ++n;
    }
  }
  return n > 0 ? sum / n : 90;
}
