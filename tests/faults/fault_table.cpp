// SPDX-License-Identifier: GPL-2.0-or-later
// Every fault of the lists is put into a copy of a flight, `bole track` is run on it, and what came of it is judged.
//
//   fault_table BOLE FLIGHT WORK [--part N] [--only NAME...] [--table FILE]
//
// --part N takes every N-th fault that a map is compared for (what is refused and what ends early is all taken),
// --table writes the table for the documentation. Exit status 1 where a fault falls short that is not known to.
#include "fault_list.h"

#include "input/atomic_file.h"
#include "support/files.h"
#include "support/shell.h"
#include <bole/evaluation.h>

#include <algorithm>
#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <regex>
#include <set>
#include <sstream>
#include <visp3/core/vpException.h>

namespace
{
using namespace bole;
using namespace bole::faults;
namespace fs = std::filesystem;

constexpr double kLoss = 0.1 + 1e-9; ///< of recall or precision that a fault may cost in silence
constexpr double kSoon_s = 1;        ///< in which a fault must be named
constexpr double kFrame_s = 1 / kRate_hz;

/// What is known to fall short, with the reason in the documentation.
const std::set<std::string> kKnown = {"focal_unequal", "odometry_late_2s"};

/// No run may take longer, or more memory: a hang and a hoard are findings.
#if defined(__SANITIZE_ADDRESS__)
const char *const kBounds = "";
#else
const char *const kBounds = "ulimit -v 6000000; ";
#endif
const char *const kTimeout = "timeout -k 5 300 ";

/// How good a run is, and what it says went wrong.
struct Result
{
  int status = 0;
  double recall = 0, precision = 0, ate = 0;
  std::size_t frames = 0; ///< that were not used
  double named_s = -1;    ///< stamp of the first of these [s]; < 0: none
  std::string names;      ///< how they and the sensors are named
  std::string commit;     ///< of the program that made the run
};

/// \p text without what is in brackets, and without since when, against what, how exactly and what must be.
std::string shortened(const std::string &text)
{
  std::string out = std::regex_replace(text, std::regex(R"( \([^)]*\))"), "");
  for (const char *const end : {" since ", " against", ", must", ", by ", ", +-"})
    out.resize(std::min(out.size(), out.find(end)));
  return out;
}

/// Frames that frames.csv calls anything but ok.
void readFrames(const fs::path &run, double since_s, Result &result)
{
  std::ifstream file(run / "frames.csv");
  std::string line;
  std::getline(file, line);
  std::vector<std::string> names;
  while (std::getline(file, line)) {
    std::istringstream text(line);
    std::vector<std::string> fields;
    for (std::string field; std::getline(text, field, ',');)
      fields.push_back(field);
    if (line[0] == '#' || fields.size() < 3 || fields[2] == "ok")
      continue;
    ++result.frames;
    const double stamp_s = std::stod(fields[1]);
    if (result.named_s < 0 && stamp_s > since_s - kFrame_s)
      result.named_s = stamp_s;
    const std::string reason = fields.size() > 9 && !fields[9].empty() ? fields[9] : fields[2];
    std::string name = fields[2];
    if (name == "doubtful") { // without the figures in which frames differ
      name = shortened(reason);
      name.resize(std::min(name.size(), name.find_first_of(":0123456789")));
      for (const std::string end : {" ", " of", " by"})
        if (name.size() > end.size() && name.compare(name.size() - end.size(), end.size(), end) == 0)
          name.resize(name.size() - end.size());
    }
    if (std::find(names.begin(), names.end(), name) == names.end())
      names.push_back(name);
  }
  for (const std::string &name : names)
    result.names += (result.names.empty() ? "" : ", ") + name.substr(0, 40);
}

/// Times without a picture and sensors that are not believed.
void readSummary(const fs::path &run, Result &result)
{
  const auto add = [&result](double since_s, const std::string &text) {
    result.named_s = result.named_s < 0 ? since_s : std::min(result.named_s, since_s);
    if (result.names.find(text) == std::string::npos)
      result.names += (result.names.empty() ? "" : ", ") + text;
  };
  const auto summary = nlohmann::json::parse(test::textOf(run / "summary.json"));
  result.commit = summary.at("versions").value("commit", "unknown");
  for (const auto &gap : summary.at("gaps"))
    add(gap.at("begin_s"), fmt::format("no picture for {:.1f} s", gap.at("length_s").get<double>()));
  for (const auto &sensor : summary.at("sensors"))
    add(sensor.at("since_s"), shortened(sensor.at("text")));
}

Result judgeRun(const fs::path &run, const std::string &flight, double since_s, int status)
{
  Result result;
  result.status = status;
  if (!fs::exists(run / "trajectory.tum"))
    return result;
  readFrames(run, since_s, result);
  readSummary(run, result);
  try {
    const Evaluation evaluation = evaluate(run.string(), flight);
    result.ate = evaluation.smoothed.absolute[static_cast<std::size_t>(Alignment::xy_yaw)].ate;
    if (evaluation.trunks) {
      result.recall = evaluation.trunks->recall;
      result.precision = evaluation.trunks->confirmed > 0 ? evaluation.trunks->precision : 0;
    }
  }
  catch (const vpException &error) {
    result.names += fmt::format("; evaluation: {}", error.getStringMessage());
  }
  return result;
}

/// One line of the table.
struct Line
{
  const Fault *fault;
  std::string seen = {}, figures = {}; ///< no figures where there is no map to measure
  bool is_good = false;
};

class Trial
{
public:
  Trial(std::string bole, std::string flight, fs::path work)
      : m_bole(std::move(bole)), m_flight(std::move(flight)), m_work(std::move(work))
  {
    fs::remove_all(m_work);
    fs::create_directories(m_work);
    SpoiltFlight whole(m_flight, "none");
    m_clean_run = m_work / "clean";
    const test::Outcome outcome = track(whole, m_clean_run, "");
    clean = judgeRun(m_clean_run, m_flight, 0, outcome.status);
  }

