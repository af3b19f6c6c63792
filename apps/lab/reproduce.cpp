// SPDX-License-Identifier: GPL-2.0-or-later
// bole reproduce: the paper's method beside ours, and what its figures 5 to 8 show.
#include "data_files.h"
#include "detector_statistics.h"
#include "lab_commands.h"
#include "paper/paper_mapper.h"
#include "progress.h"
#include "simulation/simulated_flight.h"
#include "support/text.h"
#include "support/units.h"
#include <bole/ardrone_source.h>
#include <bole/evaluation.h>
#include <bole/pipeline.h>

#include <cstdio>
#include <filesystem>
#include <fmt/ranges.h>
#include <memory>
#include <nlohmann/json.hpp>
#include <visp3/io/vpImageIo.h>

namespace bole::apps
{
namespace
{
namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct ReproduceArguments
{
  std::string output, statistics;
  std::vector<std::string> flights;
  bool is_quiet = false;
};

struct Method
{
  const char *name, *folder;
  std::optional<double> alpha; ///< of the paper's method; none: ours
};

/// \p calibrated_alpha: see DetectorStatistics.
std::vector<Method> methods(double calibrated_alpha)
{
  return {{"paper, alpha 1000", "paper-1000", paper::kPrintedAlpha},
          {"paper, calibrated", "paper-calibrated", calibrated_alpha},
          {"default", "default", {}}};
}

/// Section 7: a small forest, flown by hand, 320x240 at 10 Hz through the lens of an AR.Drone 1, its pose filter and
/// gyro. The paper does not say how long; 12 s as the flights of data/.
void simulate(const std::string &folder)
{
  SceneOptions scene;
  scene.setSeed(320);
  scene.renderer.camera = publishedArDroneCamera(1, 320, 240).model;
  scene.renderer.samples_per_pixel = 8;
  RecordOptions record;
  record.folder = folder;
  record.overwrite = true;
  recordFlight(scene, record);
}

/// What one method made of one flight.
struct Result
{
  Evaluation evaluation;
  double ms = 0; ///< of processor time a frame, median
};

/// Place and heading of a camera [m], [rad].
Json placeOf(const Pose &wMc) { return {wMc.t.x(), wMc.t.y(), std::atan2(wMc.R(1, 2), wMc.R(0, 2))}; }

Json circlesOf(const std::vector<TrunkRecord> &map)
{
  Json circles = Json::array();
  for (const TrunkRecord &tree : map)
    circles.push_back({tree.xy.x(), tree.xy.y(), tree.radius});
  return circles;
}

/// Writes the pictures of a frame and returns what is drawn into them.
Json drawn(const Frame &frame, const FrameReport &report, const std::vector<TrunkRecord> &map,
           const PinholeCamera &camera, const Pose &bMc, const std::string &folder)
{
  const std::string name = fmt::format("{:05d}", report.index);
  vpImageIo::write(frame.image, folder + "/frame-" + name + ".png");
  if (report.saliency) { // near things are white
    vpImage<unsigned char> near(frame.image.getHeight(), frame.image.getWidth());
    for (unsigned i = 0; i < near.getSize(); ++i)
      near.bitmap[i] = static_cast<unsigned char>(std::lround(255 * (1 - report.saliency->p_background.bitmap[i])));
    vpImageIo::write(near, folder + "/saliency-" + name + ".png");
  }
  Json trees = Json::array();
  for (const TrunkInView &tree : report.trunks) {
    const Eigen::Vector3d axis = report.wMc.R * tree.relative.cRt.col(0);
    Json borders = Json::array();
    for (const Border border : {Border::left, Border::right})
      if (const auto line = paper::borderInImage(camera, tree.relative, border); line.begin < line.end)
        borders.push_back({line.columnAt(line.begin), line.begin, line.columnAt(line.end - 1), line.end - 1});
    trees.push_back({{"id", tree.id},
                     {"tracked", tree.is_tracked},
                     {"range", tree.distance},
                     {"bearing", std::atan2(axis.y(), axis.x())},
                     {"half_angle", std::asin(tree.relative.ratio())},
                     {"borders", borders}});
  }
  return {{"name", name},
          {"camera", placeOf(report.wMc)},
          {"truth", placeOf(frame.wMb_truth.value_or(report.wMb) * bMc)},
          {"trees", trees},
          {"map", circlesOf(map)}};
}

/// Flies \p sequence through a Pipeline or a PaperMapper into the folder \p run. \p seen gets each frame where given.
template <typename Mapper>
Result fly(const std::string &sequence, Mapper &mapper, const std::string &run, Json *seen = nullptr)
{
  const auto source = openSource(sequence);
  fs::create_directories(run);
  Result result;
  std::vector<double> times_ms;
  for (Frame frame; source->next(frame);) {
    const double begin_ms = processorTime_ms();
    const FrameReport report = mapper.process(frame);
    times_ms.push_back(processorTime_ms() - begin_ms);
    if (seen && frame.status == FrameStatus::ok)
      seen->push_back(drawn(frame, report, mapper.map(), source->camera(), source->bMc(), run));
  }
  mapper.finish();
  writeRun(run, mapper.map(), mapper.smoothedTrajectory());
  result.evaluation = evaluate(run, sequence);
  result.ms = medianOf(times_ms);
  return result;
}

/// What figures 5 to 8 are drawn of, by apps/campaign/figures.py: figures.json beside the pictures of each frame.
void writeFigures(const std::string &run, const std::string &name, const std::string &sequence,
                  const PinholeCamera &camera, const paper::PaperMapper &mapper, const Evaluation &evaluation,
                  const Json &frames)
{
  Json json = {{"flight", name},
               {"intrinsics", {camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height}},
               {"map", circlesOf(mapper.map())},
               {"right", Json::array()},
               {"trunks", Json::array()},
               {"path", Json::array()},
               {"frames", frames}};
  for (const TrunkMatch &match : evaluation.trunks.value_or(TrunkMetrics()).matches)
    json["right"].push_back(match.estimate.id);
  for (const TruthTrunk &trunk : readTruthTrunks(sequence))
    json["trunks"].push_back({trunk.xy.x(), trunk.xy.y(), trunk.radius});
  for (const StampedPose &pose : mapper.smoothedTrajectory())
    json["path"].push_back({pose.wMb.t.x(), pose.wMb.t.y()});
  writeFile(run + "/figures.json", json.dump() + "\n");
}

/// \p quartiles: of this flight, by whose inspection the paper's detector has its thresholds, as the authors had them
/// of theirs.
Result fly(const std::string &sequence, const std::string &name, const Method &method,
           const paper::LineQuartiles &quartiles, const std::string &run)
{
  const auto source = openSource(sequence);
  const PinholeCamera camera = source->camera();
  const Pose bMc = source->bMc();
  if (!method.alpha) {
    Pipeline pipeline(camera, bMc);
    return fly(sequence, pipeline, run);
  }
  paper::PaperMapper mapper(camera, bMc, *method.alpha, quartiles);
  if (*method.alpha == paper::kPrintedAlpha)
    return fly(sequence, mapper, run);
  Json frames = Json::array();
  const Result result = fly(sequence, mapper, run, &frames);
  writeFigures(run, name, sequence, camera, mapper, result.evaluation, frames);
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

std::string csvLine(std::vector<std::string> cells)
{
  for (std::string &cell : cells)
    cell = csvField(cell);
  return fmt::format("{}\n", fmt::join(cells, ","));
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
  std::string table = csvLine(kHead);
  Progress progress(arguments.is_quiet ? 0 : 3 * flights.size(), stderr);
  std::size_t done = 0;
  for (const std::string &sequence : flights) {
    const fs::path place = (fs::absolute(sequence) / "").lexically_normal().parent_path();
    const std::string name = place.filename().string();
    const paper::LineQuartiles quartiles = detectorStatistics(sequence).quartiles();
    for (const Method &method : methods(calibrated_alpha)) {
      const std::string run = arguments.output + "/" + name + "/" + method.folder;
      table += csvLine(rowOf(name, method.name, fly(sequence, name, method, quartiles, run)));
      progress.update(++done, name + ", " + method.name);
    }
  }
  const std::string path = arguments.output + "/table.csv";
  writeFile(path, table);
  std::printf("%s (alpha calibrated: %.2g)\n", path.c_str(), calibrated_alpha);
}
} // namespace

void addReproduce(CLI::App &app)
{
  const auto arguments = std::make_shared<ReproduceArguments>();
  CLI::App *command = app.add_subcommand("reproduce", "The paper's method beside ours, and its figures");
  CLI::Option *output = command->add_option("-o,--output", arguments->output, "Folder for table.csv and the runs");
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
  command->footer("apps/campaign/figures.py OUTPUT draws figures 5 to 8.\nExamples:\n  bole reproduce -o figures\n  "
                  "bole reproduce --statistics data/park-forward");
  command->callback([arguments] { reproduce(*arguments); });
}
} // namespace bole::apps
