// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/map_svg.h"

#include "input/atomic_file.h"
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
constexpr double kPixelsPerMetre = 40, kMargin = 1.5; // [m]

/// x to the right is the world's x, up is the world's y; the legend stands above.
struct Sheet
{
  Eigen::AlignedBox2d box;
  double top = 0; ///< of the map [px]
  double x(double wx) const { return (wx - box.min().x()) * kPixelsPerMetre; }
  double y(double wy) const { return top + (box.max().y() - wy) * kPixelsPerMetre; }
  double width() const { return box.sizes().x() * kPixelsPerMetre; }
  double height() const { return top + box.sizes().y() * kPixelsPerMetre; }
};

/// Labels beside their trunks, at the first of some places that no other label and no trunk takes.
class Labels
{
public:
  explicit Labels(const Sheet &sheet) : m_sheet(sheet) {}

  void avoid(double x, double y, double radius)
  {
    m_taken.push_back(boxOf(x - radius, y - radius, x + radius, y + radius));
  }
  void add(SvgDrawing &drawing, double x, double y, double radius, const std::string &text)
  {
    const double width = 6.5 * static_cast<double>(text.size()), height = 11, off = 0.75 * radius + 2;
    const Eigen::AlignedBox2d sheet = boxOf(0, m_sheet.top, m_sheet.width(), m_sheet.height());
    for (const double far : {1.0, 2.0, 3.0})
      for (const auto &[right, down] : {std::pair(1, -1), {1, 1}, {-1, -1}, {-1, 1}}) {
        const double left = right > 0 ? x + far * off : x - far * off - width;
        const double base = down > 0 ? y + far * off + height : y - far * off;
        const Eigen::AlignedBox2d box = boxOf(left, base - height, left + width, base);
        if (!sheet.contains(box) || std::any_of(m_taken.begin(), m_taken.end(), [&](const Eigen::AlignedBox2d &taken) {
              return !taken.intersection(box).isEmpty();
            }))
          continue;
        m_taken.push_back(box);
        drawing.text(left, base - 1, text);
        return;
      }
  }

private:
  static Eigen::AlignedBox2d boxOf(double x0, double y0, double x1, double y1)
  {
    return {Eigen::Vector2d(x0, y0), Eigen::Vector2d(x1, y1)};
  }
  const Sheet &m_sheet;
  std::vector<Eigen::AlignedBox2d> m_taken;
};

Sheet sheetFor(const MapPicture &picture)
{
  Sheet sheet;
  for (const Trajectory *path : {&picture.smoothed, &picture.online, &picture.odometry, &picture.truth})
    for (const auto &stamped : *path)
      sheet.box.extend(Eigen::Vector2d(stamped.wMb.t.head<2>()));
  for (const TrunkRecord &trunk : picture.trunks)
    if (trunk.status == TrunkStatus::confirmed)
      sheet.box.extend(trunk.xy);
  if (sheet.box.isEmpty())
    sheet.box.extend(Eigen::Vector2d::Zero());
  constexpr double kLeast = 13; // [m] on the sheet: the legend's longest line
  const double wider = std::max(kMargin, (kLeast - sheet.box.sizes().x()) / 2);
  sheet.box.extend(Eigen::Vector2d(sheet.box.min() - Eigen::Vector2d(wider, kMargin)));
  sheet.box.extend(Eigen::Vector2d(sheet.box.max() + Eigen::Vector2d(wider, kMargin)));
  return sheet;
}

SvgPoints path(const Sheet &sheet, const Trajectory &trajectory)
{
  SvgPoints points;
  for (const auto &stamped : trajectory)
    points.emplace_back(sheet.x(stamped.wMb.t.x()), sheet.y(stamped.wMb.t.y()));
  return points;
}

void drawGrid(SvgDrawing &drawing, const Sheet &sheet)
{
  constexpr const char *kLine = "#e4e4e4", *kLabel = "style=\"fill:#999\"";
  for (const double m : gridBetween(sheet.box.min().x(), sheet.box.max().x())) {
    drawing.line(sheet.x(m), sheet.top, sheet.x(m), sheet.height(), kLine);
    if (std::fmod(m, 2) == 0)
      drawing.text(sheet.x(m) + 2, sheet.height() - 4, fmt::format("{:g} m", m), kLabel);
  }
  for (const double m : gridBetween(sheet.box.min().y(), sheet.box.max().y())) {
    drawing.line(0, sheet.y(m), sheet.width(), sheet.y(m), kLine);
    if (std::fmod(m, 2) == 0)
      drawing.text(3, sheet.y(m) - 3, fmt::format("{:g} m", m), kLabel);
  }
}

void drawTrunk(SvgDrawing &drawing, const Sheet &sheet, const TrunkRecord &record)
{
  const double x = sheet.x(record.xy.x()), y = sheet.y(record.xy.y()), r = record.radius * kPixelsPerMetre;
  if (record.status == TrunkStatus::candidate)
    drawing.circle(x, y, r, "none", fmt::format("stroke=\"{}\"", palette::kOrange));
  if (record.status != TrunkStatus::confirmed)
    return;
  drawing.add(sigmaEllipse(x, y, record.covarianceXy(), kPixelsPerMetre, palette::kVermilion));
  drawing.circle(x, y, r, palette::kVermilion, "fill-opacity=\".75\"");
}

