// SPDX-License-Identifier: GPL-2.0-or-later
#include "output/timing_csv.h"

#include "geometry/median.h"
#include "input/atomic_file.h"

#include <fmt/format.h>
#include <iterator>

namespace bole
{
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
} // namespace bole
