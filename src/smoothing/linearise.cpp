// SPDX-License-Identifier: GPL-2.0-or-later
// From factors to normal equations. What the prior of the window touches has its Jacobians where that was linearised
// (first estimates): else the directions in which the flight as a whole may move would gain information from nothing.
#include "smoothing/state.h"

#include <algorithm>

namespace bole
{
bool Smoother::State::isTouched(const Name &name) const
{
  if (name.is_pose)
    return name.number >= first_open && points[name.number - first_open].has_value();
  return trunks[name.number].point.has_value();
}

const Pose &Smoother::State::pointOf(std::size_t pose) const
{
  return isTouched({true, pose}) ? *points[pose - first_open] : poses[pose];
}

const Trunk &Smoother::State::pointOf(const TrunkState &trunk) const
{
  return trunk.point ? *trunk.point : trunk.value;
}

Eigen::VectorXd Smoother::State::offsetOf(const Name &name) const
{
  if (name.is_pose)
    return poses[name.number].minus(pointOf(name.number));
  return trunks[name.number].value.minus(pointOf(trunks[name.number]));
}

/// Adds one factor after the other.
class Smoother::State::Adder
{
public:
  Adder(const State &state, const Places &places, NormalEquations *system, bool about_points)
      : m_state(state), m_places(places), m_system(system), m_about_points(about_points)
  {
  }

  /// \p residual(at_points, J): whitened, at the points or at the values.
  template <int Rows, int A, typename Residual> void unary(const Name &a, const Residual &residual)
  {
    Eigen::Matrix<double, Rows, A> J;
    const bool is_touched = m_system && m_state.isTouched(a);
    Eigen::Matrix<double, Rows, 1> r = residual(false, m_system && !is_touched ? &J : nullptr);
    cost += 0.5 * r.squaredNorm();
    if (is_touched)
      residual(true, &J);
    if (is_touched && m_about_points)
      r -= J * m_state.offsetOf(a);
    if (m_system)
      m_system->add<Rows, A>(m_places.of(a), J, r);
  }

  template <int Rows, int A, int B, typename Residual>
  void binary(const Name &a, const Name &b, const Loss &loss, const Residual &residual)
  {
    Eigen::Matrix<double, Rows, A> J_a;
    Eigen::Matrix<double, Rows, B> J_b;
    const bool is_touched = m_system && (m_state.isTouched(a) || m_state.isTouched(b));
    const bool at_values = m_system && !is_touched;
    Eigen::Matrix<double, Rows, 1> r = residual(false, at_values ? &J_a : nullptr, at_values ? &J_b : nullptr);
    const double s = r.squaredNorm();
    cost += 0.5 * loss.rho(s);
    if (!m_system)
      return;
    if (is_touched)
      residual(true, &J_a, &J_b);
    if (is_touched && m_about_points)
      r -= J_a * m_state.offsetOf(a) + J_b * m_state.offsetOf(b);
    const double root = std::sqrt(loss.weight(s));
    m_system->add<Rows, A, B>(m_places.of(a), root * J_a, m_places.of(b), root * J_b, root * r);
  }

