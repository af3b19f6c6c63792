// SPDX-License-Identifier: GPL-2.0-or-later
// Which measurements of a frame agree.
#include "motion/motion_filter.h"

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace
{
constexpr double kDoubt = 24;         // squared misfit beyond its rows at which what stands alone is left out
constexpr double kDoubtOfPoints = 36; // of many corners that agree
constexpr double kUsualMisfit = 2;    // a row, in the mean: what does better is doubted no more

/// All innovations together, some of them left out.
class Innovations
{
public:
  Innovations(const std::vector<MatrixXd> &H, const std::vector<MatrixXd> &noise,
              const std::vector<VectorXd> &residuals, const MatrixXd &P)
  {
    Index count = 0;
    for (const VectorXd &residual : residuals) {
      m_first.push_back(count);
      m_size.push_back(residual.size());
      count += residual.size();
    }
    m_residual.resize(count);
    m_S = MatrixXd::Zero(count, count);
    MatrixXd all(count, P.cols());
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      m_residual.segment(m_first[i], m_size[i]) = residuals[i];
      all.middleRows(m_first[i], m_size[i]) = H[i];
      block(m_S, i) = noise[i];
    }
    m_S.noalias() += all * (P * all.transpose());
    m_is_in.assign(residuals.size(), true);
    invert();
  }

  bool isIn(std::size_t i) const { return m_is_in[i]; }
  void set(std::size_t i, bool is_in)
  {
    m_is_in[i] = is_in;
    invert();
  }
  /// Squared misfit of one that is in, given the others.
  double misfit(std::size_t i) const
  {
    const VectorXd y = (m_inverse * m_residual).segment(m_first[i], m_size[i]);
    return y.dot(m_inverse.block(m_first[i], m_first[i], m_size[i], m_size[i]).ldlt().solve(y));
  }

private:
  Eigen::Block<MatrixXd> block(MatrixXd &of, std::size_t i) const
  {
    return of.block(m_first[i], m_first[i], m_size[i], m_size[i]);
  }

  /// Of S over what is in; what is out stands alone in it.
  void invert()
  {
    MatrixXd S = m_S;
    for (std::size_t i = 0; i < m_is_in.size(); ++i)
      if (!m_is_in[i]) {
        S.middleRows(m_first[i], m_size[i]).setZero();
        S.middleCols(m_first[i], m_size[i]).setZero();
        block(S, i).setIdentity();
      }
    m_inverse = S.llt().solve(MatrixXd::Identity(S.rows(), S.cols()));
  }

  std::vector<Index> m_first, m_size;
  std::vector<bool> m_is_in;
  VectorXd m_residual;
  MatrixXd m_S, m_inverse;
};
} // namespace

/// What a source may differ by from all others before it is left out.
double MotionFilter::doubtOf(Source source, Index rows) const
{
  const double most = source == Source::points ? kDoubtOfPoints : kDoubt;
  return double(rows) + most / std::max(1.0, meanMisfit(source) / kUsualMisfit);
}

/// Turns and steps of an odometry come from one dead reckoning.
double MotionFilter::meanMisfit(Source source) const
{
  const auto of = [this](Source one) { return m_misfit[static_cast<std::size_t>(one)]; };
  if (source == Source::odometry_turn || source == Source::odometry_step)
    return std::max(of(Source::odometry_turn), of(Source::odometry_step));
  return of(source);
}

/// Gyro and odometry contradict each other, no points say which of them errs, and neither did so lately.
bool MotionFilter::isTie(const std::vector<Rows> &rows, Source a, Source b) const
{
  constexpr double kAlike = 2;
  const auto isPoints = [](const Rows &one) { return one.source == Source::points; };
  const double of_a = std::max(1.0, meanMisfit(a)), of_b = std::max(1.0, meanMisfit(b));
  return std::minmax(a, b) == std::minmax(Source::gyro, Source::odometry_turn) &&
         std::none_of(rows.begin(), rows.end(), isPoints) && std::max(of_a, of_b) < kAlike * std::min(of_a, of_b);
}

/// Takes out, one after the other, what the others agree best without; what then agrees with the rest is taken back.
MotionFilter::Judged MotionFilter::judge(const std::vector<Rows> &rows) const
{
  Judged judged;
  judged.misfit.fill(-1);
  for (std::size_t s = 0; s < kSources; ++s)
    judged.is_out[s] = m_is_held && isOdometry(static_cast<Source>(s));
  if (rows.empty())
    return judged;
  std::vector<MatrixXd> H, noise;
  std::vector<VectorXd> residuals;
  for (const Rows &one : rows) {
    H.push_back(one.H);
    noise.push_back(one.noise);
    residuals.push_back(one.residual);
  }
  Innovations innovations(H, noise, residuals, m_covariance);
  const auto beyond = [&](std::size_t i) {
    return innovations.misfit(i) - doubtOf(rows[i].source, rows[i].residual.size());
  };
  std::vector<bool> is_tied(rows.size(), false);
  for (std::size_t round = 0; round < rows.size(); ++round) {
    std::vector<std::pair<double, std::size_t>> failing; // worst first
    for (std::size_t i = 0; i < rows.size(); ++i)
      if (const double by = innovations.isIn(i) ? beyond(i) : 0; by > 0)
        failing.emplace_back(-by, i);
    if (failing.empty())
      break;
    std::sort(failing.begin(), failing.end());
    const std::size_t worst = failing.front().second;
    for (const auto &[by, i] : failing)
      if (i != worst && isTie(rows, rows[worst].source, rows[i].source)) {
        is_tied[i] = is_tied[worst] = true;
        innovations.set(i, false);
      }
    innovations.set(worst, false);
  }
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const bool was_in = innovations.isIn(i);
    if (!was_in)
      innovations.set(i, true);
    const double misfit = innovations.misfit(i);
    if (!was_in && (is_tied[i] || beyond(i) > 0))
      innovations.set(i, false);
    judged.misfit[static_cast<std::size_t>(rows[i].source)] = misfit / double(rows[i].residual.size());
    judged.is_out[static_cast<std::size_t>(rows[i].source)] = !innovations.isIn(i);
  }
  return judged;
}
} // namespace bole
