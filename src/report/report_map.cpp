// SPDX-License-Identifier: GPL-2.0-or-later
#include "report/report_drawings.h"

#include "output/palette.h"
#include "output/svg.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr double kUnits = 100;        // a metre
constexpr std::size_t kMost = 4000;   // points of a line: more are not seen and cost time
constexpr std::size_t kEllipses = 30; // of the trajectory

struct Layer
{
  const char *id, *name, *colour;
  std::string content;
  bool is_shown = true;
};

SvgPoints lineOf(const Trajectory &trajectory)
{
  SvgPoints points;
  const std::size_t step = trajectory.size() / kMost + 1;
  for (std::size_t i = 0; i < trajectory.size(); i += step)
    points.emplace_back(kUnits * trajectory[i].wMb.t.x(), -kUnits * trajectory[i].wMb.t.y());
  return points;
}

std::string polyline(const Trajectory &trajectory, const char *colour, const char *style)
{
  std::string points;
  for (const auto &[x, y] : lineOf(trajectory))
    points += fmt::format("{:.1f},{:.1f} ", x, y);
  return fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" {}/>\n", points, colour, style);
}

std::string ellipse(const Eigen::Vector2d &at, const Eigen::Matrix2d &covariance, const char *colour)
{
  return sigmaEllipse(kUnits * at.x(), -kUnits * at.y(), covariance, kUnits, colour);
}

std::string circle(const Eigen::Vector2d &at, double radius, const std::string &style)
{
  return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" {}/>\n", kUnits * at.x(), -kUnits * at.y(),
                     kUnits * radius, style);
}

std::string label(const Eigen::Vector2d &at, double radius, int id)
{
  const double x = kUnits * at.x(), y = -kUnits * at.y(), r = 0.7 * kUnits * radius; // beside the circle
  return fmt::format(
      "<text x=\"{:.1f}\" y=\"{:.1f}\" data-x=\"{:.1f}\" data-y=\"{:.1f}\" data-r=\"{:.1f}\">{}</text>\n", x + r, y - r,
      x, y, r, id);
}

std::string evidence(const GroundEvidence &evidence)
{
  const auto squares = evidence.squares();
  int most = 1;
  for (const auto &square : squares)
    most = std::max(most, square.second);
  constexpr double kSide = kUnits * GroundEvidence::kSide;
  std::string content;
  for (const auto &[middle, count] : squares)
    if (count > 1) // a single point is noise more often than not
      content += fmt::format("<path d=\"M{:.0f} {:.0f}h{:.0f}v{:.0f}h-{:.0f}z\" fill-opacity=\"{:.2f}\"/>",
                             kUnits * middle.x() - kSide / 2, -kUnits * middle.y() - kSide / 2, kSide, kSide, kSide,
                             0.15 + 0.85 * std::log(double(count)) / std::log(most + 1.0));
  return content;
}