  Line judge(const Fault &fault)
  {
    Line line{&fault, {}};
    const fs::path run = m_work / "run";
    fs::remove_all(run);
    if (fault.process) {
      fs::create_directories(run);
      const Seen seen = fault.process({m_bole, m_flight, run.string()});
      line.seen = seen.text;
      line.is_good = seen.is_right;
      return line;
    }
    SpoiltFlight flight(m_flight, fault.name);
    fault.spoil(flight);
    const test::Outcome outcome = track(flight, run, fault.arguments);
    if (fault.duty == Duty::refuse)
      judgeRefusal(fault, outcome, run, line);
    else if (fault.duty == Duty::read)
      judgeReading(run, outcome, line);
    else
      judgeSurvival(fault, outcome, run, line);
    return line;
  }

  Result clean;

private:
  test::Outcome track(const SpoiltFlight &flight, const fs::path &run, const std::string &arguments)
  {
    const fs::path copy = m_work / "copy";
    flight.write(copy);
    return test::runShell(fmt::format("{}{}{} track {} -o {} --no-video -q {}", kBounds, kTimeout, m_bole,
                                      copy.string(), run.string(), arguments));
  }

  static std::string firstLine(const std::string &text) { return text.substr(0, text.find('\n')); }

  static void judgeRefusal(const Fault &fault, const test::Outcome &outcome, const fs::path &run, Line &line)
  {
    line.is_good = (outcome.status == 1 || outcome.status == 2) && outcome.text.find(fault.says) != std::string::npos &&
                   !fs::exists(run / "trunks.csv");
    line.seen = line.is_good ? fmt::format("`{}`", fault.says)
                             : fmt::format("EXIT {}: `{}`", outcome.status, firstLine(outcome.text).substr(0, 160));
  }

  void judgeReading(const fs::path &run, const test::Outcome &outcome, Line &line) const
  {
    line.is_good = outcome.status == 0;
    for (const char *file : {"trunks.csv", "trajectory.tum"})
      line.is_good = line.is_good && test::textOf(run / file) == test::textOf(m_clean_run / file);
    line.seen = line.is_good ? "the same bytes" : fmt::format("exit {}: {}", outcome.status, firstLine(outcome.text));
  }

  /// How many frames were named, and how late the first of them where that was not at once.
  static std::string framesOf(const Result &result, double since_s)
  {
    if (result.frames == 0)
      return "";
    const double late_s = result.named_s - since_s;
    return late_s < 0.05 ? fmt::format(" ({})", result.frames) : fmt::format(" ({}, {:.1f} s)", result.frames, late_s);
  }

  void judgeSurvival(const Fault &fault, const test::Outcome &outcome, const fs::path &run, Line &line) const
  {
    const Result result = judgeRun(run, m_flight, fault.since_s, outcome.status);
    const bool has_ended = outcome.status == 0 || outcome.status == 3;
    const bool is_kept = result.recall >= clean.recall - kLoss && result.precision >= clean.precision - kLoss;
    const bool is_named = result.named_s >= 0 && result.named_s <= fault.since_s + kSoon_s + 1e-6;
    line.is_good = has_ended && (is_kept || is_named);
    if (!has_ended)
      line.seen = fmt::format("EXIT {}: {}", outcome.status, firstLine(outcome.text));
    else if (result.names.empty())
      line.seen = is_kept ? "nothing lost" : "SILENT";
    else
      line.seen = result.names + framesOf(result, fault.since_s);
    line.figures = fmt::format("{:.3f}, {:.2f}, {:.2f}", result.ate, result.recall, result.precision);
  }

