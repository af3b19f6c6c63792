// SPDX-License-Identifier: GPL-2.0-or-later
// Eliminating one variable from its front, and solving for it afterwards.
#include "smoothing/front_loops.h"
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
namespace
{
using Map = Eigen::Map<Eigen::MatrixXd, 0, Eigen::OuterStride<>>;
constexpr int kLargestBlock = 6; // rows of a variable

/// Adds [J_a J_b]^T [J_a J_b r] to the lower triangle of the front.
template <int Rows, int A, int B> void addBinary(const double *linear, double *front, int ld, int at_a, int at_b)
{
  const Eigen::Map<const Eigen::Matrix<double, Rows, A>> J_a(linear);
  const Eigen::Map<const Eigen::Matrix<double, Rows, B>> J_b(linear + Rows * A);
  const Eigen::Map<const Eigen::Matrix<double, Rows, 1>> r(linear + Rows * (A + B));
  Map F(front, ld, ld - 1, Eigen::OuterStride<>(ld));
  F.block<A, A>(at_a, at_a) += J_a.transpose().lazyProduct(J_a);
  F.block<B, B>(at_b, at_b) += J_b.transpose().lazyProduct(J_b);
  if (at_b > at_a)
    F.block<B, A>(at_b, at_a) += J_b.transpose().lazyProduct(J_a);
  else
    F.block<A, B>(at_a, at_b) += J_a.transpose().lazyProduct(J_b);
  F.block<1, A>(ld - 1, at_a) += r.transpose().lazyProduct(J_a);
  F.block<1, B>(ld - 1, at_b) += r.transpose().lazyProduct(J_b);
}

template <int Rows, int A> void addUnary(const double *linear, double *front, int ld, int at_a)
{
  const Eigen::Map<const Eigen::Matrix<double, Rows, A>> J(linear);
  const Eigen::Map<const Eigen::Matrix<double, Rows, 1>> r(linear + Rows * A);
  Map F(front, ld, ld - 1, Eigen::OuterStride<>(ld));
  F.block<A, A>(at_a, at_a) += J.transpose().lazyProduct(J);
  F.block<1, A>(ld - 1, at_a) += r.transpose().lazyProduct(J);
}

} // namespace

void Smoother::State::assemble(Factor &factor)
{
  if (factor.linear == nullptr && factor.kind != FactorKind::marginal)
    linearise(factor);
  double *F = front.data();
  const int ld = front_rows;
  switch (factor.kind) {
  case FactorKind::pose_prior:
    addUnary<6, 6>(factor.linear.get(), F, ld, position[factor.a]);
    break;
  case FactorKind::odometry:
    addBinary<6, 6, 6>(factor.linear.get(), F, ld, position[factor.a], position[factor.b]);
    break;
  case FactorKind::relative_pose:
    addBinary<5, 6, 6>(factor.linear.get(), F, ld, position[factor.a], position[factor.b]);
    break;
  case FactorKind::observation:
    addBinary<4, 6, 5>(factor.linear.get(), F, ld, position[factor.a], position[factor.b]);
    break;
  case FactorKind::marginal: {
    const MarginalData &data = marginals[factor.data];
    child_map.clear();
    for (const int v : data.variables)
      for (int i = 0; i < variables[v].dim; ++i)
        child_map.push_back(position[v] + i);
    const int m = static_cast<int>(child_map.size());
    for (int c = 0; c < m; ++c) {
      for (int r = c; r < m; ++r) {
        const auto [low, high] = std::minmax(child_map[r], child_map[c]);
        F[low * ld + high] += data.H(r, c);
      }
      F[child_map[c] * ld + ld - 1] += data.g(c);
    }
    break;
  }
  }
}

void Smoother::State::assembleChild(const Variable &child)
{
  child_map.clear();
  bool rising = true;
  for (const int v : child.separator) {
    rising = rising && (child_map.empty() || child_map.back() < position[v]);
    for (int i = 0; i < variables[v].dim; ++i)
      child_map.push_back(position[v] + i);
  }
  const int m = child.separator_dim, ld = front_rows;
  const int *map = child_map.data();
  child_run.resize(static_cast<std::size_t>(m));
  for (int r = m - 1, end = m; r >= 0; --r) {
    child_run[static_cast<std::size_t>(r)] = end;
    if (r > 0 && map[r] != map[r - 1] + 1)
      end = r;
  }
  const double *from = child.contribution.data();
  double *F = front.data();
  for (int c = 0; c < m; ++c) {
    if (rising) {
      double *column = F + map[c] * ld;
      for (int r = c; r < m;) { // a variable's rows stand together, and often those of the next
        const int end = child_run[static_cast<std::size_t>(r)];
        double *to = column + map[r];
        for (int k = 0; k < end - r; ++k)
          to[k] += from[k];
        from += end - r;
        r = end;
      }
    }
    else {
      for (int r = c; r < m; ++r) {
        const auto [low, high] = std::minmax(map[r], map[c]);
        F[low * ld + high] += *from++;
      }
    }
  }
  for (int c = 0; c < m; ++c)
    F[map[c] * ld + ld - 1] += *from++;
}

