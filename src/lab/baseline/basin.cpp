// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/comparison.h"
#include "support/units.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace bole
{
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr int kMarginU = 28, kMarginV = 10; ///< [px] kept for the turn on each side
constexpr double kSky = 205, kGround = 120, kTrunk = 45;
constexpr double kNoise = 1.5;              ///< standard deviation of the sensor noise added [grey levels]
constexpr std::size_t kEvery = 8;           ///< frames of the flight between starts
constexpr Limits kRightWithin = {0.3, 1.0}; ///< right is within: 1 degree is 3.5 px at f = 200 px

Pose turned(const Pose &cMo, double yaw) { return Pose(expSo3({0, -yaw, 0}), Vector3d::Zero()) * cMo; }

double bilinear(const vpImage<unsigned char> &image, const Vector2d &p)
{
  const double u = std::clamp(p.x(), 0.0, image.getWidth() - 1.001),
               v = std::clamp(p.y(), 0.0, image.getHeight() - 1.001);
  const unsigned i = unsigned(u), j = unsigned(v);
  const double a = u - i, b = v - j;
  return (1 - b) * ((1 - a) * image[j][i] + a * image[j][i + 1]) +
         b * ((1 - a) * image[j + 1][i] + a * image[j + 1][i + 1]);
}

/// What the pixel would show of the flat scene: sky, ground, the nearest trunk, its borders smooth over a pixel.
class FlatScene
{
public:
  FlatScene(const TestFlight &flight, const Pose &cMo, const PinholeCamera &camera, double range_m)
      : m_camera(camera), m_up(cMo.R.col(2))
  {
    for (const Cylinder &trunk : flight.trunks) {
      const Cylinder c = cMo * trunk;
      const RelativeTrunk relative = relativeTrunk(c);
      if (relative.isFinite() && c.radius / relative.ratio() < range_m)
        m_trunks.push_back({c, relative, relative.borderNormal(Border::left), relative.borderNormal(Border::right)});
    }
    std::sort(m_trunks.begin(), m_trunks.end(), [](const Drawn &a, const Drawn &b) {
      return a.c.radius / a.relative.ratio() > b.c.radius / b.relative.ratio();
    });
  }

  double grey(const Vector2d &p) const
  {
    const Vector3d ray = m_camera.ray(p);
    double value = m_up.dot(ray) > 0 ? kSky : kGround;
    for (const Drawn &trunk : m_trunks) { // far to near
      const double cover =
          std::min({1.0, 0.5 - m_camera.fx * trunk.left.dot(ray), 0.5 - m_camera.fx * trunk.right.dot(ray)});
      if (cover <= 0 || trunk.relative.cRt.col(0).dot(ray) <= 0)
        continue;
      const double height = trunk.relative.cRt.col(2).dot(ray) / trunk.relative.cRt.col(0).dot(ray) * trunk.c.radius /
                            trunk.relative.ratio();
      const Vector3d axis = trunk.relative.cRt.col(2);
      if (height >= axis.dot(trunk.c.foot) && height <= axis.dot(trunk.c.top))
        value += cover * (kTrunk - value);
    }
    return value;
  }

private:
  struct Drawn
  {
    Cylinder c;
    RelativeTrunk relative;
    Vector3d left, right;
  };
  PinholeCamera m_camera;
  Vector3d m_up;
  std::vector<Drawn> m_trunks;
};

int trunksInView(const TestFlight &flight, const TestFrame &frame, const BasinOptions &options)
{
  return int(std::count_if(flight.trunks.begin(), flight.trunks.end(), [&](const Cylinder &trunk) {
    const Cylinder c = frame.cMo * trunk;
    const Vector3d axis = c.axis(), nearest = c.foot - axis.dot(c.foot) * axis;
    return nearest.z() > 0 && nearest.norm() < options.range_m &&
           flight.camera.contains(flight.camera.project(nearest), 2 * kMarginU);
  }));
}
} // namespace

TurnedPair turnedPair(const TestFlight &flight, std::size_t k, double step_px, bool has_clutter,
                      const BasinOptions &options)
{
  const TestFrame &seen = flight.frames[k];
  TurnedPair pair;
  pair.camera = flight.camera;
  pair.camera.width -= 2 * kMarginU, pair.camera.height -= 2 * kMarginV;
  pair.camera.cx -= kMarginU, pair.camera.cy -= kMarginV;
  const double yaw = std::atan(step_px / pair.camera.fx);
  std::mt19937 random(7 + unsigned(k));
  std::normal_distribution<double> noise(0, kNoise);
  for (TestFrame *frame : {&pair.before, &pair.after}) {
    const double half = frame == &pair.before ? -0.5 * yaw : 0.5 * yaw;
    frame->cMo = turned(seen.cMo, half);
    const Eigen::Matrix3d seenRframe = expSo3({0, half, 0});
    const FlatScene scene(flight, frame->cMo, pair.camera, options.range_m);
    frame->image.resize(unsigned(pair.camera.height), unsigned(pair.camera.width));
    for (int v = 0; v < pair.camera.height; ++v)
      for (int u = 0; u < pair.camera.width; ++u) {
        const Vector2d p(u, v);
        const double grey =
            has_clutter ? bilinear(seen.image, flight.camera.project(seenRframe * pair.camera.ray(p))) : scene.grey(p);
        frame->image[unsigned(v)][unsigned(u)] =
            static_cast<unsigned char>(std::lround(std::clamp(grey + noise(random), 0.0, 255.0)));
      }
  }
  return pair;
}

BasinRow basin(const TestFlight &flight, const std::string &cao_path, Contender &contender, bool has_clutter,
               const BasinOptions &options)
{
  BasinRow row;
  row.name = contender.name();
  row.settings = contender.settingsText();
  row.has_clutter = has_clutter;
  row.steps_px = options.steps_px;
  for (const double step_px : options.steps_px) {
    int right = 0, silent = 0;
    row.pairs = 0;
    for (std::size_t k = 0; k < flight.frames.size(); k += kEvery) {
      if (trunksInView(flight, flight.frames[k], options) < options.min_trunks)
        continue;
      for (const double side : {-1.0, 1.0}) {
        const TurnedPair pair = turnedPair(flight, k, side * step_px, has_clutter, options);
        TestFlight two;
        two.camera = pair.camera;
        two.frames = {pair.before, pair.before, pair.after};
        contender.start(cao_path, pair.camera, pair.before.image, pair.before.cMo);
        contender.track(two, 1, pair.before.image);
        const Answer answer = contender.track(two, 2, pair.after.image);
        const PoseError error = poseError(answer.cMo, pair.after.cMo);
        const bool is_right =
            error.position_m <= kRightWithin.position_m && error.rotation_deg <= kRightWithin.rotation_deg;
        ++row.pairs;
        right += is_right && !answer.complained ? 1 : 0;
        silent += !is_right && !answer.complained ? 1 : 0;
      }
    }
    row.success.push_back(row.pairs > 0 ? double(right) / row.pairs : 0);
    row.silent.push_back(row.pairs > 0 ? double(silent) / row.pairs : 0);
  }
  return row;
}
} // namespace bole
