// SPDX-License-Identifier: GPL-2.0-or-later
// bole reproduce: the paper's figures 5 to 8 and its method beside ours, on one page.
#include "commands.h"
#include "data_files.h"
#include "detector_statistics.h"
#include "geometry/failure.h"
#include "paper_figures.h"

#include "geometry/median.h"
#include "input/asl_source.h"
#include "input/atomic_file.h"
#include "input/csv_reader.h"
#include "lab/simulation/simulated_flight.h"
#include "output/figure.h"
#include "output/page.h"
#include "output/progress.h"
#include "output/svg.h"
#include "output/trajectory_writer.h"
#include "output/trunks_csv.h"
#include <bole/evaluation.h>
#include <bole/pipeline.h>

#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;

struct ReproduceArguments
{
  std::string output, statistics;
  std::vector<std::string> flights;
  bool is_quiet = false;
};

struct Method
{
  const char *name, *folder;
  Options options;
};

/// \p calibrated_alpha: see DetectorStatistics.
std::vector<Method> methods(double calibrated_alpha)
{
  Options paper, calibrated;
  paper.map.policy = calibrated.map.policy = MapPolicy::paper;
  calibrated.paper.alpha = calibrated_alpha;
  return {{"paper, alpha 1000", "paper-1000", paper},
          {"paper, calibrated", "paper-calibrated", calibrated},
          {"default", "default", Options()}};
}

/// Section 7: a small forest, flown by hand, 320x240 at 10 Hz through the lens of an AR.Drone 1, its pose filter and
/// gyro. The paper does not say how long; 12 s as the flights of data/.
void simulate(const std::string &folder)
{
  SceneOptions scene;
  scene.setSeed(320);
  scene.renderer.camera = {{215.1, 215.8, 160.7, 123.3, 320, 240}, Distortion::fov, {{0.272, 0, 0, 0}}};
  scene.renderer.samples_per_pixel = 8;
  RecordOptions record;
  record.folder = folder;
  record.overwrite = true;
  recordFlight(scene, record);
}

/// What one method made of one flight.
struct Result
{
  SeenFlight seen;
  Evaluation evaluation;
  double ms = 0; ///< of processor time a frame, median
};

