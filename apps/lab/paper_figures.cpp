// SPDX-License-Identifier: GPL-2.0-or-later
#include "paper_figures.h"

#include "detector_statistics.h"

#include "evaluation/trajectory_metrics.h"
#include "gradient/border_line.h"
#include "output/map_svg.h"
#include "output/palette.h"
#include "output/svg.h"
#include "pipeline/paper_policy.h"
#include "saliency/flow_matrix.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace bole::apps
{
namespace
{
constexpr int kLarger = 2;                  ///< drawn pixels for one of the camera
constexpr double kNear = 6, kFarthest = 10; ///< [m]
const cv::Scalar kCyan(255, 255, 0), kRed(60, 60, 230);

cv::Mat canvasOf(const vpImage<unsigned char> &image)
{
  const cv::Mat grey(static_cast<int>(image.getHeight()), static_cast<int>(image.getWidth()), CV_8UC1, image.bitmap);
  cv::Mat large, canvas;
  cv::resize(grey, large, {}, kLarger, kLarger, cv::INTER_CUBIC);
  cv::cvtColor(large, canvas, cv::COLOR_GRAY2BGR);
  return canvas;
}

void drawBorders(cv::Mat &canvas, const PinholeCamera &camera, const RelativeTrunk &relative,
                 const ElevationRange &part, const cv::Scalar &colour)
{
  for (const Border border : {Border::left, Border::right}) {
    const BorderLine line = borderLine(camera, relative, border, part);
    if (line.rows() == 0)
      continue;
    const auto at = [&](int row) {
      return cv::Point(cvRound(kLarger * (line.xAt(row) + 0.5)), cvRound(kLarger * (row + 0.5)));
    };
    cv::line(canvas, at(line.row_begin), at(line.row_end - 1), colour, 2, cv::LINE_AA);
  }
}

std::string pngOf(const cv::Mat &canvas)
{
  std::vector<unsigned char> bytes;
  cv::imencode(".png", canvas, bytes);
  return {bytes.begin(), bytes.end()};
}

bool isRight(const SeenFlight &flight, int id)
{
  return std::find(flight.right.begin(), flight.right.end(), id) != flight.right.end();
}

/// The image with what is tracked in it (cyan) and what ended in it (red).
std::string trackedPng(const SeenFlight &flight, const SeenFrame &frame)
{
  cv::Mat canvas = canvasOf(frame.image);
  for (const TrunkInView &tree : frame.report.trunks)
    drawBorders(canvas, flight.camera, tree.relative, {tree.tan_low, tree.tan_high}, tree.is_tracked ? kCyan : kRed);
  return pngOf(canvas);
}

/// What stands about the robot, which looks up: the map's trees as the map has them, the truth as it is.
std::string localMapSvg(const SeenFlight &flight, std::size_t at)
{
  constexpr double kScale = 36, kAside = 6, kAhead = 11, kBehind = 1; // [px/m], [m]
  const SeenFrame &frame = flight.frames[at];
  SvgDrawing drawing(2 * kAside * kScale, (kAhead + kBehind) * kScale);
  const auto place = [&](const Pose &wMc, const Eigen::Vector2d &xy) {
    const Eigen::Vector2d forward = wMc.R.col(2).head<2>().normalized(), left(-forward.y(), forward.x());
    const Eigen::Vector2d to = xy - wMc.t.head<2>();
    return Eigen::Vector2d((kAside - to.dot(left)) * kScale, (kAhead - to.dot(forward)) * kScale);
  };
  for (double m = 2; m <= kAhead; m += 2) {
    drawing.line(0, (kAhead - m) * kScale, 2 * kAside * kScale, (kAhead - m) * kScale, "#e4e4e4");
    drawing.text(4, (kAhead - m) * kScale - 3, fmt::format("{:g} m", m), "style=\"fill:#777\"");
  }
  for (const TruthTrunk &truth : flight.trunks) {
    const Eigen::Vector2d p = place(flight.trueCamera(at), truth.xy);
    drawing.circle(p.x(), p.y(), std::max(truth.radius, 0.05) * kScale, "none",
                   fmt::format("stroke-width=\"2\" stroke=\"{}\"", palette::kGreen));
  }
  for (const TrunkRecord &tree : frame.map) {
    const Eigen::Vector2d p = place(frame.report.wMc, tree.xy);
    drawing.circle(p.x(), p.y(), std::max(tree.radius, 0.04) * kScale, palette::kVermilion, "fill-opacity=\".6\"");
  }
  const double x = kAside * kScale, y = kAhead * kScale;
  drawing.polygon({{x, y - 12}, {x - 8, y + 10}, {x + 8, y + 10}}, palette::kBlue);
  return drawing.finish();
}

Panel panelOf(const SeenFlight &flight, std::size_t at, const std::string &name, const std::string &caption)
{
  return {{{name + ".png", trackedPng(flight, flight.frames[at])}, {name + "-map.svg", localMapSvg(flight, at)}},
          fmt::format("Frame {}. {}", at, caption)};
}

int countRight(const SeenFlight &flight, const SeenFrame &frame)
{
  return static_cast<int>(
      std::count_if(frame.report.trunks.begin(), frame.report.trunks.end(),
                    [&](const TrunkInView &tree) { return tree.is_tracked && isRight(flight, tree.id); }));
}

std::vector<TrueView> trueViews(const SeenFlight &flight, std::size_t at)
{
  return apps::trueViews(flight.trunks, flight.trueCamera(at), 3 * kFarthest,
                         std::atan(0.5 * flight.camera.width / flight.camera.fx));
}

double bearingOf(const SeenFrame &frame, const TrunkInView &tree)
{
  const Eigen::Vector3d axis = frame.report.wMc.R * tree.relative.cRt.col(0), forward = frame.report.wMc.R.col(2);
  return std::remainder(std::atan2(axis.y(), axis.x()) - std::atan2(forward.y(), forward.x()), 2 * M_PI);
}

/// Near trunks straight ahead of the way that no tree covers, nearest first: "lack of sufficient motion parallax".
std::vector<TrueView> missedAhead(const SeenFlight &flight, std::size_t at)
{
  constexpr double kStraight = 0.15; // [rad]
  if (at == 0)
    return {};
  const Pose wMc = flight.trueCamera(at);
  const Eigen::Vector3d step = wMc.R.transpose() * (wMc.t - flight.trueCamera(at - 1).t);
  const double way = std::atan2(-step.x(), step.z());
  std::vector<TrueView> missed;
  for (const TrueView &truth : trueViews(flight, at)) {
    const auto covers = [&](const TrunkInView &tree) {
      return std::abs(bearingOf(flight.frames[at], tree) - truth.ahead) < truth.half_angle + 0.02;
    };
    const std::vector<TrunkInView> &trees = flight.frames[at].report.trunks;
    if (truth.range < kNear && std::abs(truth.ahead - way) < kStraight &&
        std::none_of(trees.begin(), trees.end(), covers))
      missed.push_back(truth);
  }
  std::sort(missed.begin(), missed.end(), [](const TrueView &a, const TrueView &b) { return a.range < b.range; });
  return missed;
}

/// Angle between the border of a tree that ends in this frame and that of a farther true trunk beside it [rad].
double nearestBehindAnEnd(const SeenFlight &flight, std::size_t at)
{
  double nearest = 1;
  for (const TrunkInView &tree : flight.frames[at].report.trunks)
    if (!tree.is_tracked && isRight(flight, tree.id) && tree.distance < kNear)
      for (const TrueView &truth : trueViews(flight, at))
        if (truth.range > tree.distance + 1 && truth.range < 2 * kFarthest)
          nearest = std::min(nearest, std::abs(std::abs(truth.ahead - bearingOf(flight.frames[at], tree)) -
                                               std::asin(tree.relative.ratio())));
  return nearest;
}

std::vector<int> newIn(const SeenFlight &flight, std::size_t at)
{
  std::vector<int> ids;
  if (at > 0)
    for (const TrunkInView &tree : flight.frames[at].report.trunks)
      if (tree.id >= static_cast<int>(flight.frames[at - 1].map.size()))
        ids.push_back(tree.id);
  return ids;
}

/// The frame of [\p begin, \p end) with the highest \p score.
template <typename Score> std::size_t bestOf(std::size_t begin, std::size_t end, const Score &score)
{
  std::size_t best = begin;
  for (std::size_t i = begin; i < end; ++i)
    if (score(i) > score(best))
      best = i;
  return best;
}
} // namespace

Pose SeenFlight::trueCamera(std::size_t frame) const
{
  const FrameReport &report = frames[frame].report;
  return interpolate(truth, report.stamp_ns).value_or(report.wMb) * bMc;
}

std::string basisFlowsSvg(const PinholeCamera &camera)
{
  const char *axes[3] = {"turn about x (right)", "turn about y (down)", "turn about z (forward)"};
  constexpr double kTurn = 0.06; // [rad], for arrows of a length that can be seen
  const int step = camera.width / 14;
  SvgDrawing drawing(3 * camera.width + 40, camera.height + 40);
  for (int axis = 0; axis < 3; ++axis) {
    const double left = 10 + axis * (camera.width + 10), top = 10;
    drawing.polygon({{left, top},
                     {left + camera.width, top},
                     {left + camera.width, top + camera.height},
                     {left, top + camera.height}},
                    "none", fmt::format("stroke=\"{}\"", palette::kGrey));
    for (int v = step / 2; v < camera.height; v += step)
      for (int u = step / 2; u < camera.width; u += step) {
        const Eigen::Vector2d flow = kTurn * flowMatrix(camera, {u, v}).col(axis);
        drawing.line(left + u, top + v, left + u + flow.x(), top + v + flow.y(), palette::kBlue);
        drawing.circle(left + u, top + v, 1.6, palette::kBlue);
      }
    drawing.text(left, top + camera.height + 20, axes[axis]);
  }
  return drawing.finish();
}

Panel figure5(const PinholeCamera &camera)
{
  return {{{"figure-5.svg", basisFlowsSvg(camera)}},
          "The paper draws the three basis flows of a turn, the columns of V, on a sphere. Here they stand on the "
          "picture of the camera in use, in pixels (Eq. 14); the arrows are those of a turn of 0.06 rad."};
}

Panel figure6(const SeenFlight &flight)
{
  const PlanarTransform aligned = align(pairPoses(flight.smoothed, flight.truth), Alignment::xy_yaw);
  MapPicture picture;
  picture.title = flight.name;
  picture.truth = flight.truth;
  picture.truth_trunks = flight.trunks;
  for (const StampedPose &pose : flight.smoothed)
    picture.smoothed.push_back({pose.stamp_ns, aligned * pose.wMb});
  constexpr double kAround = 10; // [m] of the trajectory that the sheet shows
  Eigen::AlignedBox2d sheet;
  for (const StampedPose &pose : flight.truth)
    sheet.extend(Eigen::Vector2d(pose.wMb.t.head<2>()));
  int beyond = 0;
  for (TrunkRecord tree : flight.map) {
    tree.xy = aligned * tree.xy;
    if (tree.status == TrunkStatus::confirmed && !(sheet.exteriorDistance(tree.xy) < kAround)) {
      ++beyond;
      continue;
    }
    tree.covariance.topLeftCorner<2, 2>() = aligned.linear() * tree.covarianceXy() * aligned.linear().transpose();
    picture.trunks.push_back(tree);
  }
  const auto trees = std::count_if(flight.map.begin(), flight.map.end(),
                                   [](const TrunkRecord &tree) { return tree.status == TrunkStatus::confirmed; });
  return {
      {{"figure-6.svg", toSvg(picture)}},
      fmt::format("The paper shows true trees (green) and mapped ones (red) with the trajectory, the map moved onto "
                  "the truth by hand. Here the map is moved by least squares over the trajectory, in x, y and yaw. "
                  "The map has {} trees, those that stand twice too; {} of them stand for a trunk of their own, and {} "
                  "stand farther than {:g} m from the trajectory, beyond the sheet.",
                  trees, flight.right.size(), beyond, kAround)};
}

std::vector<Panel> figure7(const SeenFlight &flight)
{
  std::vector<Panel> panels;
  const std::size_t count = flight.frames.size();
  for (std::size_t part = 0; part < 3; ++part) {
    const std::size_t at = bestOf(part * count / 3, (part + 1) * count / 3,
                                  [&](std::size_t i) { return countRight(flight, flight.frames[i]); });
    const int right = countRight(flight, flight.frames[at]);
    panels.push_back(
        panelOf(flight, at, fmt::format("figure-7{}", "abc"[part]),
                right > 0 ? fmt::format("The paper shows successful detection and local map estimation. Here {} of the "
                                        "trees tracked in this frame prove to be trunks, the most of this third of the "
                                        "flight.",
                                        right)
                          : "The paper shows successful detection and local map estimation. In this third of the "
                            "flight no tree was tracked that proves to be a trunk."));
  }
  const std::size_t ahead = bestOf(1, count, [&](std::size_t i) {
    double sum = 0;
    for (const TrueView &missed : missedAhead(flight, i))
      sum += 1 / missed.range;
    return sum;
  });
  const std::vector<TrueView> missed = missedAhead(flight, ahead);
  panels.push_back(panelOf(
      flight, ahead, "figure-7d-parallax",
      missed.empty() ? "The paper shows trees that are not detected for lack of parallax. This flight has none: every "
                       "near trunk straight ahead was covered by a tree."
                     : fmt::format("The paper shows trees that are not detected \"due to lack of sufficient motion "
                                   "parallax\". Here too: {} true trunk{} nearer than {:g} m within 9 degrees of the "
                                   "way, the nearest at {:.1f} m, and no tree there.",
                                   missed.size(), missed.size() == 1 ? "" : "s", kNear, missed.front().range)));
  const std::size_t end = bestOf(1, count, [&](std::size_t i) { return -nearestBehindAnEnd(flight, i); });
  const double apart = nearestBehindAnEnd(flight, end);
  panels.push_back(panelOf(
      flight, end, "figure-7d-uncovered",
      apart >= 1 ? "The paper shows a near tree whose tracking fails when a far one is uncovered beside it. In this "
                   "flight no near tree that proves to be a trunk ended."
                 : fmt::format("The paper shows a near tree whose tracking fails \"due to revealing of an occluded "
                               "faraway tree\". The tree drawn red ends in this frame, its energy not convex any more, "
                               "with a farther true trunk {:.1f} px beside its border.",
                               apart * flight.camera.fx)));
  return panels;
}

std::vector<Panel> figure8(const SeenFlight &flight)
{
  std::vector<Panel> panels;
  const std::size_t count = flight.frames.size();
  for (std::size_t part = 0; part < 2; ++part) {
    const std::size_t at =
        bestOf(part * count / 2, (part + 1) * count / 2, [&](std::size_t i) { return newIn(flight, i).size(); });
    const SeenFrame &frame = flight.frames[at];
    if (!frame.report.saliency)
      continue;
    const vpImage<float> &p = frame.report.saliency->p_background;
    vpImage<unsigned char> near(p.getHeight(), p.getWidth());
    for (unsigned i = 0; i < p.getSize(); ++i)
      near.bitmap[i] = static_cast<unsigned char>(std::lround(255 * (1 - p.bitmap[i])));
    cv::Mat image = canvasOf(frame.image), saliency = canvasOf(near);
    const std::vector<int> ids = newIn(flight, at);
    for (const TrunkInView &tree : frame.report.trunks)
      if (std::find(ids.begin(), ids.end(), tree.id) != ids.end())
        for (cv::Mat *canvas : {&image, &saliency})
          drawBorders(*canvas, flight.camera, tree.relative, kWholeLine, kCyan);
    panels.push_back(
        {{{fmt::format("figure-8{}.png", "ab"[part]), pngOf(image)},
          {fmt::format("figure-8{}-saliency.png", "ab"[part]), pngOf(saliency)}},
         fmt::format("Frame {}. The paper shows pictures beside their saliency, near things white, with the "
                     "newly detected trees in cyan, and calls it a good predictor for near trees. Here {} "
                     "of the {} new trees prove{} to be trunks.",
                     at, std::count_if(ids.begin(), ids.end(), [&](int id) { return isRight(flight, id); }), ids.size(),
                     ids.size() == 1 ? "s" : "")});
  }
  return panels;
}
} // namespace bole::apps
