// SPDX-License-Identifier: GPL-2.0-or-later
// bole fit-odds: the weights of the final decision, from flights with known trunks.
#include "lab_commands.h"
#include "support/text.h"

#include "progress.h"
#include <bole/open_source.h>
#include <bole/pipeline.h>

#include <Eigen/Dense>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fmt/format.h>
#include <memory>

namespace bole::apps
{
namespace
{
using OddsTerms = Eigen::Matrix<double, Decision::kNames.size(), 1>;

/// A hypothesis that is, or is not, a trunk.
struct Row
{
  OddsTerms terms;
  double told = 0; ///< log-odds by the weights in use
  bool is_trunk = false;
};
using Rows = std::vector<Row>;

/// In x, y and yaw, least squares over the poses of both.
Eigen::Matrix3d alignment(const Trajectory &path, const Trajectory &truth)
{
  std::vector<double> from, to;
  for (std::size_t i = 0, k = 0; i < path.size(); ++i) {
    while (k < truth.size() && truth[k].stamp_ns < path[i].stamp_ns)
      ++k;
    if (k == truth.size() || truth[k].stamp_ns != path[i].stamp_ns)
      continue;
    from.insert(from.end(), {path[i].wMb.t.x(), path[i].wMb.t.y()});
    to.insert(to.end(), {truth[k].wMb.t.x(), truth[k].wMb.t.y()});
  }
  const auto count = static_cast<Eigen::Index>(from.size() / 2);
  return Eigen::umeyama(Eigen::MatrixXd::Map(from.data(), 2, count), Eigen::MatrixXd::Map(to.data(), 2, count), false);
}

/// Hypotheses of one flight. One within 0.35 m and two fifths of the radius is a trunk, one beyond 0.5 m of every trunk
/// is none; what lies between teaches nothing.
Rows rowsOf(const std::string &sequence)
{
  constexpr double kIs = 0.35, kIsNot = 0.5, kRadius = 0.4, kLeastRadius = 0.04; // [m], [m], relative, [m]
  const auto source = openSource(sequence);
  const std::vector<TruthTrunk> truth = readTruthTrunks(sequence);
  if (truth.empty())
    throw badValue("{}: no trees.csv: nothing to learn from", sequence);
  Pipeline pipeline(source->camera(), source->bMc());
  Frame frame;
  Trajectory poses;
  while (source->next(frame)) {
    pipeline.process(frame);
    if (frame.wMb_truth)
      poses.push_back({frame.stamp_ns, *frame.wMb_truth});
  }
  pipeline.finish();
  const Eigen::Matrix3d toTruth = alignment(pipeline.smoothedTrajectory(), poses);
  Rows rows;
  for (const Decision &scored : pipeline.decisions()) {
    const Eigen::Vector3d axis = scored.trunk.axisAt(kBreastHeight);
    const Eigen::Vector2d at = (toTruth * Eigen::Vector3d(axis.x(), axis.y(), 1)).head<2>();
    const auto nearest = std::min_element(truth.begin(), truth.end(), [&](const TruthTrunk &a, const TruthTrunk &b) {
      return (a.xy - at).norm() < (b.xy - at).norm();
    });
    const double off = (nearest->xy - at).norm(), wrong = std::abs(nearest->radius - scored.trunk.radius());
    const bool is_trunk =
        off < kIs && (nearest->radius <= 0 || wrong < std::max(kLeastRadius, kRadius * nearest->radius));
    if (is_trunk || off > kIsNot)
      rows.push_back({OddsTerms::Map(scored.terms.data()), scored.log_odds, is_trunk});
  }
  return rows;
}

/// Logistic regression with a weak pull to zero: Newton's method.
OddsTerms fit(const std::vector<const Rows *> &flights)
{
  constexpr double kPull = 0.5;
  constexpr int kIterations = 30;
  OddsTerms weights = OddsTerms::Zero();
  using Square = Eigen::Matrix<double, OddsTerms::RowsAtCompileTime, OddsTerms::RowsAtCompileTime>;
  for (int i = 0; i < kIterations; ++i) {
    Square H = kPull * Square::Identity();
    OddsTerms g = -kPull * weights;
    for (const Rows *rows : flights)
      for (const Row &row : *rows) {
        const double p = 1 / (1 + std::exp(-weights.dot(row.terms)));
        g += (row.is_trunk - p) * row.terms;
        H += p * (1 - p) * row.terms * row.terms.transpose();
      }
    weights += H.ldlt().solve(g);
  }
  return weights;
}

/// Chance that the odds of a trunk are above those of something else.
double areaUnderCurve(const std::vector<std::pair<double, bool>> &scores)
{
  double trunks = 0, others = 0, above = 0;
  for (const auto &[score, is_trunk] : scores) // by rising score
    if (is_trunk) {
      ++trunks;
      above += others;
    }
    else
      ++others;
  return above / std::max(trunks * others, 1.0);
}

/// Share of trunks against the probability that was told.
std::string reliability(const std::vector<std::pair<double, bool>> &scores)
{
  constexpr int kBins = 10;
  std::string table = "probability,hypotheses,trunks\n";
  for (int bin = 0; bin < kBins; ++bin) {
    int n = 0, trunks = 0;
    double sum = 0;
    for (const auto &[score, is_trunk] : scores) {
      const double p = 1 / (1 + std::exp(-score));
      if (p < bin / double(kBins) || (p >= (bin + 1) / double(kBins) && bin + 1 < kBins))
        continue;
      ++n;
      trunks += is_trunk;
      sum += p;
    }
    if (n > 0)
      table += fmt::format("{:.2f},{},{:.2f}\n", sum / n, n, trunks / double(n));
  }
  return table;
}

void run(const std::vector<std::string> &sequences)
{
  std::vector<Rows> flights;
  Progress progress(sequences.size(), stderr);
  for (const std::string &sequence : sequences) {
    flights.push_back(rowsOf(sequence));
    progress.update(flights.size());
  }
  progress.finish();
  std::vector<const Rows *> all;
  for (const Rows &rows : flights)
    all.push_back(&rows);
  std::vector<std::pair<double, bool>> scores, present; // of each flight by the weights of all others
  for (std::size_t i = 0; i < flights.size(); ++i) {
    std::vector<const Rows *> others = all;
    others.erase(others.begin() + static_cast<long>(i));
    const OddsTerms weights = fit(others);
    for (const Row &row : flights[i]) {
      scores.emplace_back(weights.dot(row.terms), row.is_trunk);
      present.emplace_back(row.told, row.is_trunk);
    }
  }
  std::sort(scores.begin(), scores.end());
  std::sort(present.begin(), present.end());
  const OddsTerms weights = fit(all);
  std::string text = fmt::format("{} hypotheses of {} flights\n", scores.size(), flights.size());
  for (int i = 0; i < weights.size(); ++i)
    text += fmt::format("  {:<12} {:7.3f}\n", Decision::kNames[static_cast<std::size_t>(i)], weights(i));
  text += fmt::format(
      "area under the ROC curve, each flight by the weights of the others: {:.3f}; by those in use: {:.3f}\n",
      areaUnderCurve(scores), areaUnderCurve(present));
  std::fputs((text + reliability(scores)).c_str(), stdout);
}
} // namespace

void addFitOdds(CLI::App &app)
{
  const auto sequences = std::make_shared<std::vector<std::string>>();
  CLI::App *command = app.add_subcommand("fit-odds", "Weights of the final decision, from flights with known trunks");
  command->add_option("SEQUENCE", *sequences, "ASL folders with trees.csv")->required();
  command->footer(
      "Prints the weights of src/pipeline/final_pass.cpp, the area under the ROC curve with each flight left\n"
      "out in turn, and how often a probability came true.\n"
      "Example: bole fit-odds forests/3*");
  command->callback([sequences] { run(*sequences); });
}
} // namespace bole::apps