Eigen::AlignedBox2d boxOf(const RunRecord &run)
{
  Eigen::AlignedBox2d box;
  for (const Trajectory *path : {&run.smoothed, &run.online})
    for (const StampedPose &pose : *path)
      box.extend(Eigen::Vector2d(pose.wMb.t.head<2>()));
  for (const TrunkRecord &trunk : run.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      box.extend(trunk.xy);
  if (box.isEmpty())
    box.extend(Eigen::Vector2d::Zero());
  const Eigen::Vector2d margin = Eigen::Vector2d::Constant(1);
  return {box.min() - margin, box.max() + margin};
}

std::string gridOf(const Eigen::AlignedBox2d &box)
{
  const double size = box.sizes().maxCoeff();
  const std::vector<double> ticks = ticksBetween(0, size);
  const double step = std::max(1.0, ticks.size() > 1 ? ticks[1] - ticks[0] : 1);
  std::string content;
  const Eigen::Vector2d low = (box.min() - box.sizes()) / step, high = (box.max() + box.sizes()) / step;
  for (double i = std::ceil(low.x()); i <= high.x(); ++i)
    content +=
        fmt::format("M{:.0f} {:.0f}V{:.0f}", kUnits * step * i, -kUnits * step * low.y(), -kUnits * step * high.y());
  for (double i = std::ceil(low.y()); i <= high.y(); ++i)
    content +=
        fmt::format("M{:.0f} {:.0f}H{:.0f}", kUnits * step * low.x(), -kUnits * step * i, kUnits * step * high.x());
  return fmt::format("<path d=\"{}\" stroke=\"#e4e4e4\" fill=\"none\"/>\n", content);
}

std::string covariances(const FlightTrace &trace)
{
  std::string content;
  for (std::size_t i = 0; i < trace.frames.size(); i += trace.frames.size() / kEllipses + 1)
    content += ellipse(trace.frames[i].place.head<2>(), trace.frames[i].covariance_xy, palette::kSkyBlue);
  return content;
}

std::vector<Layer> layersOf(const RunRecord &run, const Eigen::AlignedBox2d &box)
{
  const Eigen::AlignedBox2d wide(box.min() - box.sizes(), box.max() + box.sizes());
  std::string trunks, candidates, sigmas, truth;
  for (const TrunkRecord &trunk : run.trunks) {
    if (trunk.status == TrunkStatus::confirmed) {
      sigmas += ellipse(trunk.xy, trunk.covarianceXy(), palette::kVermilion);
      trunks +=
          fmt::format("<g class=\"trunk\" data-id=\"{0}\" tabindex=\"0\" role=\"button\" aria-label=\"trunk "
                      "{0}\"><circle class=\"reach\" cx=\"{1:.1f}\" cy=\"{2:.1f}\" r=\"{3:.1f}\"/>",
                      trunk.id, kUnits * trunk.xy.x(), -kUnits * trunk.xy.y(), kUnits * std::max(0.4, trunk.radius)) +
          circle(trunk.xy, trunk.radius, fmt::format("fill=\"{}\"", palette::kVermilion)) +
          label(trunk.xy, trunk.radius, trunk.id) + "</g>\n";
    }
    else if (trunk.status == TrunkStatus::candidate && wide.contains(trunk.xy))
      candidates += circle(trunk.xy, trunk.radius, fmt::format("fill=\"none\" stroke=\"{}\"", palette::kOrange));
  }
  for (const TruthTrunk &trunk : run.truth_trunks)
    if (wide.contains(trunk.xy))
      truth += circle(trunk.xy, std::max(trunk.radius, 0.05),
                      fmt::format("fill=\"{0}\" fill-opacity=\".35\" stroke=\"{0}\"", palette::kGreen));
  const auto path = [](const Trajectory &trajectory, const char *colour, const char *style) {
    return trajectory.empty() ? std::string() : polyline(trajectory, colour, style);
  };
  return {
      {"grid", "grid", "#e4e4e4", gridOf(box)},
      {"evidence", "points with a parallax", palette::kGrey, evidence(run.trace.evidence)},
      {"truth", "trunks, truth", palette::kGreen, truth},
      {"truth-path", "trajectory, truth", palette::kGreen,
       path(run.truth, palette::kGreen, "stroke-width=\"2\" stroke-dasharray=\"6 3\"")},
      {"path-sigma", "two sigma of the online trajectory", palette::kSkyBlue, covariances(run.trace), false},
      {"online", "trajectory, online", palette::kSkyBlue, path(run.online, palette::kSkyBlue, "")},
      {"smoothed", "trajectory, smoothed", palette::kBlue, path(run.smoothed, palette::kBlue, "stroke-width=\"2\"")},
      {"candidates", "candidates, not confirmed", palette::kOrange, candidates},
      {"trunk-sigma", "two sigma of trunks", palette::kVermilion, sigmas},
      {"trunks", "trunks", palette::kVermilion, trunks}};
}
} // namespace

std::string mapHtml(const RunRecord &run)
{
  const Eigen::AlignedBox2d box = boxOf(run);
  std::string svg = fmt::format(
      "<div id=\"mapbox\"><svg id=\"map\" xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"{:.0f} {:.0f} {:.0f} {:.0f}\" "
      "role=\"img\" aria-label=\"map of the trunks seen from above\">\n",
      kUnits * box.min().x(), -kUnits * box.max().y(), kUnits * box.sizes().x(), kUnits * box.sizes().y());
  std::string legend = "<div id=\"legend\">";
  for (const Layer &layer : layersOf(run, box)) {
    if (layer.content.empty())
      continue;
    svg += fmt::format("<g id=\"layer-{}\"{}{}>\n{}</g>\n", layer.id, layer.is_shown ? "" : " style=\"display:none\"",
                       std::string(layer.id) == "evidence" ? fmt::format(" fill=\"{}\"", palette::kGrey) : "",
                       layer.content);
    legend += fmt::format("<label><input type=\"checkbox\" data-layer=\"layer-{}\"{}><i style=\"background:{}\"></i>"
                          "{}</label>\n",
                          layer.id, layer.is_shown ? " checked" : "", layer.colour, layer.name);
  }
  return svg +
         "</svg>\n<div id=\"zoom\"><button data-zoom=\".7\" aria-label=\"nearer\">+</button><button data-zoom=\"1.43\" "
         "aria-label=\"farther\">&minus;</button><button data-zoom=\"0\" aria-label=\"whole "
         "map\">&#8962;</button></div>"
         "<div id=\"scale\"></div></div>\n" +
         legend + "</div>\n";
}
} // namespace bole
