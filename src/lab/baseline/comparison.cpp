// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/comparison.h"

#include "support/units.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace bole
{
namespace
{
constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

double rootMeanSquare(const std::vector<FrameError> &errors, std::size_t n, double FrameError::*member)
{
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k)
    sum += errors[k].*member * errors[k].*member;
  return n > 0 ? std::sqrt(sum / double(n)) : kNaN;
}

void summarise(Score &score)
{
  score.frames = int(score.errors.size());
  bool lost = false;
  std::vector<double> times;
  for (const FrameError &e : score.errors) {
    lost = lost || e.complained || e.wrong;
    score.until_loss += lost ? 0 : 1;
    score.tracked += !e.complained && !e.wrong ? 1 : 0;
    score.silent_failures += e.wrong && !e.complained ? 1 : 0;
    score.reinitialisations += e.reinitialised ? 1 : 0;
    times.push_back(e.ms);
  }
  const std::size_t held = std::size_t(score.until_loss), all = score.errors.size();
  score.position_rmse_m = rootMeanSquare(score.errors, held, &FrameError::position_m);
  score.rotation_rmse_deg = rootMeanSquare(score.errors, held, &FrameError::rotation_deg);
  score.all_position_rmse_m = rootMeanSquare(score.errors, all, &FrameError::position_m);
  score.all_rotation_rmse_deg = rootMeanSquare(score.errors, all, &FrameError::rotation_deg);
  score.median_ms = quantileOf(times, 0.5);
  score.p95_ms = quantileOf(times, 0.95);
}
} // namespace

PoseError poseError(const Pose &cMo, const Pose &truth)
{
  if (!cMo.isFinite())
    return {1e9, 180};
  return {(cMo.inverse().t - truth.inverse().t).norm(), logSo3(cMo.R.transpose() * truth.R).norm() * 180 / M_PI};
}

namespace
{
FrameError answerOf(Contender &contender, const TestFlight &flight, std::size_t k, const vpImage<unsigned char> &image)
{
  const Answer answer = contender.track(flight, k, image);
  const PoseError error = poseError(answer.cMo, flight.frames[k].cMo);
  return {answer, error,
          error.position_m > flight.limits.position_m || error.rotation_deg > flight.limits.rotation_deg};
}
} // namespace

std::vector<Score> compare(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                           const ImageAt &image_at)
{
  std::vector<Score> scores(contenders.size());
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    scores[i].name = contenders[i].name();
    scores[i].kind = contenders[i].kind();
    scores[i].help = contenders[i].help();
    scores[i].settings = contenders[i].settingsText();
    contenders[i].start(cao_path, flight.camera, flight.frames[0].image, flight.frames[0].cMo);
  }
  for (std::size_t k = 1; k < flight.frames.size(); ++k) {
    const vpImage<unsigned char> &image = image_at ? image_at(k) : flight.frames[k].image;
    for (std::size_t j = 0; j < contenders.size(); ++j) {
      const std::size_t i = (j + k) % contenders.size(); // nobody always runs with the cache of the same other
      scores[i].errors.push_back(answerOf(contenders[i], flight, k, image));
    }
  }
  for (Score &score : scores)
    summarise(score);
  return scores;
}

namespace
{
/// One setting of a sweep: stops where the tracker has been wrong for so long that it will not come back.
Score tryOut(const TestFlight &flight, const std::string &cao_path, Contender &&contender)
{
  constexpr int kHopeless = 15;
  Score score;
  score.settings = contender.settingsText();
  contender.start(cao_path, flight.camera, flight.frames[0].image, flight.frames[0].cMo);
  int wrong_in_a_row = 0;
  for (std::size_t k = 1; k < flight.frames.size() && wrong_in_a_row < kHopeless; ++k) {
    score.errors.push_back(answerOf(contender, flight, k, flight.frames[k].image));
    wrong_in_a_row = score.errors.back().wrong ? wrong_in_a_row + 1 : 0;
  }
  summarise(score);
  return score;
}

using Change = std::function<void(EdgeSettings &)>;

const std::vector<Change> &changes()
{
  static const std::vector<Change> all = {
      [](EdgeSettings &s) { s.range = 4; },         [](EdgeSettings &s) { s.range = 8; },
      [](EdgeSettings &s) { s.range = 12; },        [](EdgeSettings &s) { s.range = 16; },
      [](EdgeSettings &s) { s.threshold = 5000; },  [](EdgeSettings &s) { s.threshold = 10000; },
      [](EdgeSettings &s) { s.threshold = 20000; }, [](EdgeSettings &s) { s.mask_size = 3; },
      [](EdgeSettings &s) { s.mask_size = 5; },     [](EdgeSettings &s) { s.mask_size = 7; },
      [](EdgeSettings &s) { s.sample_step = 2; },   [](EdgeSettings &s) { s.sample_step = 4; },
      [](EdgeSettings &s) { s.far_m = 8; },         [](EdgeSettings &s) { s.far_m = 10; },
      [](EdgeSettings &s) { s.far_m = 15; },        [](EdgeSettings &s) { s.far_m = 25; },
  };
  return all;
}

bool isBetter(const Score &a, const Score &b)
{
  return a.tracked != b.tracked ? a.tracked > b.tracked : a.all_position_rmse_m < b.all_position_rmse_m;
}
} // namespace

SweepResult sweep(const TestFlight &flight, const std::string &cao_path, TrackerKind kind, Help help)
{
  SweepResult result;
  result.kind = kind;
  result.help = help;
  const auto run = [&](const EdgeSettings &settings) -> const Score & {
    result.tried.emplace_back(settings, tryOut(flight, cao_path, Contender(kind, help, settings)));
    return result.tried.back().second;
  };
  const auto isTried = [&](const EdgeSettings &settings) {
    return std::any_of(result.tried.begin(), result.tried.end(),
                       [&](const auto &tried) { return tried.first.text() == settings.text(); });
  };
  Score best = run(result.best);
  for (int pass = 0; pass < 2; ++pass)
    for (const Change &change : changes()) {
      EdgeSettings settings = result.best;
      change(settings);
      if (isTried(settings))
        continue;
      const Score &score = run(settings);
      if (isBetter(score, best))
        best = score, result.best = settings;
    }
  return result;
}
} // namespace bole