/// Returns where it ends [px].
double drawLegend(SvgDrawing &drawing, const MapPicture &picture)
{
  drawing.text(10, 20, picture.title, "font-size=\"15\"");
  double y = 40;
  if (!picture.caption.empty()) {
    drawing.text(10, y, picture.caption);
    y += 18;
  }
  const auto entry = [&](bool is_shown, const char *colour, const char *name) {
    if (!is_shown)
      return;
    drawing.box(10, y - 6, 18, 4, colour);
    drawing.text(34, y, name);
    y += 16;
  };
  const bool has_candidates = std::any_of(picture.trunks.begin(), picture.trunks.end(), [](const TrunkRecord &record) {
    return record.status == TrunkStatus::candidate;
  });
  if (!picture.has_ranges) {
    entry(true, palette::kVermilion, "trunks: bearing and width, at no known distance");
    return y;
  }
  entry(true, palette::kVermilion, "trunks, two sigma");
  entry(has_candidates, palette::kOrange, "candidates, not confirmed");
  entry(!picture.truth_trunks.empty(), palette::kGreen, "trunks, truth");
  entry(!picture.smoothed.empty(), palette::kBlue, "trajectory, smoothed");
  entry(!picture.online.empty(), palette::kSkyBlue, "trajectory, online");
  entry(!picture.odometry.empty(), palette::kGrey, "pose filter");
  entry(!picture.truth.empty(), palette::kGreen, "trajectory, truth");
  return y;
}

/// What a camera that only rotated knows: a wedge for each trunk, from bearing to bearing of its borders.
std::string bearingsSvg(const MapPicture &picture)
{
  constexpr double kSide = 520, kRadius = 200, kX = kSide / 2, kY = kX + 40;
  SvgDrawing drawing(kSide, kSide + 40);
  drawing.circle(kX, kY, kRadius, "none", "stroke=\"#e4e4e4\"");
  for (const TrunkRecord &record : picture.trunks) {
    const Eigen::Vector2d to = record.xy - picture.camera;
    if (record.status != TrunkStatus::confirmed || !(to.norm() > 0))
      continue;
    const double bearing = std::atan2(to.y(), to.x()), half = std::asin(std::min(0.99, record.radius / to.norm()));
    const auto at = [](double angle, double r) {
      return std::pair(kX + r * std::cos(angle), kY - r * std::sin(angle));
    };
    drawing.polygon({{kX, kY}, at(bearing - half, kRadius), at(bearing + half, kRadius)}, palette::kVermilion,
                    "fill-opacity=\".6\"");
    const auto [x, y] = at(bearing, kRadius + 14);
    drawing.text(x, y, fmt::format("{}", record.id), "text-anchor=\"middle\"");
  }
  drawLegend(drawing, picture);
  return drawing.finish();
}
} // namespace

std::string toSvg(const MapPicture &picture)
{
  if (!picture.has_ranges)
    return bearingsSvg(picture);
  Sheet sheet = sheetFor(picture);
  SvgDrawing only_legend(1, 1);
  sheet.top = drawLegend(only_legend, picture);
  SvgDrawing drawing(sheet.width(), sheet.height());
  drawGrid(drawing, sheet);
  for (const TruthTrunk &truth : picture.truth_trunks)
    if (sheet.box.contains(truth.xy))
      drawing.circle(sheet.x(truth.xy.x()), sheet.y(truth.xy.y()), std::max(truth.radius, 0.05) * kPixelsPerMetre,
                     palette::kGreen, fmt::format("fill-opacity=\".35\" stroke=\"{}\"", palette::kGreen));
  drawing.polyline(path(sheet, picture.truth), palette::kGreen, "stroke-width=\"2\"");
  drawing.polyline(path(sheet, picture.odometry), palette::kGrey, "stroke-dasharray=\"2 3\"");
  drawing.polyline(path(sheet, picture.online), palette::kSkyBlue);
  drawing.polyline(path(sheet, picture.smoothed), palette::kBlue, "stroke-width=\"2\"");
  Labels labels(sheet);
  for (const TrunkRecord &record : picture.trunks) {
    drawTrunk(drawing, sheet, record);
    if (record.status == TrunkStatus::confirmed)
      labels.avoid(sheet.x(record.xy.x()), sheet.y(record.xy.y()), 0.7 * record.radius * kPixelsPerMetre);
  }
  for (const TrunkRecord &record : picture.trunks)
    if (record.status == TrunkStatus::confirmed)
      labels.add(drawing, sheet.x(record.xy.x()), sheet.y(record.xy.y()), record.radius * kPixelsPerMetre,
                 fmt::format("{}", record.id));
  drawLegend(drawing, picture);
  return drawing.finish();
}

void writeMap(const std::string &path, const MapPicture &picture) { writeAtomically(path, toSvg(picture)); }
} // namespace bole
