// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/flight_trace.h"

#include "geometry/failure.h"
#include "geometry/median.h"
#include "input/atomic_file.h"
#include "input/csv_reader.h"
#include "input/trajectory.h"

#include <algorithm>
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

namespace
{
std::vector<double> totals(const std::vector<FrameTiming> &frames)
{
  std::vector<double> values;
  for (const FrameTiming &frame : frames)
    values.push_back(frame.total_ms);
  return values;
}

std::vector<double> ofStage(const std::vector<FrameTiming> &frames, std::size_t stage)
{
  std::vector<double> values;
  for (const FrameTiming &frame : frames)
    if (stage < frame.stages_ms.size())
      values.push_back(frame.stages_ms[stage]);
  return values;
}
} // namespace

double TimingTable::medianTotal_ms() const { return quantileOf(totals(frames), 0.5); }

double TimingTable::percentile95_ms() const { return quantileOf(totals(frames), 0.95); }

double TimingTable::medianStage_ms(std::size_t stage) const { return quantileOf(ofStage(frames, stage), 0.5); }

std::optional<double> TimingTable::age_ms(double part) const
{
  std::vector<double> values;
  for (const FrameTiming &frame : frames)
    if (frame.age_ms)
      values.push_back(*frame.age_ms);
  return values.empty() ? std::nullopt : std::optional<double>(quantileOf(std::move(values), part));
}

std::string toText(const TimingTable &timing)
{
  std::string text = fmt::format("{:<12}{:>10}{:>10}{:>10}{:>10}\n", "[ms]", "median", "p95", "p99", "most");
  const auto add = [&text](const std::string &name, const std::vector<double> &values) {
    text += fmt::format("{:<12}", name);
    for (const double part : {0.5, 0.95, 0.99, 1.0})
      text += fmt::format("{:>10.3f}", quantileOf(values, part));
    text += '\n';
  };
  for (std::size_t i = 0; i < timing.stages.size(); ++i)
    add(timing.stages[i], ofStage(timing.frames, i));
  add("total", totals(timing.frames));
  return text;
}

void writeTiming(const std::string &path, const TimingTable &timing)
{
  std::string text = "frame,timestamp [s]";
  for (const std::string &stage : timing.stages)
    text += "," + stage + " [ms]";
  const bool has_ages = timing.age_ms(0).has_value();
  text += has_ages ? ",total [ms],age [ms]\n" : ",total [ms]\n";
  for (const FrameTiming &frame : timing.frames) {
    fmt::format_to(std::back_inserter(text), "{},{:.9f}", frame.index, static_cast<double>(frame.stamp_ns) * 1e-9);
    for (std::size_t i = 0; i < timing.stages.size(); ++i)
      fmt::format_to(std::back_inserter(text), ",{:.4f}", i < frame.stages_ms.size() ? frame.stages_ms[i] : 0.0);
    fmt::format_to(std::back_inserter(text), ",{:.4f}", frame.total_ms);
    if (has_ages)
      text += frame.age_ms ? fmt::format(",{:.4f}", *frame.age_ms) : ",";
    text += '\n';
  }
  writeAtomically(path, text);
}

TimingTable readTiming(const std::string &path)
{
  TimingTable timing;
  CsvReader csv(path, {3, ',', "frame,timestamp [s]"});
  const std::vector<std::string> &names = csv.header();
  const auto total = static_cast<std::size_t>(std::find(names.begin(), names.end(), "total [ms]") - names.begin());
  if (total == names.size())
    throw badValue("{}: has no column \"total [ms]\"", path);
  for (std::size_t i = 2; i < total; ++i)
    timing.stages.push_back(names[i].substr(0, names[i].find(" [")));
  while (csv.next()) {
    FrameTiming frame;
    frame.index = static_cast<std::size_t>(csv.integer(0, "frame"));
    for (std::size_t i = 2; i < total; ++i)
      frame.stages_ms.push_back(csv.number(i, "stage"));
    frame.total_ms = csv.number(total, "total");
    timing.frames.push_back(frame);
  }
  return timing;
}
} // namespace bole
