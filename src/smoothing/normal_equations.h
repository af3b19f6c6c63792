// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Sparse normal equations H x = g of variables of any size, H = L L^T.
///
/// Idea: multifrontal elimination. A node of the elimination tree is one variable or several with the same later
/// neighbours. Its front is the dense system of the node and these neighbours: what factors and the nodes below say.
/// Eliminating the node leaves the columns of L that belong to it, and a Schur complement that goes to the node above.

#include <Eigen/Core>

#include <functional>
#include <initializer_list>
#include <vector>

namespace bole
{
class NormalEquations
{
public:
  /// \p dims: of the variables.
  explicit NormalEquations(const std::vector<int> &dims);

  /// Begins anew with other variables, in the same memory.
  void reset(const std::vector<int> &dims);
  /// Forgets the numbers; which variables are coupled stays.
  void clear();
  /// Adds a factor of residual \p r and Jacobian \p J on variable \p a.
  template <int Rows, int A>
  void add(int a, const Eigen::Matrix<double, Rows, A> &J, const Eigen::Matrix<double, Rows, 1> &r)
  {
    block<A, A>(a, a) += J.transpose().lazyProduct(J);
    m_g.segment<A>(m_offset[a]) -= J.transpose() * r;
  }
  /// The same on two.
  template <int Rows, int A, int B>
  void add(int a, const Eigen::Matrix<double, Rows, A> &J_a, int b, const Eigen::Matrix<double, Rows, B> &J_b,
           const Eigen::Matrix<double, Rows, 1> &r)
  {
    add<Rows, A>(a, J_a, r);
    add<Rows, B>(b, J_b, r);
    if (a > b)
      block<A, B>(a, b) += J_a.transpose().lazyProduct(J_b);
    else
      block<B, A>(b, a) += J_b.transpose().lazyProduct(J_a);
  }
  /// Adds a quadratic x^T H x / 2 - g^T x on several.
  void add(const std::vector<int> &variables, const Eigen::MatrixXd &H, const Eigen::VectorXd &g);

  /// An order with little fill (approximate minimum degree).
  std::vector<int> orderOfLittleFill() const;
  /// Plans the elimination in an order; its last \p together variables are one node. After all factors were added once.
  void plan(const std::vector<int> &order, int together = 0);

  /// Levenberg-Marquardt: the diagonal of H grows by \p damping of itself. \return directions that were held
  int factorise(double damping = 0);
  /// The minimum.
  Eigen::VectorXd solve() const;
  /// By how much the quadratic falls to its minimum.
  double decrease() const;
  /// What the elimination of all others leaves of the last node: in place of factorise(). Its variables stand in the
  /// order that was planned.
  void schur(Eigen::MatrixXd &H, Eigen::VectorXd &g);

  // Of H^-1, after factorise().

  /// The covariance of each node with its later neighbours, \p use(variables, covariance): all that are coupled by a
  /// factor stand together in one of them.
  void sparseInverse(const std::function<void(const std::vector<int> &, const Eigen::MatrixXd &)> &use) const;
  struct Form ///< the columns of one variable in a matrix
  {
    int variable;
    Eigen::Ref<const Eigen::MatrixXd> columns;
  };
  /// X H^-1 X^T, where X is zero but for the columns of the variables given. In a work space of its own.
  Eigen::MatrixXd covariance(std::initializer_list<Form> X) const;

  int dim(int variable) const { return m_dims[variable]; }
  int offset(int variable) const { return m_offset[variable]; }

private:
  struct Block ///< of a column of H, on or below the diagonal
  {
    int row;
    std::size_t at;
  };
  struct Own ///< a block that a node takes into its front
  {
    int variable, other;
    std::size_t at;
    bool is_transposed;
  };
  struct Node
  {
    std::vector<int> variables; ///< eliminated, then neighbours, as planned
    std::size_t eliminated = 1;
    int parent = -1, columns = 0, rows = 0;
    std::vector<int> children, above; ///< above: where its rows that are not eliminated stand in the parent's front
    std::vector<Own> own;
    std::vector<double> panel, contribution; ///< of the front of one row more: columns of L, Schur complement
  };
  using Panel = Eigen::Map<const Eigen::MatrixXd>;

  std::size_t find(int row, int column);
  template <int Rows, int Columns> Eigen::Map<Eigen::Matrix<double, Rows, Columns>> block(int row, int column)
  {
    const std::size_t at = find(row, column); // may move the values
    return Eigen::Map<Eigen::Matrix<double, Rows, Columns>>(m_values.data() + at);
  }
  void eliminationStructure(const std::vector<int> &order, int together, std::vector<int> &children);
  void assemble(const Node &node, double damping);
  void assembleChild(Node &child, int ld);
  Node &newNode();
  void noteRows(const Node &node);
  Panel panelOf(const Node &node) const { return {node.panel.data(), node.rows + 1, node.columns}; }

  std::vector<int> m_dims, m_offset;
  std::vector<std::vector<Block>> m_columns; ///< the diagonal block first
  std::vector<double> m_values;
  Eigen::VectorXd m_g;
  std::vector<Node> m_nodes;                ///< each after those below it,
  std::size_t m_node_count = 0;             ///< of which so many are planned
  std::vector<std::vector<double>> m_spare; ///< memory of contributions that were taken in
  std::vector<int> m_node_of;
  std::vector<std::vector<int>> m_later; ///< work space of plan()
  std::vector<int> m_row;                ///< of a variable in the front
  std::vector<double> m_front;
  mutable std::vector<double> m_work, m_own;
  mutable std::vector<int> m_path;
};

/// Cholesky of the first \p columns of a front of \p ld rows and one column less, in place: L_vv over L_sv (with y_v^T
/// in the last row), the Schur complement in the rest. Reads and writes the lower triangle alone. Returns how many
/// directions had no information beyond rounding; those are held (their step is zero).
int factorFront(double *front, int ld, int columns);
} // namespace bole
