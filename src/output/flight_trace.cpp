// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/flight_trace.h"

#include "input/atomic_file.h"
#include "input/csv_reader.h"
#include "output/trajectory_writer.h"

#include <cmath>
#include <fmt/format.h>
#include <iterator>

namespace bole
{
namespace
{
constexpr const char *kFramesHeader = "frame,stamp,status,x,y,z,var_xx,var_xy,var_yy,reason";
constexpr const char *kViewsHeader = "frame,stamp,id,range,sigma_range,radius,sigma_radius,x,y,sigma_x,sigma_y";
constexpr const char *kEvidenceHeader = "x,y,points";
} // namespace

void GroundEvidence::add(const Eigen::Vector3d &point, int count)
{
  m_counts[{static_cast<int>(std::floor(point.x() / kSide)), static_cast<int>(std::floor(point.y() / kSide))}] += count;
}

std::vector<std::pair<Eigen::Vector2d, int>> GroundEvidence::squares() const
{
  std::vector<std::pair<Eigen::Vector2d, int>> squares;
  for (const auto &[cell, count] : m_counts)
    squares.emplace_back(Eigen::Vector2d((cell.first + 0.5) * kSide, (cell.second + 0.5) * kSide), count);
  return squares;
}

void writeTrace(const std::string &folder, const FlightTrace &trace)
{
  std::string text = fmt::format("{}\n# units,s,,m,m,m,m^2,m^2,m^2,\n", kFramesHeader);
  for (const FrameTrace &frame : trace.frames)
    fmt::format_to(std::back_inserter(text), "{},{},{},{:.4f},{:.4f},{:.4f},{:.4e},{:.4e},{:.4e},{}\n", frame.index,
                   secondsText(frame.stamp_ns), toString(frame.status), frame.place.x(), frame.place.y(),
                   frame.place.z(), frame.covariance_xy(0, 0), frame.covariance_xy(0, 1), frame.covariance_xy(1, 1),
                   csvField(frame.reason));
  writeAtomically(folder + "/frames.csv", text);

  text = fmt::format("{}\n# units,s,,m,m,m,m,m,m,m,m\n", kViewsHeader);
  for (const TrunkTrace &view : trace.views)
    fmt::format_to(std::back_inserter(text), "{},{},{},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f},{:.4f}\n",
                   view.frame, secondsText(view.stamp_ns), view.id, view.range, view.range_sigma, view.radius,
                   view.radius_sigma, view.xy.x(), view.xy.y(), view.xy_sigma.x(), view.xy_sigma.y());
  writeAtomically(folder + "/views.csv", text);

  text = fmt::format("{}\n# units m,m,1: points with a parallax in a square of {} m round x, y\n", kEvidenceHeader,
                     GroundEvidence::kSide);
  for (const auto &[middle, count] : trace.evidence.squares())
    fmt::format_to(std::back_inserter(text), "{:.2f},{:.2f},{}\n", middle.x(), middle.y(), count);
  writeAtomically(folder + "/evidence.csv", text);
}

std::vector<FrameTrace> readFrames(const std::string &folder)
{
  std::vector<FrameTrace> traces;
  CsvReader frames(folder + "/frames.csv", {10, ',', kFramesHeader});
  while (frames.next()) {
    FrameTrace frame;
    frame.index = static_cast<std::size_t>(frames.integer(0, "frame"));
    frame.stamp_ns = frames.risingStampFromSeconds(1);
    frame.status = frames.named(2, "status", FrameStatus::doubtful);
    frame.place = {frames.number(3, "x"), frames.number(4, "y"), frames.number(5, "z")};
    const double xy = frames.number(7, "var_xy");
    frame.covariance_xy << frames.number(6, "var_xx"), xy, xy, frames.number(8, "var_yy");
    frame.reason = frames.text(9);
    traces.push_back(frame);
  }
  return traces;
}

FlightTrace readTrace(const std::string &folder)
{
  constexpr double kFarthest_m = 1e6, kFarthest_s = 4e9;
  FlightTrace trace;
  trace.frames = readFrames(folder);
  CsvReader views(folder + "/views.csv", {11, ',', kViewsHeader});
  while (views.next()) {
    TrunkTrace view;
    view.frame = static_cast<std::size_t>(views.integer(0, "frame"));
    view.stamp_ns = static_cast<std::int64_t>(std::llround(1e9 * views.number(1, "stamp", kFarthest_s)));
    view.id = views.count(2, "id");
    view.range = views.number(3, "range");
    view.range_sigma = views.number(4, "sigma_range");
    view.radius = views.number(5, "radius");
    view.radius_sigma = views.number(6, "sigma_radius");
    view.xy = {views.number(7, "x"), views.number(8, "y")};
    view.xy_sigma = {views.number(9, "sigma_x"), views.number(10, "sigma_y")};
    trace.views.push_back(view);
  }
  CsvReader evidence(folder + "/evidence.csv", {3, ',', kEvidenceHeader});
  while (evidence.next())
    trace.evidence.add({evidence.number(0, "x", kFarthest_m), evidence.number(1, "y", kFarthest_m), 0},
                       evidence.count(2, "points"));
  return trace;
}
} // namespace bole
