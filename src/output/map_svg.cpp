// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/map_svg.h"

#include "input/atomic_file.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr const char *kOrange = "#e69f00", *kSkyBlue = "#56b4e9", *kGreen = "#009e73", *kBlue = "#0072b2",
                     *kVermilion = "#d55e00", *kGrey = "#999999"; // of Okabe and Ito: the colour-blind tell them apart

using SvgPoints = std::vector<std::pair<double, double>>;

std::string pointsText(const SvgPoints &points)
{
  std::string text;
  for (const auto &[x, y] : points)
    text += fmt::format("{:.1f},{:.1f} ", x, y);
  return text;
}

/// Replaces the characters of \p text that mean something in XML.
std::string escaped(const std::string &text)
{
  std::string xml;
  for (const char c : text)
    xml += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return xml;
}

/// Draws shapes on a white sheet, whose coordinates are pixels with y down. \p style holds further attributes, such as
/// `fill-opacity=".5"`.
class SvgDrawing
{
public:
  SvgDrawing(double width, double height)
      : m_text(fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                           "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"11\">\n"
                           "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                           width, height))
  {
  }

  void line(double x0, double y0, double x1, double y1, const char *colour, const std::string &style = {})
  {
    m_text += fmt::format("<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" stroke=\"{}\" {}/>\n", x0, y0,
                          x1, y1, colour, style);
  }

  void polyline(const SvgPoints &points, const char *colour, const std::string &style = {})
  {
    if (!points.empty())
      m_text +=
          fmt::format("<polyline points=\"{}\" fill=\"none\" stroke=\"{}\" {}/>\n", pointsText(points), colour, style);
  }

  void polygon(const SvgPoints &points, const char *colour, const std::string &style = {})
  {
    m_text += fmt::format("<polygon points=\"{}\" fill=\"{}\" {}/>\n", pointsText(points), colour, style);
  }

  void circle(double x, double y, double radius, const char *fill, const std::string &style = {})
  {
    m_text +=
        fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"{}\" {}/>\n", x, y, radius, fill, style);
  }

  void box(double x, double y, double width, double height, const char *fill)
  {
    m_text += fmt::format("<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.2f}\" height=\"{:.1f}\" fill=\"{}\"/>\n", x, y,
                          width, height, fill);
  }

  void text(double x, double y, const std::string &text, const std::string &style = {})
  {
    m_text += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#222\" {}>{}</text>\n", x, y, style, escaped(text));
  }
  void add(const std::string &element) { m_text += element; }
  std::string finish() const { return m_text + "</svg>\n"; }

private:
  std::string m_text;
};

/// Draws the ellipse of two sigma of \p covariance round the point (\p x, \p y) of the drawing. A unit of the
/// covariance is \p scale px, and its second axis points up.
std::string sigmaEllipse(double x, double y, const Eigen::Matrix2d &covariance, double scale, const char *colour)
{
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(covariance);
  const Eigen::Vector2d axes = 2 * scale * eigen.eigenvalues().cwiseMax(0).cwiseSqrt();
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);
  return fmt::format("<ellipse rx=\"{0:.1f}\" ry=\"{1:.1f}\" transform=\"translate({2:.1f} {3:.1f}) rotate({4:.1f})\" "
                     "fill=\"{5}\" fill-opacity=\".15\" stroke=\"{5}\" stroke-opacity=\".6\"/>\n",
                     axes(1), axes(0), x, y, -std::atan2(major.y(), major.x()) * 180 / M_PI, colour);
}

/// Returns about five round values between \p low and \p high, for the ticks of an axis.
std::vector<double> ticksBetween(double low, double high)
{
  const double raw = std::max(high - low, 1e-9) / 5, base = std::pow(10, std::floor(std::log10(raw)));
  const double step = base * (raw / base < 1.5 ? 1 : raw / base < 3.5 ? 2 : raw / base < 7.5 ? 5 : 10);
  constexpr int kMost = 12; // far from zero a step may change nothing
  const double first = std::ceil(low / step);
  std::vector<double> ticks;
  for (int i = 0; i < kMost && (first + i) * step <= high + 1e-9 * step; ++i)
    ticks.push_back((first + i) * step + 0.0); // no -0
  return ticks;
}

/// Returns every metre between \p low and \p high, or ticksBetween() where the map is longer than 300 m.
std::vector<double> gridBetween(double low, double high)
{
  constexpr double kMostLines = 300;
  if (!(high - low < kMostLines))
    return ticksBetween(low, high);
  std::vector<double> lines;
  for (double m = std::ceil(low); m <= high && lines.size() < kMostLines; ++m)
    lines.push_back(m);
  return lines;
}

constexpr double kPixelsPerMetre = 40, kMargin = 1.5; // [m]

/// The sheet shows the world's x to the right and its y upwards; the legend stands above the map.
struct Sheet
{
  Eigen::AlignedBox2d box;
  double top = 0; ///< of the map [px]
  double x(double wx) const { return (wx - box.min().x()) * kPixelsPerMetre; }
  double y(double wy) const { return top + (box.max().y() - wy) * kPixelsPerMetre; }
  double width() const { return box.sizes().x() * kPixelsPerMetre; }
  double height() const { return top + box.sizes().y() * kPixelsPerMetre; }
};

/// Places each label beside its trunk, at the first of some places that no other label and no trunk takes.
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
    drawing.circle(x, y, r, "none", fmt::format("stroke=\"{}\"", kOrange));
  if (record.status != TrunkStatus::confirmed)
    return;
  drawing.add(sigmaEllipse(x, y, record.covarianceXy(), kPixelsPerMetre, kVermilion));
  drawing.circle(x, y, r, kVermilion, "fill-opacity=\".75\"");
}

/// Draws the legend and returns where it ends [px].
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
    entry(true, kVermilion, "trunks: bearing and width, at no known distance");
    return y;
  }
  entry(true, kVermilion, "trunks, two sigma");
  entry(has_candidates, kOrange, "candidates, not confirmed");
  entry(!picture.truth_trunks.empty(), kGreen, "trunks, truth");
  entry(!picture.smoothed.empty(), kBlue, "trajectory, smoothed");
  entry(!picture.online.empty(), kSkyBlue, "trajectory, online");
  entry(!picture.odometry.empty(), kGrey, "pose filter");
  entry(!picture.truth.empty(), kGreen, "trajectory, truth");
  return y;
}

/// Draws what a camera that only rotated knows: a wedge for each trunk, from bearing to bearing of its borders.
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
    drawing.polygon({{kX, kY}, at(bearing - half, kRadius), at(bearing + half, kRadius)}, kVermilion,
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
                     kGreen, fmt::format("fill-opacity=\".35\" stroke=\"{}\"", kGreen));
  drawing.polyline(path(sheet, picture.truth), kGreen, "stroke-width=\"2\"");
  drawing.polyline(path(sheet, picture.odometry), kGrey, "stroke-dasharray=\"2 3\"");
  drawing.polyline(path(sheet, picture.online), kSkyBlue);
  drawing.polyline(path(sheet, picture.smoothed), kBlue, "stroke-width=\"2\"");
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
