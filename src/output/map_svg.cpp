// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/map_svg.h"

#include "output/atomic_file.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace bole
{
namespace
{
constexpr double kPixelsPerMetre = 40, kMargin = 1.5; // [m]

/// x to the right is the world's x, up is the world's y.
struct Sheet
{
  Eigen::AlignedBox2d box;
  double x(double wx) const { return (wx - box.min().x()) * kPixelsPerMetre; }
  double y(double wy) const { return (box.max().y() - wy) * kPixelsPerMetre; }
  double width() const { return box.sizes().x() * kPixelsPerMetre; }
  double height() const { return box.sizes().y() * kPixelsPerMetre; }
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
  sheet.box.extend(Eigen::Vector2d(sheet.box.min() - Eigen::Vector2d::Constant(kMargin)));
  sheet.box.extend(Eigen::Vector2d(sheet.box.max() + Eigen::Vector2d::Constant(kMargin)));
  return sheet;
}

std::string path(const Sheet &sheet, const Trajectory &trajectory, const char *style)
{
  if (trajectory.empty())
    return {};
  std::string points;
  for (const auto &stamped : trajectory)
    points += fmt::format("{:.1f},{:.1f} ", sheet.x(stamped.wMb.t.x()), sheet.y(stamped.wMb.t.y()));
  return fmt::format("<polyline points=\"{}\" fill=\"none\" {}/>\n", points, style);
}

std::string grid(const Sheet &sheet)
{
  std::string lines;
  const auto label = [](double x, double y, double metres) {
    return fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#999\">{:g} m</text>\n", x, y, metres);
  };
  for (double m = std::ceil(sheet.box.min().x()); m <= sheet.box.max().x(); ++m) {
    lines += fmt::format("<path d=\"M{0:.1f} 0V{1:.1f}\"/>\n", sheet.x(m), sheet.height());
    if (std::fmod(m, 2) == 0)
      lines += label(sheet.x(m) + 2, sheet.height() - 4, m);
  }
  for (double m = std::ceil(sheet.box.min().y()); m <= sheet.box.max().y(); ++m) {
    lines += fmt::format("<path d=\"M0 {0:.1f}H{1:.1f}\"/>\n", sheet.y(m), sheet.width());
    if (std::fmod(m, 2) == 0)
      lines += label(3, sheet.y(m) - 3, m);
  }
  return "<g stroke=\"#e4e4e4\" stroke-width=\"1\">" + lines + "</g>\n";
}

std::string ellipse(const Sheet &sheet, const TrunkRecord &trunk)
{
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> eigen(trunk.covariance_xy);
  const Eigen::Vector2d axes = 2 * eigen.eigenvalues().cwiseMax(0).cwiseSqrt() * kPixelsPerMetre;
  const Eigen::Vector2d major = eigen.eigenvectors().col(1);
  return fmt::format(
      "<ellipse cx=\"0\" cy=\"0\" rx=\"{:.1f}\" ry=\"{:.1f}\" transform=\"translate({:.1f} {:.1f}) "
      "rotate({:.1f})\" fill=\"#c0392b\" fill-opacity=\".15\" stroke=\"#c0392b\" stroke-opacity=\".6\"/>\n",
      axes(1), axes(0), sheet.x(trunk.xy.x()), sheet.y(trunk.xy.y()), -std::atan2(major.y(), major.x()) * 180 / M_PI);
}

std::string trunk(const Sheet &sheet, const TrunkRecord &record)
{
  const double x = sheet.x(record.xy.x()), y = sheet.y(record.xy.y()), r = record.radius * kPixelsPerMetre;
  if (record.status == TrunkStatus::candidate)
    return fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"none\" stroke=\"#e0a800\"/>\n", x, y,
                       r);
  if (record.status != TrunkStatus::confirmed)
    return {};
  return ellipse(sheet, record) +
         fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"#c0392b\" fill-opacity=\".75\"/>\n"
                     "<text x=\"{:.1f}\" y=\"{:.1f}\" fill=\"#7b241c\">{}</text>\n",
                     x, y, r, x + r + 3, y - r - 1, record.id);
}

std::string escaped(const std::string &text)
{
  std::string xml;
  for (const char c : text)
    xml += c == '<' ? "&lt;" : c == '>' ? "&gt;" : c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return xml;
}

std::string legend(const MapPicture &picture)
{
  std::string text =
      fmt::format("<text x=\"10\" y=\"20\" font-size=\"15\" fill=\"#222\">{}</text>\n", escaped(picture.title));
  double y = 40;
  if (!picture.caption.empty()) {
    text += fmt::format("<text x=\"10\" y=\"{:.0f}\" fill=\"#222\">{}</text>\n", y, picture.caption);
    y += 18;
  }
  const auto entry = [&](bool shown, const char *colour, const char *name) {
    if (!shown)
      return;
    text += fmt::format("<rect x=\"10\" y=\"{0:.0f}\" width=\"18\" height=\"4\" fill=\"{1}\"/>"
                        "<text x=\"34\" y=\"{2:.0f}\" fill=\"#222\">{3}</text>\n",
                        y - 6, colour, y, name);
    y += 16;
  };
  entry(true, "#c0392b", "trunks, two sigma");
  const bool has_candidates = std::any_of(picture.trunks.begin(), picture.trunks.end(), [](const TrunkRecord &record) {
    return record.status == TrunkStatus::candidate;
  });
  entry(has_candidates, "#e0a800", "candidates, not confirmed");
  entry(!picture.truth_trunks.empty(), "#27ae60", "trunks, truth");
  entry(!picture.smoothed.empty(), "#1f4e9e", "trajectory, smoothed");
  entry(!picture.online.empty(), "#7fa8e0", "trajectory, online");
  entry(!picture.odometry.empty(), "#aaaaaa", "pose filter");
  entry(!picture.truth.empty(), "#27ae60", "trajectory, truth");
  return text;
}
} // namespace

std::string toSvg(const MapPicture &picture)
{
  const Sheet sheet = sheetFor(picture);
  std::string svg = fmt::format("<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" "
                                "viewBox=\"0 0 {0:.0f} {1:.0f}\" font-family=\"sans-serif\" font-size=\"11\">\n"
                                "<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
                                sheet.width(), sheet.height());
  svg += grid(sheet);
  for (const TruthTrunk &truth : picture.truth_trunks)
    if (sheet.box.contains(truth.xy))
      svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:.1f}\" fill=\"#27ae60\" fill-opacity=\".35\" "
                         "stroke=\"#27ae60\"/>\n",
                         sheet.x(truth.xy.x()), sheet.y(truth.xy.y()), std::max(truth.radius, 0.05) * kPixelsPerMetre);
  svg += path(sheet, picture.truth, "stroke=\"#27ae60\" stroke-width=\"2\"");
  svg += path(sheet, picture.odometry, "stroke=\"#aaa\" stroke-dasharray=\"2 3\"");
  svg += path(sheet, picture.online, "stroke=\"#7fa8e0\"");
  svg += path(sheet, picture.smoothed, "stroke=\"#1f4e9e\" stroke-width=\"2\"");
  for (const TrunkRecord &record : picture.trunks)
    svg += trunk(sheet, record);
  return svg + legend(picture) + "</svg>\n";
}

void writeMap(const std::string &path, const MapPicture &picture) { writeAtomically(path, toSvg(picture)); }
} // namespace bole
