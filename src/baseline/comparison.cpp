// SPDX-License-Identifier: GPL-2.0-or-later
#include <bole/baseline/comparison.h>
#include <bole/geometry/so3.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace bole
{
namespace
{
double rootMeanSquare(const std::vector<FrameError> &errors, std::size_t n, double FrameError::*member)
{
  double sum = 0;
  for (std::size_t k = 0; k < n; ++k)
    sum += errors[k].*member * errors[k].*member;
  return n > 0 ? std::sqrt(sum / double(n)) : 0;
}

double quantile(std::vector<double> values, double q)
{
  if (values.empty())
    return 0;
  const std::size_t k = std::min(values.size() - 1, std::size_t(q * double(values.size())));
  std::nth_element(values.begin(), values.begin() + std::ptrdiff_t(k), values.end());
  return values[k];
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
    times.push_back(e.ms);
  }
  const std::size_t held = std::size_t(score.until_loss), all = score.errors.size();
  score.position_rmse_m = rootMeanSquare(score.errors, held, &FrameError::position_m);
  score.rotation_rmse_deg = rootMeanSquare(score.errors, held, &FrameError::rotation_deg);
  score.all_position_rmse_m = rootMeanSquare(score.errors, all, &FrameError::position_m);
  score.all_rotation_rmse_deg = rootMeanSquare(score.errors, all, &FrameError::rotation_deg);
  score.median_ms = quantile(times, 0.5);
  score.p95_ms = quantile(times, 0.95);
}
} // namespace

FrameErrorOf poseError(const Pose &cMo, const Pose &truth)
{
  if (!cMo.isFinite())
    return {1e9, 180};
  return {(cMo.inverse().t - truth.inverse().t).norm(), logSo3(cMo.R.transpose() * truth.R).norm() * 180 / M_PI};
}

std::vector<Score> compare(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                           const Limits &limits, const Progress &progress)
{
  std::vector<Score> scores(contenders.size());
  for (std::size_t i = 0; i < contenders.size(); ++i) {
    scores[i].name = contenders[i].name();
    scores[i].kind = contenders[i].kind();
    scores[i].help = contenders[i].help();
    scores[i].settings = contenders[i].settings().text();
    contenders[i].start(cao_path, flight.camera, flight.frames[0].image, flight.frames[0].cMo);
  }
  for (std::size_t k = 1; k < flight.frames.size(); ++k) {
    const TestFrame &frame = flight.frames[k];
    for (std::size_t j = 0; j < contenders.size(); ++j) {
      const std::size_t i = (j + k) % contenders.size(); // nobody always runs with the cache of the same other
      const Answer answer = contenders[i].track(flight, k, frame.image);
      const FrameErrorOf error = poseError(answer.cMo, frame.cMo);
      FrameError e;
      e.position_m = error.position_m;
      e.rotation_deg = error.rotation_deg;
      e.complained = answer.complained;
      e.wrong = error.position_m > limits.position_m || error.rotation_deg > limits.rotation_deg;
      e.ms = answer.ms;
      scores[i].reinitialisations += answer.reinitialised ? 1 : 0;
      scores[i].errors.push_back(e);
    }
    if (progress)
      progress(int(k), int(flight.frames.size()) - 1);
  }
  for (Score &score : scores)
    summarise(score);
  return scores;
}

SweepResult sweep(const TestFlight &flight, const std::string &cao_path, TrackerKind kind, Help help,
                  const Limits &limits)
{
  SweepResult result;
  // one setting at a time from ViSP's defaults, twice through the list: cheaper than the full grid, and enough
  const std::vector<std::function<void(EdgeSettings &)>> changes = {
      [](EdgeSettings &s) { s.range = 4; },        [](EdgeSettings &s) { s.range = 12; },
      [](EdgeSettings &s) { s.threshold = 5000; }, [](EdgeSettings &s) { s.threshold = 20000; },
      [](EdgeSettings &s) { s.mask_size = 7; },    [](EdgeSettings &s) { s.mask_size = 3; },
      [](EdgeSettings &s) { s.sample_step = 2; },  [](EdgeSettings &s) { s.far_m = 8; },
      [](EdgeSettings &s) { s.far_m = 10; },       [](EdgeSettings &s) { s.far_m = 25; },
  };
  const auto better = [](const Score &a, const Score &b) {
    if (a.tracked != b.tracked)
      return a.tracked > b.tracked;
    return a.all_position_rmse_m < b.all_position_rmse_m;
  };
  const auto run = [&](const EdgeSettings &settings) {
    std::vector<Contender> one;
    one.emplace_back(kind, help, settings);
    return compare(flight, cao_path, one, limits)[0];
  };
  Score best = run(result.best);
  result.tried.emplace_back(result.best, best);
  for (const auto &change : changes) {
    EdgeSettings settings = result.best;
    change(settings);
    const Score score = run(settings);
    result.tried.emplace_back(settings, score);
    if (better(score, best))
      best = score, result.best = settings;
  }
  return result;
}
} // namespace bole
