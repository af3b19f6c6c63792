// SPDX-License-Identifier: GPL-2.0-or-later
#include "pipeline/final_pass.h"

#include <algorithm>
#include <cmath>

namespace bole
{
void Album::add(const vpImage<unsigned char> &image, const LevelImage &level, std::size_t pose, double time_s)
{
  constexpr std::size_t kMostBytes = std::size_t(256) << 20; // of pictures
  if (m_offered++ % m_every != 0)
    return;
  m_frames.push_back({pose, time_s, image, level});
  if (m_frames.size() * image.getSize() <= kMostBytes)
    return;
  m_every *= 2;
  std::deque<KeptFrame> kept; // a vpImage that was moved from would not own what is assigned to it
  for (std::size_t i = 0; i < m_frames.size(); i += 2)
    kept.push_back(std::move(m_frames[i]));
  m_frames = std::move(kept);
}

AlbumGradients::AlbumGradients(const std::deque<KeptFrame> &frames, const GradientOptions &options)
    : m_frames(frames), m_options(options), m_made(frames.size())
{
}

std::shared_ptr<const Gradient> AlbumGradients::operator[](std::size_t frame)
{
  constexpr std::size_t kMostBytes = std::size_t(128) << 20; // 40 s of 320x240 at 10 Hz
  if (m_made[frame])
    return m_made[frame];
  auto gradient = std::make_shared<const Gradient>(computeGradient(m_frames[frame].image, m_options));
  const std::size_t bytes = gradient->signed_x.getSize() * sizeof(float);
  if (m_bytes + bytes <= kMostBytes) {
    m_bytes += bytes;
    m_made[frame] = gradient;
  }
  return gradient;
}

OddsTerms oddsTerms(const ColumnEvidence &evidence, double online)
{
  OddsTerms terms;
  terms << 1, evidence.own, std::clamp(std::min(evidence.background, evidence.nearer), -1.0, 2.0),
      evidence.is_best_at_own, online;
  return terms;
}

OddsTerms oddsWeights()
{
  OddsTerms weights;
  weights << -0.02, -0.93, 1.21, 1.24, 0.71;
  return weights;
}

std::optional<Judged> judge(const Hypothesis &hypothesis, const std::vector<LevelView> &views, double farthest)
{
  const auto evidence = columnEvidence(hypothesis.trunk, views, farthest);
  if (!evidence)
    return std::nullopt;
  return judgedBy(*evidence, hypothesis);
}

Judged judgedBy(const ColumnEvidence &evidence, const Hypothesis &hypothesis)
{
  return {hypothesis.id, hypothesis.trunk, hypothesis.online, evidence,
          oddsWeights().dot(oddsTerms(evidence, hypothesis.online))};
}

namespace
{
constexpr double kGoesOn = -0.25; ///< difference beside a border below which the trunk goes on there

/// How well the borders of a hypothesis are those of its silhouette, in log-odds: what goes on beside one counts.
double silhouette(const Judged &judged)
{
  constexpr double kShading = 0.2; // of the difference beside a border: below it the trunk may go on there
  const auto beside = [](double difference) { return std::min(difference - kShading, 0.0); };
  return judged.log_odds + 0.5 * (beside(judged.evidence.left) + beside(judged.evidence.right));
}
} // namespace

bool goesOnBeside(const ColumnEvidence &evidence) { return evidence.leastBeside() < kGoesOn; }

bool isSilhouetteOf(const Judged &wider, const Judged &narrow)
{
  constexpr double kGain = 0.25;                   // of the difference beside the borders
  constexpr double kWorse = 0.5, kLeastOdds = 1.0; // log-odds
  const auto worst = [](const Judged &one) { return std::min(one.evidence.leastBeside(), 0.0); };
  return worst(wider) > worst(narrow) + kGain && wider.log_odds > std::max(narrow.log_odds - kWorse, kLeastOdds);
}

std::optional<Hypothesis> widerReading(const Judged &judged, const std::vector<LevelView> &views, double farthest,
                                       double radius_max)
{
  const ColumnEvidence &evidence = judged.evidence;
  if (!goesOnBeside(evidence))
    return std::nullopt;
  Eigen::Vector2d toward = Eigen::Vector2d::Zero(); // the trunk, from where it is seen
  for (const LevelView &view : views)
    if (locate(judged.trunk, view, farthest))
      toward += (judged.trunk.axisAt(view.z).head<2>() - view.position).normalized();
  const Eigen::Vector2d left = Eigen::Vector2d(-toward.y(), toward.x()).normalized();
  const double radius = judged.trunk.radius();
  std::optional<Judged> best = judged;
  for (const double more : {0.25, 0.5, 0.75, 1.0, 1.5, 2.0})
    for (const int side : {1, -1}) {
      if ((side > 0 ? evidence.left : evidence.right) > kGoesOn || (1 + more) * radius > radius_max)
        continue;
      Trunk wider = judged.trunk;
      wider.xy += side * more * radius * left;
      wider.log_radius += std::log(1 + more);
      const auto one = judge({judged.id, wider, judged.online}, views, farthest);
      if (one && silhouette(*one) > silhouette(*best))
        best = one;
    }
  if (best->trunk.log_radius == judged.trunk.log_radius)
    return std::nullopt;
  constexpr double kStep = 0.15; // standard deviation, of the radius: the steps above are as fine
  Hypothesis guess{judged.id, best->trunk, judged.online};
  const double sigma = kStep * best->trunk.radius();
  guess.covariance.topLeftCorner<2, 2>() = sigma * sigma * left * left.transpose();
  guess.covariance(2, 2) = kStep * kStep;
  return guess;
}

namespace
{
/// Two hypotheses that fill the same columns in most of the views that show both are made of the same lines.
bool fillSameColumns(const Trunk &a, const Trunk &b, const std::vector<LevelView> &views, double farthest)
{
  constexpr int kLeastShared = 4;
  constexpr double kMostly = 0.5; // of what either fills; of the views
  int both = 0, same = 0;
  for (const LevelView &view : views) {
    const auto at_a = locate(a, view, farthest), at_b = locate(b, view, farthest);
    if (!at_a || !at_b)
      continue;
    ++both;
    const double left = std::min(at_a->bearing + at_a->half_angle, at_b->bearing + at_b->half_angle);
    const double right = std::max(at_a->bearing - at_a->half_angle, at_b->bearing - at_b->half_angle);
    const double either = 2 * (at_a->half_angle + at_b->half_angle) - (left - right);
    same += left - right > kMostly * either;
  }
  return both >= kLeastShared && same > kMostly * both;
}
} // namespace

std::vector<Judged> chooseSet(std::vector<Judged> judged, double least, double apart,
                              const std::vector<LevelView> &views, double farthest)
{
  judged.erase(std::remove_if(judged.begin(), judged.end(), [&](const Judged &one) { return one.log_odds < least; }),
               judged.end());
  std::sort(judged.begin(), judged.end(), [](const Judged &a, const Judged &b) { return a.log_odds > b.log_odds; });
  std::vector<Judged> chosen;
  for (const Judged &one : judged)
    if (std::none_of(chosen.begin(), chosen.end(), [&](const Judged &better) {
          const double between =
              (one.trunk.axisAt(kBreastHeight) - better.trunk.axisAt(kBreastHeight)).head<2>().norm();
          return between < one.trunk.radius() + better.trunk.radius() + apart ||
                 fillSameColumns(one.trunk, better.trunk, views, farthest);
        }))
      chosen.push_back(one);
  return chosen;
}
} // namespace bole