void Smoother::State::eliminate(int id)
{
  Variable &v = variables[id];
  // structure: the neighbours by factors and by what the children left
  v.separator.clear();
  position.resize(variables.size(), -1);
  position[id] = 0;
  const auto meet = [&](int other) {
    if (position[other] < 0) {
      position[other] = 1;
      v.separator.push_back(other);
    }
  };
  for (const int f : v.assembled) {
    const Factor &factor = factors[f];
    if (factor.kind == FactorKind::marginal) {
      for (const int other : marginals[factor.data].variables)
        meet(other);
      continue;
    }
    meet(factor.a);
    if (factor.b >= 0)
      meet(factor.b);
  }
  for (const int child : v.children)
    for (const int other : variables[child].separator)
      meet(other);
  std::sort(v.separator.begin(), v.separator.end(),
            [this](int l, int r) { return variables[l].order < variables[r].order; });

  int columns = v.dim;
  for (const int other : v.separator) {
    position[other] = columns;
    columns += variables[other].dim;
  }
  const int ld = front_rows = columns + 1;
  v.separator_dim = columns - v.dim;
  front.resize(std::max(front.size(), static_cast<std::size_t>(ld) * columns));
  for (int c = 0; c < columns; ++c) // what is above the blocks of the diagonal is never read
    std::fill(front.data() + c * ld + std::max(0, c - kLargestBlock), front.data() + (c + 1) * ld, 0.0);

  // numbers
  for (const int f : v.assembled)
    assemble(factors[f]);
  for (const int child : v.children)
    assembleChild(variables[child]);
  v.share = 0;
  if (!v.is_pose) {
    const TrunkState &trunk = trunks[v.number];
    const Vector5d r = residual(trunk.prior, trunk.point);
    for (int i = 0; i < 5; ++i) {
      front[i * ld + i] += 1 / (trunk.prior.sigma(i) * trunk.prior.sigma(i));
      front[i * ld + ld - 1] -= r(i) / trunk.prior.sigma(i);
    }
    v.share = 0.5 * r.squaredNorm();
  }
  if (damping > 0)
    for (int i = 0; i < v.dim; ++i)
      front[i * ld + i] += damping * damping_scale[id](i);
  held_directions += factorFront(front.data(), ld, v.dim);

  // keep the columns of L, y, and the contribution
  const int rows = ld - 1;
  std::vector<float>().swap(v.old_columns);
  v.columns.resize(static_cast<std::size_t>(rows) * v.dim);
  for (int c = 0; c < v.dim; ++c) {
    std::copy_n(front.data() + c * ld, rows, v.columns.data() + c * rows);
    v.y[c] = front[c * ld + rows];
    v.share -= 0.5 * v.y[c] * v.y[c];
  }
  const int m = v.separator_dim;
  v.contribution.resize(static_cast<std::size_t>(m) * (m + 3) / 2);
  double *to = v.contribution.data();
  for (int c = v.dim; c < rows; ++c)
    to = std::copy(front.data() + c * ld + c, front.data() + c * ld + rows, to);
  for (int c = v.dim; c < rows; ++c)
    *to++ = front[c * ld + rows];
  v.has_contribution = true;
  v.eliminated = true;
  v.parent = -1;
  if (!v.separator.empty()) {
    v.parent = v.separator.front();
    variables[v.parent].children.push_back(id);
  }
  position[id] = -1;
  for (const int other : v.separator)
    position[other] = -1;
}

/// Fills \p rhs with y_v - L_sv^T delta_s, and returns how far delta_v is from the solution of
/// L_vv^T delta_v = rhs, in standard deviations of v given its separator. Half its square is what
/// the cost of the linearised graph would fall by if v alone were solved again.
double Smoother::State::staleness(const Variable &v, double *rhs)
{
  const int rows = v.dim + v.separator_dim;
  separator_delta.resize(std::max(separator_delta.size(), static_cast<std::size_t>(v.separator_dim)));
  double *to = separator_delta.data();
  for (const int id : v.separator) {
    const Variable &other = variables[id];
    to = std::copy_n(other.delta.data(), other.dim, to);
  }
  return withColumns(v, [&](const auto *columns) {
    for (int c = 0; c < v.dim; ++c)
      rhs[c] = v.y[c] - product(columns + c * rows + v.dim, separator_delta.data(), v.separator_dim);
    double squares = 0;
    for (int c = 0; c < v.dim; ++c) {
      const auto *column = columns + c * rows;
      double off = rhs[c];
      for (int i = c; i < v.dim; ++i)
        off -= column[i] * v.delta(i);
      squares += off * off;
    }
    return std::sqrt(squares);
  });
}

/// delta_v = L_vv^-T rhs; \p rhs is overwritten.
void Smoother::State::solve(Variable &v, double *rhs)
{
  const int rows = v.dim + v.separator_dim;
  withColumns(v, [&](const auto *columns) {
    for (int c = v.dim - 1; c >= 0; --c) {
      const auto *column = columns + c * rows;
      for (int i = c + 1; i < v.dim; ++i)
        rhs[c] -= column[i] * rhs[i];
      rhs[c] /= column[c];
    }
  });
  for (int c = 0; c < v.dim; ++c)
    v.delta(c) = rhs[c];
}
} // namespace bole