  double cost = 0;

private:
  const State &m_state;
  const Places &m_places;
  NormalEquations *m_system;
  bool m_about_points;
};

double Smoother::State::add(std::size_t pose, const Places &places, NormalEquations *system, bool about_points,
                            bool kept_only) const
{
  Adder adder(*this, places, system, about_points);
  const FactorsOfPose &all = factorsOf(pose);
  const auto poseAt = [this](bool at_point, std::size_t i) -> const Pose & { return at_point ? pointOf(i) : poses[i]; };
  const auto trunkAt = [this](bool at_point, std::size_t j) -> const Trunk & {
    return at_point ? pointOf(trunks[j]) : trunks[j].value;
  };
  for (const AbsoluteFactor &factor : all.absolutes)
    adder.unary<6, 6>({true, pose}, [&](bool at_point, Matrix6d *J) {
      return residual(factor.measured, factor.S, poseAt(at_point, pose), J);
    });
  for (const StepFactor &factor : all.steps)
    adder.binary<6, 6, 6>({true, factor.a}, {true, factor.b}, Loss(), [&](bool at_point, Matrix6d *J_a, Matrix6d *J_b) {
      return residual(factor.measured, factor.S, poseAt(at_point, factor.a), poseAt(at_point, factor.b), J_a, J_b);
    });
  for (const DirectionFactor &factor : all.directions)
    adder.binary<5, 6, 6>({true, factor.a}, {true, factor.b}, options.direction_loss,
                          [&](bool at_point, Matrix56d *J_a, Matrix56d *J_b) {
                            return residual(factor.measured, factor.S, options.bMc, poseAt(at_point, factor.a),
                                            poseAt(at_point, factor.b), J_a, J_b);
                          });
  for (const ViewFactor &factor : all.views)
    if (!kept_only || trunks[factor.trunk].is_kept)
      adder.binary<4, 6, 5>({true, pose}, {false, factor.trunk}, options.summary_loss,
                            [&](bool at_point, Matrix46d *J_pose, Matrix45d *J_trunk) {
                              return residual(factor.seen, options.bMc, poseAt(at_point, pose),
                                              trunkAt(at_point, factor.trunk), J_pose, J_trunk);
                            });
  return adder.cost;
}

/// It is linear, so that it may be taken out of a prior again.
double Smoother::State::addTrunkPrior(std::size_t trunk, const Places &places, NormalEquations *system,
                                      bool about_points) const
{
  const TrunkState &state = trunks[trunk];
  Adder adder(*this, places, system, about_points);
  adder.unary<5, 5>({false, trunk}, [&](bool, Matrix5d *J) -> Vector5d {
    if (J)
      *J = state.prior.sigma.cwiseInverse().asDiagonal();
    return residual(state.prior, state.value);
  });
  return adder.cost;
}

double Smoother::State::addWindowPrior(const Places &places, NormalEquations *system, bool about_points) const
{
  if (prior.names.empty())
    return 0;
  Eigen::VectorXd offset(prior.g.size());
  std::vector<int> variables;
  int row = 0;
  for (const Name &name : prior.names) {
    const Eigen::VectorXd own = offsetOf(name);
    offset.segment(row, own.size()) = own;
    row += static_cast<int>(own.size());
    if (system)
      variables.push_back(places.of(name));
  }
  const Eigen::VectorXd pull = prior.H * offset;
  if (system)
    system->add(variables, prior.H, about_points ? prior.g : Eigen::VectorXd(prior.g - pull));
  return 0.5 * offset.dot(pull) - prior.g.dot(offset);
}

/// A step that would throw a trunk across the camera, or change its radius manyfold, is outside what the linearisation
/// knows: only part of it is taken, and the rest found anew from there. \p shift: of the pose that saw it last, with
/// which it may go.
Vector5d Smoother::State::limited(const TrunkState &trunk, const Vector5d &step, const Eigen::Vector2d &shift) const
{
  Vector5d own = step;
  own.head<2>() -= shift;
  const double move = own.head<2>().norm(), resize = std::abs(own(2));
  if (move < 0.1 && resize < 0.5)
    return step;
  const Pose &from = trunk.seen.empty() ? poses.back() : poses[trunk.seen.back()];
  const double limit = std::max(0.1, 0.5 * (from.t.head<2>() - trunk.value.xy).norm());
  own *= std::min({1.0, limit / std::max(move, 1e-9), 0.7 / std::max(resize, 1e-9)});
  own.head<2>() += shift;
  return own;
}

void Smoother::State::move(const Places &places, const NormalEquations &system)
{
  const Eigen::VectorXd step = system.solve();
  std::vector<std::pair<std::size_t, Pose>> moved;
  for (std::size_t v = 0; v < places.names.size(); ++v) {
    const Name &name = places.names[v];
    if (!name.is_pose)
      continue;
    const Pose &point = pointOf(name.number);
    const Vector6d offset = poses[name.number].minus(point);
    moved.emplace_back(name.number, point.plus(offset + step.segment<6>(system.offset(static_cast<int>(v)))));
  }
  const auto shiftOf = [&](const TrunkState &trunk) -> Eigen::Vector2d {
    const auto at = std::lower_bound(moved.begin(), moved.end(), trunk.last_seen,
                                     [](const auto &pose, std::size_t number) { return pose.first < number; });
    if (at == moved.end() || at->first != trunk.last_seen)
      return Eigen::Vector2d::Zero();
    return (at->second.t - poses[at->first].t).head<2>();
  };
  for (std::size_t v = 0; v < places.names.size(); ++v)
    if (!places.names[v].is_pose) {
      TrunkState &trunk = trunks[places.names[v].number];
      const Vector5d own = step.segment<5>(system.offset(static_cast<int>(v)));
      trunk.value = trunk.value.plus(limited(trunk, own, shiftOf(trunk)));
    }
  for (const auto &[pose, value] : moved)
    poses[pose] = value;
}
} // namespace bole