/// What this process has computed, on all its threads: what other programs take does not count.
double processTime_ms()
{
  timespec t{};
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

/// The detector of the paper has its thresholds by inspection of this flight, as the authors had them of theirs.
StageOptions optionsFor(const Method &method, const LineQuartiles &quartiles, const PinholeCamera &camera)
{
  StageOptions options = stageOptions(method.options, camera);
  if (options.flow.as_paper)
    setByInspection(options.lines, quartiles);
  return options;
}

Result fly(const std::string &sequence, const std::string &name, const Method &method, const LineQuartiles &quartiles,
           const std::string &run, bool keeps_frames)
{
  AslSource source(sequence);
  Result result;
  SeenFlight &seen = result.seen;
  seen = {name, source.camera(), source.bMc(), {}, {}, {}, source.truth(), readTruthTrunks(sequence), {}};
  Pipeline pipeline(seen.camera, seen.bMc, optionsFor(method, quartiles, seen.camera));
  std::vector<double> times_ms;
  for (Frame frame; source.next(frame);) {
    const double begin_ms = processTime_ms();
    FrameReport report = pipeline.process(frame);
    times_ms.push_back(processTime_ms() - begin_ms);
    if (keeps_frames && frame.status == FrameStatus::ok)
      seen.frames.push_back({frame.image, std::move(report), pipeline.map()});
  }
  pipeline.finish();
  seen.map = pipeline.map();
  seen.smoothed = pipeline.smoothedTrajectory();
  fs::create_directories(run);
  writeTrajectory(run + "/trajectory.tum", seen.smoothed);
  writeTrunks(run + "/trunks.csv", seen.map);
  result.evaluation = evaluate(run, sequence);
  for (const TrunkMatch &match : result.evaluation.trunks.value_or(TrunkMetrics()).matches)
    seen.right.push_back(match.estimate.id);
  result.ms = medianOf(times_ms);
  return result;
}

std::vector<std::string> rowOf(const std::string &flight, const char *method, const Result &result)
{
  const TrunkMetrics trunks = result.evaluation.trunks.value_or(TrunkMetrics());
  std::size_t twice = 0;
  for (const Unmatched &other : trunks.false_positives)
    twice += other.is_duplicate;
  const std::size_t aligned = indexOf(Alignment::xy_yaw);
  const auto number = [](std::size_t n) { return fmt::format("{}", n); };
  return {flight,
          method,
          number(trunks.confirmed),
          number(trunks.matches.size()),
          number(twice),
          number(trunks.false_positives.size() - twice),
          fmt::format("{} of {}", trunks.all.found, trunks.all.expected),
          figure(trunks.all.median[aligned], 0, 3),
          figure(trunks.all.radius_rmse, 0, 3),
          figure(trunks.all.nees_half, 0, 1),
          figure(result.evaluation.smoothed.absolute[aligned].ate, 0, 3),
          figure(result.ms, 0, 1)};
}

const std::vector<std::string> kHead = {
    "flight",       "method",          "trees in the map", "right",   "twice",     "wrong", "found of the expected",
    "position (m)", "radius RMSE (m)", "NEES/2",           "ATE (m)", "ms a frame"};

/// The same for spreadsheets.
std::string csvOf(const std::vector<std::vector<std::string>> &rows)
{
  std::string text;
  const auto add = [&](const std::vector<std::string> &cells) {
    for (std::size_t i = 0; i < cells.size(); ++i) {
      const std::string cell = cells[i].substr(std::min(cells[i].find_first_not_of(' '), cells[i].size()));
      text += (i > 0 ? "," : "") + csvField(cell);
    }
    text += '\n';
  };
  add(kHead);
  for (const std::vector<std::string> &row : rows)
    add(row);
  return text;
}

std::string htmlOf(const Panel &panel, const std::string &folder)
{
  std::string html = "<figure>";
  for (const Panel::Picture &picture : panel.pictures) {
    const bool is_svg = picture.name.substr(picture.name.size() - 4) == ".svg";
    writeAtomically(folder + "/" + picture.name, picture.bytes);
    html += is_svg ? chartBox(picture.bytes) : htmlImage(picture.bytes, "png", picture.name);
  }
  return html + "<figcaption>" + escaped(panel.caption) + "</figcaption></figure>\n";
}

std::string figuresOf(const SeenFlight &flight, const std::string &folder)
{
  std::string html = fmt::format("<h2>Fig. 5: basis flows, {}</h2>\n", escaped(flight.name));
  html += htmlOf(figure5(flight.camera), folder);
  html += fmt::format("<h2>Fig. 6: map and truth, {}</h2>\n", escaped(flight.name)) + htmlOf(figure6(flight), folder);
  const char *panels[] = {"a", "b", "c", "d: no parallax", "d: a far trunk uncovered"};
  std::size_t number = 0;
  html += fmt::format("<h2>Fig. 7: success and failure, {}</h2>\n<p>Cyan: trees tracked; red: a tree that ends. In the "
                      "local map the drone looks up; green: true trunks, red: trees of the map.</p>\n",
                      escaped(flight.name));
  for (const Panel &panel : figure7(flight))
    html += fmt::format("<h3>7 {}</h3>\n", panels[number++]) + htmlOf(panel, folder);
  html += fmt::format("<h2>Fig. 8: pictures and saliency, {}</h2>\n", escaped(flight.name));
  for (const Panel &panel : figure8(flight))
    html += htmlOf(panel, folder);
  return html;
}

void reproduce(const ReproduceArguments &arguments)
{
  if (!arguments.statistics.empty()) {
    std::fputs(toTable(detectorStatistics(arguments.statistics)).c_str(), stdout);
    return;
  }
  if (arguments.output.empty())
    throw badValue("reproduce: -o FOLDER or --statistics FLIGHT, one must be given");
  std::vector<std::string> flights = arguments.flights;
  fs::create_directories(arguments.output);
  if (flights.empty()) {
    const std::string simulated = arguments.output + "/flight";
    simulate(simulated);
    flights = {simulated, findSequence("park-forward")};
  }
  const double calibrated_alpha = detectorStatistics(findSequence("park-forward")).calibratedAlpha();
  std::string figures;
  std::vector<std::vector<std::string>> rows;
  Progress progress(arguments.is_quiet ? 0 : 3 * flights.size(), stderr);
  std::size_t done = 0;
  for (const std::string &sequence : flights) {
    const fs::path place = (fs::absolute(sequence) / "").lexically_normal().parent_path();
    const std::string name = place.filename().string(), folder = arguments.output + "/" + name;
    fs::create_directories(folder);
    const LineQuartiles quartiles = detectorStatistics(sequence).quartiles();
    for (const Method &method : methods(calibrated_alpha)) {
      const bool is_drawn = method.options.map.policy == MapPolicy::paper && method.options.paper.alpha < 1000;
      const Result result = fly(sequence, name, method, quartiles, folder + "/" + method.folder, is_drawn);
      rows.push_back(rowOf(name, method.name, result));
      if (is_drawn)
        figures += figuresOf(result.seen, folder);
      progress.update(++done, name + ", " + method.name);
    }
  }
  const std::string text = fmt::format(
      "<p>R. Roberts, D.-N. Ta, J. Straub, K. Ok and F. Dellaert, Saliency Detection and Model-based Tracking, SPIE "
      "2012: its method to the letter (map.policy = paper), on flights whose trunks are known. The thresholds of its "
      "detector are set by inspection of each flight. alpha is 1000 as printed, and {:.2g}: where the minima of Eq. 3 "
      "are as far from the true trunks of data/park-forward as their curvature says. The figures are drawn with the "
      "second.</p>\n",
      calibrated_alpha);
  const std::string note = "<p>Milliseconds are of processor time. The paper needed about 300 ms a frame (a third of "
                           "real time at 10 Hz, on a 2.2 GHz Core "
                           "i7, with known inefficiencies).</p>\n";
  writeAtomically(arguments.output + "/table.csv", csvOf(rows));
  const std::string page = arguments.output + "/index.html";
  writeAtomically(page, htmlPage("The paper's figures, made again", text + htmlTable(kHead, rows) + note + figures));
  std::printf("%s\n", page.c_str());
}
} // namespace

void addReproduce(CLI::App &app)
{
  const auto arguments = std::make_shared<ReproduceArguments>();
  CLI::App *command = app.add_subcommand("reproduce", "The paper's figures, and its method beside ours, on one page");
  CLI::Option *output = command->add_option("-o,--output", arguments->output, "Folder for the page and its figures");
  command
      ->add_option("FLIGHT", arguments->flights,
                   "ASL folders with truth (default: a simulated flight like the paper's, and park-forward)")
      ->transform(findSequence);
  CLI::Option *statistics =
      command
          ->add_option("--statistics", arguments->statistics,
                       "Print what the paper's detector reads along the lines of this flight instead: its thresholds "
                       "are set by inspection of it")
          ->transform(findSequence);
  output->excludes(statistics);
  command->add_flag("-q,--quiet", arguments->is_quiet, "No progress");
  command->footer("Examples:\n  bole reproduce -o figures\n  bole reproduce --statistics data/park-forward");
  command->callback([arguments] { reproduce(*arguments); });
}
} // namespace bole::apps
