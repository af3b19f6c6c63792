// SPDX-License-Identifier: GPL-2.0-or-later
#include "smoothing/normal_equations.h"

#include <Eigen/OrderingMethods>
#include <Eigen/SparseCore>

#include <algorithm>
#include <numeric>
#include <utility>

namespace bole
{
using Eigen::MatrixXd;
using Eigen::VectorXd;

NormalEquations::NormalEquations(const std::vector<int> &dims) { reset(dims); }

void NormalEquations::reset(const std::vector<int> &dims)
{
  constexpr std::size_t kUsual = 24; // blocks of a column: what a pose sees
  m_dims = dims;
  m_offset.resize(dims.size());
  m_columns.resize(std::max(m_columns.size(), dims.size()));
  m_node_of.resize(dims.size());
  m_row.resize(dims.size());
  m_values.clear();
  m_node_count = 0;
  int at = 0;
  for (std::size_t v = 0; v < dims.size(); ++v) {
    m_offset[v] = at;
    at += dims[v];
    m_columns[v].clear();
    m_columns[v].reserve(kUsual);
    find(static_cast<int>(v), static_cast<int>(v));
  }
  m_g.setZero(at);
}

void NormalEquations::clear()
{
  std::fill(m_values.begin(), m_values.end(), 0.0);
  m_g.setZero();
}

/// Where the numbers of a block begin; a new one is zero.
std::size_t NormalEquations::find(int row, int column)
{
  std::vector<Block> &blocks = m_columns[column];
  for (const Block &block : blocks)
    if (block.row == row)
      return block.at;
  blocks.push_back({row, m_values.size()});
  m_values.resize(m_values.size() + static_cast<std::size_t>(m_dims[row] * m_dims[column]), 0.0);
  return blocks.back().at;
}

void NormalEquations::add(const std::vector<int> &variables, const MatrixXd &H, const VectorXd &g)
{
  int c = 0;
  for (const int column : variables) {
    int r = 0;
    for (const int row : variables) {
      if (row >= column) {
        const std::size_t at = find(row, column); // may move the values
        Eigen::Map<MatrixXd>(m_values.data() + at, m_dims[row], m_dims[column]) +=
            H.block(r, c, m_dims[row], m_dims[column]);
      }
      r += m_dims[row];
    }
    m_g.segment(m_offset[column], m_dims[column]) += g.segment(c, m_dims[column]);
    c += m_dims[column];
  }
}

std::vector<int> NormalEquations::orderOfLittleFill() const
{
  const int n = static_cast<int>(m_dims.size());
  std::vector<Eigen::Triplet<double>> pairs;
  for (int column = 0; column < n; ++column)
    for (const Block &block : m_columns[column]) {
      pairs.emplace_back(block.row, column, 1.0);
      if (block.row != column)
        pairs.emplace_back(column, block.row, 1.0);
    }
  Eigen::SparseMatrix<double> pattern(n, n);
  pattern.setFromTriplets(pairs.begin(), pairs.end());
  Eigen::PermutationMatrix<Eigen::Dynamic> place;
  Eigen::AMDOrdering<int>()(pattern, place);
  return {place.indices().data(), place.indices().data() + n};
}

/// Fills m_later: the later neighbours of each place in the order, as places; \p children: how many.
void NormalEquations::eliminationStructure(const std::vector<int> &order, int together, std::vector<int> &children)
{
  const int n = static_cast<int>(order.size());
  std::vector<int> place(order.size());
  for (int p = 0; p < n; ++p)
    place[order[p]] = p;
  m_later.resize(std::max(m_later.size(), order.size()));
  for (int p = 0; p < n; ++p)
    m_later[p].clear();
  for (int column = 0; column < n; ++column)
    for (const Block &block : m_columns[column])
      if (block.row != column)
        m_later[std::min(place[column], place[block.row])].push_back(std::max(place[column], place[block.row]));
  children.assign(order.size(), 0);
  std::vector<int> seen(order.size(), -1), first_below = seen, next_below = seen;
  for (int p = 0; p < n; ++p) {
    std::vector<int> &later = m_later[p];
    if (p >= n - together) {
      later.resize(static_cast<std::size_t>(n - p - 1));
      std::iota(later.begin(), later.end(), p + 1);
    }
    else {
      for (const int q : later)
        seen[q] = p;
      for (int child = first_below[p]; child >= 0; child = next_below[child])
        for (const int q : m_later[child])
          if (q > p && std::exchange(seen[q], p) != p)
            later.push_back(q);
      std::sort(later.begin(), later.end());
    }
    if (!later.empty()) {
      next_below[p] = std::exchange(first_below[later.front()], p);
      ++children[later.front()];
    }
  }
}

void NormalEquations::plan(const std::vector<int> &order, int together)
{
  constexpr std::size_t kChain = 5; // variables of a chain that are one node: some zeros cost less than a front each
  const int n = static_cast<int>(order.size());
  std::vector<int> children, place(order.size()), node_at(order.size());
  eliminationStructure(order, together, children);
  const std::vector<std::vector<int>> &later = m_later;
  m_node_count = 0;
  for (int p = 0; p < n; ++p) {
    place[order[p]] = p;
    const int before = p == 0 ? -1 : node_at[p - 1];
    const bool is_in_last = p > n - together;
    const bool is_only_child = p > 0 && children[p] == 1 && !later[p - 1].empty() && later[p - 1].front() == p;
    const bool is_dense = is_only_child && later[p - 1].size() == later[p].size() + 1;
    if (is_in_last ||
        (p != n - together && (is_dense || (is_only_child && m_nodes[before].variables.size() < kChain)))) {
      m_nodes[before].variables.push_back(p);
      node_at[p] = before;
    }
    else {
      node_at[p] = static_cast<int>(m_node_count);
      newNode().variables.push_back(p);
    }
  }
  for (std::size_t k = 0; k < m_node_count; ++k) {
    Node &node = m_nodes[k];
    node.eliminated = node.variables.size();
    const std::vector<int> &neighbours = later[node.variables.back()];
    if (!neighbours.empty()) {
      node.parent = node_at[neighbours.front()];
      m_nodes[node.parent].children.push_back(static_cast<int>(k));
    }
    node.variables.insert(node.variables.end(), neighbours.begin(), neighbours.end());
    for (std::size_t i = 0; i < node.variables.size(); ++i) {
      node.variables[i] = order[node.variables[i]];
      node.rows += m_dims[node.variables[i]];
      if (i < node.eliminated) {
        node.columns += m_dims[node.variables[i]];
        m_node_of[node.variables[i]] = static_cast<int>(k);
      }
    }
  }
  for (int column = 0; column < n; ++column)
    for (const Block &block : m_columns[column]) {
      const bool is_transposed = place[block.row] < place[column];
      const int first = is_transposed ? block.row : column, second = is_transposed ? column : block.row;
      m_nodes[m_node_of[first]].own.push_back({first, second, block.at, is_transposed});
    }
  for (std::size_t k = 0; k < m_node_count; ++k) {
    noteRows(m_nodes[k]);
    for (const int number : m_nodes[k].children) {
      Node &child = m_nodes[number];
      for (std::size_t i = child.eliminated; i < child.variables.size(); ++i)
        for (int d = 0; d < m_dims[child.variables[i]]; ++d)
          child.above.push_back(m_row[child.variables[i]] + d);
      child.above.push_back(m_nodes[k].rows); // the right-hand side
    }
  }
}

/// Takes the memory of one that was planned before.
NormalEquations::Node &NormalEquations::newNode()
{
  if (m_node_count == m_nodes.size())
    m_nodes.emplace_back();
  Node &node = m_nodes[m_node_count++];
  node.variables.clear();
  node.children.clear();
  node.above.clear();
  node.own.clear();
  node.parent = -1;
  node.columns = node.rows = 0;
  return node;
}

/// Notes where each variable stands in the front.
void NormalEquations::noteRows(const Node &node)
{
  int rows = 0;
  for (const int v : node.variables) {
    m_row[v] = rows;
    rows += m_dims[v];
  }
}

/// The children's variables stand in the same order, so lower triangles stay lower ones.
void NormalEquations::assembleChild(Node &child, int ld)
{
  const std::vector<int> &to = child.above;
  const double *from = child.contribution.data();
  for (std::size_t c = 0; c + 1 < to.size(); ++c) {
    double *column = m_front.data() + static_cast<std::ptrdiff_t>(to[c]) * ld;
    for (std::size_t r = c; r < to.size(); ++r)
      column[to[r]] += *from++;
  }
  m_spare.push_back(std::move(child.contribution));
}

void NormalEquations::assemble(const Node &node, double damping)
{
  const int ld = node.rows + 1;
  noteRows(node);
  const std::size_t size = static_cast<std::size_t>(ld) * static_cast<std::size_t>(node.rows);
  m_front.resize(std::max(m_front.size(), size));
  std::fill(m_front.begin(), m_front.begin() + static_cast<std::ptrdiff_t>(size), 0.0);
  for (const Own &own : node.own) {
    const int rows = m_dims[own.other], columns = m_dims[own.variable];
    const double *from = m_values.data() + own.at;
    double *to = m_front.data() + static_cast<std::ptrdiff_t>(m_row[own.variable]) * ld;
    const int along = own.is_transposed ? columns : 1, across = own.is_transposed ? 1 : rows;
    for (int c = 0; c < columns; ++c, to += ld)
      for (int r = 0; r < rows; ++r)
        to[m_row[own.other] + r] = from[r * along + c * across];
    if (own.variable != own.other)
      continue;
    to -= static_cast<std::ptrdiff_t>(columns) * ld;
    for (int c = 0; c < columns; ++c, to += ld) {
      to[m_row[own.variable] + c] *= 1 + damping;
      to[ld - 1] = m_g[m_offset[own.variable] + c];
    }
  }
  for (const int child : node.children)
    assembleChild(m_nodes[child], ld);
}

int NormalEquations::factorise(double damping)
{
  int held = 0;
  for (std::size_t k = 0; k < m_node_count; ++k) {
    Node &node = m_nodes[k];
    assemble(node, damping);
    const int ld = node.rows + 1;
    held += factorFront(m_front.data(), ld, node.columns);
    node.panel.assign(m_front.begin(), m_front.begin() + static_cast<std::ptrdiff_t>(ld) * node.columns);
    const int m = node.rows - node.columns;
    if (!m_spare.empty()) {
      node.contribution = std::move(m_spare.back());
      m_spare.pop_back();
    }
    node.contribution.resize(static_cast<std::size_t>(m) * static_cast<std::size_t>(m + 3) / 2);
    double *to = node.contribution.data();
    for (int c = node.columns; c < node.rows; ++c) {
      const double *column = m_front.data() + static_cast<std::ptrdiff_t>(c) * ld;
      to = std::copy(column + c, column + ld, to);
    }
  }
  return held;
}

void NormalEquations::schur(MatrixXd &H, VectorXd &g)
{
  const Node &root = m_nodes[--m_node_count];
  factorise();
  ++m_node_count;
  assemble(root, 0);
  const Eigen::Map<const MatrixXd> F(m_front.data(), root.rows + 1, root.rows);
  H = F.topRows(root.rows).selfadjointView<Eigen::Lower>();
  g = F.bottomRows<1>().transpose();
}

double NormalEquations::decrease() const
{
  double sum = 0;
  for (std::size_t k = 0; k < m_node_count; ++k)
    sum += 0.5 * panelOf(m_nodes[k]).bottomRows<1>().squaredNorm();
  return sum;
}

VectorXd NormalEquations::solve() const
{
  VectorXd x = VectorXd::Zero(m_g.size()), later;
  for (std::size_t k = m_node_count; k-- > 0;) {
    const Node *node = &m_nodes[k];
    const int c = node->columns, m = node->rows - c;
    later.resize(m);
    int row = 0;
    for (std::size_t i = node->eliminated; i < node->variables.size(); ++i) {
      const int v = node->variables[i];
      later.segment(row, m_dims[v]) = x.segment(m_offset[v], m_dims[v]);
      row += m_dims[v];
    }
    const Panel L = panelOf(*node);
    VectorXd own = L.bottomRows<1>().transpose();
    own.noalias() -= L.middleRows(c, m).transpose() * later;
    L.topRows(c).triangularView<Eigen::Lower>().transpose().solveInPlace(own);
    row = 0;
    for (std::size_t i = 0; i < node->eliminated; ++i) {
      const int v = node->variables[i];
      x.segment(m_offset[v], m_dims[v]) = own.segment(row, m_dims[v]);
      row += m_dims[v];
    }
  }
  return x;
}

/// Takahashi's recursion: with Z = L_sv L_vv^-1 and the covariance S of the neighbours, which stands in that of the
/// node above, the cross covariance is -S Z and the node's own (L_vv L_vv^T)^-1 + Z^T S Z.
void NormalEquations::sparseInverse(const std::function<void(const std::vector<int> &, const MatrixXd &)> &use) const
{
  std::vector<MatrixXd> inverse(m_node_count);
  std::vector<std::size_t> pending(m_node_count);
  for (std::size_t k = m_node_count; k-- > 0;) {
    const Node &node = m_nodes[k];
    const int c = node.columns, m = node.rows - c;
    MatrixXd &C = inverse[k];
    C.resize(node.rows, node.rows);
    if (node.parent >= 0) {
      const MatrixXd &above = inverse[node.parent];
      for (int j = 0; j < m; ++j)
        for (int i = 0; i < m; ++i)
          C(c + i, c + j) = above(node.above[i], node.above[j]);
      if (--pending[node.parent] == 0)
        inverse[node.parent].resize(0, 0);
    }
    const Panel L = panelOf(node);
    MatrixXd own = MatrixXd::Identity(c, c);
    L.topRows(c).triangularView<Eigen::Lower>().solveInPlace(own);
    const MatrixXd Z = L.middleRows(c, m) * own;
    C.bottomLeftCorner(m, c).noalias() = -C.bottomRightCorner(m, m) * Z;
    C.topRightCorner(c, m) = C.bottomLeftCorner(m, c).transpose();
    C.topLeftCorner(c, c).noalias() = own.transpose() * own;
    C.topLeftCorner(c, c).noalias() -= Z.transpose() * C.bottomLeftCorner(m, c);
    use(node.variables, C);
    pending[k] = node.children.size();
    if (node.children.empty())
      C.resize(0, 0);
  }
}

/// |L^-1 X^T|^2, which is zero outside the paths from the variables to the roots.
MatrixXd NormalEquations::covariance(std::initializer_list<Form> X) const
{
  const Eigen::Index count = X.begin()->columns.rows();
  MatrixXd form = MatrixXd::Zero(count, count);
  m_work.assign(static_cast<std::size_t>(m_g.size() * count), 0.0);
  Eigen::Map<MatrixXd> b(m_work.data(), m_g.size(), count);
  m_path.clear();
  for (const Form &one : X) {
    b.middleRows(m_offset[one.variable], m_dims[one.variable]) += one.columns.transpose();
    for (int k = m_node_of[one.variable]; k >= 0; k = m_nodes[k].parent)
      m_path.push_back(k);
  }
  std::sort(m_path.begin(), m_path.end());
  m_path.erase(std::unique(m_path.begin(), m_path.end()), m_path.end());
  for (const int k : m_path) {
    const Node &node = m_nodes[k];
    const Panel L = panelOf(node);
    m_own.resize(static_cast<std::size_t>(node.columns * count));
    Eigen::Map<MatrixXd> own(m_own.data(), node.columns, count);
    int row = 0;
    for (std::size_t i = 0; i < node.variables.size(); ++i) {
      const int v = node.variables[i], d = m_dims[v];
      if (i < node.eliminated)
        own.middleRows(row, d) = b.middleRows(m_offset[v], d);
      else
        b.middleRows(m_offset[v], d).noalias() -= L.middleRows(row, d) * own;
      row += d;
      if (i + 1 == node.eliminated) {
        Eigen::Index first = 0; // above it b is zero, and so is the solution
        while (first < own.rows() && own.row(first).isZero(0))
          ++first;
        const Eigen::Index rest = own.rows() - first;
        auto solved = own.bottomRows(rest);
        L.block(first, first, rest, rest).triangularView<Eigen::Lower>().solveInPlace(solved);
        form.noalias() += solved.transpose() * solved;
      }
    }
  }
  return form;
}
} // namespace bole