  std::string m_bole, m_flight;
  fs::path m_work, m_clean_run;
};

std::vector<Fault> allFaults() { return joined({pictureFaults(), sensorFaults(), fileFaults(), processFaults()}); }

std::string rowOf(const Line &line, bool has_figures)
{
  const Fault &fault = *line.fault;
  const char *const verdict = line.is_good ? "" : kKnown.count(fault.name) > 0 ? "not held: " : "**NOT HELD**: ";
  std::string row =
      fmt::format("| `{}`{}{} | {}{} |", fault.name, fault.what.empty() ? "" : " ", fault.what, verdict, line.seen);
  if (has_figures)
    row += fmt::format("{}{} |", line.figures.empty() ? "" : " ", line.figures);
  return row + "\n";
}

/// A table for each group.
std::string tableOf(const std::vector<Line> &lines, const Result &clean)
{
  std::string text = fmt::format("Commit {:.7}; no fault: {:.3f}, {:.2f}, {:.2f}.\n", clean.commit, clean.ate,
                                 clean.recall, clean.precision);
  for (auto begin = lines.begin(); begin != lines.end();) {
    const std::string &group = begin->fault->group;
    const auto end = std::find_if(begin, lines.end(), [&](const Line &line) { return line.fault->group != group; });
    const bool has_figures = std::any_of(begin, end, [](const Line &line) { return !line.figures.empty(); });
    text += fmt::format("\n| {} | said |{}\n|---|---|{}\n", group, has_figures ? " figures |" : "",
                        has_figures ? "---|" : "");
    for (; begin != end; ++begin)
      text += rowOf(*begin, has_figures);
  }
  return text;
}

/// What stands between the marks of \p path is replaced by \p table.
void writeTable(const std::string &path, const std::string &table)
{
  const std::string begin = "<!-- faults -->\n", end = "<!-- end -->";
  const std::string text = test::textOf(path);
  const std::size_t from = text.find(begin), to = text.find(end, from);
  if (from == std::string::npos || to == std::string::npos)
    throw std::runtime_error(path + ": must hold the lines \"<!-- faults -->\" and \"<!-- end -->\"");
  writeAtomically(path, text.substr(0, from + begin.size()) + table + text.substr(to));
}

int run(const std::vector<std::string> &words)
{
  std::size_t part = 1;
  std::string table;
  std::set<std::string> only;
  for (std::size_t i = 3; i + 1 < words.size(); i += 2) {
    if (words[i] == "--part")
      part = std::stoul(words[i + 1]);
    else if (words[i] == "--table")
      table = words[i + 1];
    else if (words[i] == "--only")
      only.insert(words[i + 1]);
  }
  Trial trial(words[0], words[1], words[2]);
  fmt::print("clean: ATE {:.3f} m, recall {:.2f}, precision {:.2f}, {} frames named, exit {}\n", trial.clean.ate,
             trial.clean.recall, trial.clean.precision, trial.clean.frames, trial.clean.status);
  const std::vector<Fault> all = allFaults();
  std::vector<Line> lines;
  std::size_t runs = 0, short_of = 0;
  for (const Fault &fault : all) {
    const bool is_compared = fault.duty == Duty::survive || fault.duty == Duty::read;
    if (!only.empty() ? only.count(fault.name) == 0 : is_compared && runs++ % part != 0)
      continue;
    lines.push_back(trial.judge(fault));
    fmt::print("{}", rowOf(lines.back(), true));
    std::fflush(stdout);
    short_of += lines.back().is_good || kKnown.count(fault.name) > 0 ? 0 : 1;
  }
  fmt::print("{} faults, {} fall short\n", lines.size(), short_of);
  if (!table.empty())
    writeTable(table, tableOf(lines, trial.clean));
  const bool is_clean = trial.clean.status == 0 && trial.clean.frames == 0 && trial.clean.recall > 0;
  return is_clean && short_of == 0 && !lines.empty() ? 0 : 1;
}
} // namespace

int main(int argc, char **argv)
{
  const std::vector<std::string> words(argv + 1, argv + argc);
  if (words.size() < 3) {
    fmt::print(stderr, "fault_table BOLE FLIGHT WORK [--part N] [--only NAME]... [--table FILE]\n");
    return 2;
  }
  try {
    return run(words);
  }
  catch (const std::exception &error) {
    fmt::print(stderr, "{}\n", error.what());
    return 2;
  }
}
