// SPDX-License-Identifier: GPL-2.0-or-later
#include "geometry/failure.h"
#include "input/regular_file.h"
#include "smoothing/factors.h"
#include <bole/graph.h>

#include <Eigen/Geometry>
#include <Eigen/LU>

#include <charconv>
#include <cmath>
#include <functional>
#include <istream>
#include <sstream>
#include <unordered_map>

namespace bole
{
namespace
{
class Reader
{
public:
  Reader(std::istream &in, const std::string &name) : m_lines(in, name), m_name(name) {}

  Graph read()
  {
    while (m_lines.next()) {
      m_line = m_lines.number();
      m_fields.clear();
      m_next = 0;
      std::istringstream words(m_lines.line().substr(0, m_lines.line().find('#')));
      for (std::string word; words >> word;)
        m_fields.push_back(word);
      if (!m_fields.empty())
        readLine();
    }
    resolveEdges();
    if (m_graph.poses.empty())
      throw badValue("{}: no pose, must have VERTEX_SE3:QUAT or VERTEX_SE2", m_name);
    if (m_graph.pose_priors.empty()) {
      hold(0);
      m_graph.assumed = fmt::format("no pose is held by the file: pose {} stays where it is", m_graph.poses[0].id);
    }
    if (const std::optional<std::size_t> loose = untiedPose(m_graph)) {
      const std::int64_t name = m_graph.poses[*loose].id;
      m_line = m_line_of.at(name);
      fail("pose {}, must be tied to the world by EDGE_SE3:QUAT and an EDGE_SE3_PRIOR:QUAT", name);
    }
    try {
      validate(m_graph);
    }
    catch (const vpException &error) {
      throw badValue("{}: {}", m_name, error.what());
    }
    return std::move(m_graph);
  }

private:
  template <typename... Arguments>
  [[noreturn]] void fail(fmt::format_string<Arguments...> text, Arguments &&...arguments) const
  {
    throw badValue("{}:{}: {}", m_name, m_line, fmt::format(text, std::forward<Arguments>(arguments)...));
  }

  std::string word()
  {
    if (m_next >= m_fields.size())
      fail("{}: the line ends too early", m_fields[0]);
    return m_fields[m_next++];
  }
  double number()
  {
    const std::string text = word();
    double value = 0;
    if (!isRead(text, value) || !std::isfinite(value))
      fail("{}: {} = {}, must be a finite number", m_fields[0], m_next - 1, text);
    return value;
  }
  std::int64_t id()
  {
    const std::string text = word();
    std::int64_t value = 0;
    if (!isRead(text, value) || value < 0)
      fail("{}: id = {}, must be a whole number of at least 0 and below 2^63", m_fields[0], text);
    return value;
  }
  /// Whatever the locale is.
  template <typename Number> static bool isRead(const std::string &text, Number &value)
  {
    const char *begin = text.data() + (text[0] == '+'), *end = text.data() + text.size();
    const auto [stop, error] = std::from_chars(begin, end, value);
    return error == std::errc() && stop == end && begin != end;
  }
  template <int N> Eigen::Matrix<double, N, 1> vector()
  {
    Eigen::Matrix<double, N, 1> v;
    for (int i = 0; i < N; ++i)
      v(i) = number();
    return v;
  }
  Eigen::Matrix3d rotation()
  {
    const Eigen::Vector4d q = vector<4>();
    if (!(std::abs(q.norm() - 1) < 1e-3))
      fail("{}: quaternion of length {:.6g}, must have length 1", m_fields[0], q.norm());
    return Eigen::Quaterniond(q(3), q(0), q(1), q(2)).normalized().toRotationMatrix();
  }
  Pose pose()
  {
    const Eigen::Vector3d t = vector<3>();
    return {rotation(), t};
  }
  template <int N> Eigen::Matrix<double, N, N> upper()
  {
    Eigen::Matrix<double, N, N> m;
    for (int r = 0; r < N; ++r)
      for (int c = r; c < N; ++c)
        m(r, c) = m(c, r) = number();
    return m;
  }
  template <int N> Eigen::Matrix<double, N, N> positiveDefinite(const Eigen::Matrix<double, N, N> &m)
  {
    try {
      squareRootInformation<N>(m, "matrix");
    }
    catch (const vpException &) {
      fail("{}: matrix, must be positive definite, its inverse too", m_fields[0]);
    }
    return m;
  }
  Matrix6d covariance()
  {
    Vector6d scale;
    scale << 1, 1, 1, 0.5, 0.5, 0.5;
    const Matrix6d information = scale.asDiagonal() * positiveDefinite<6>(upper<6>()) * scale.asDiagonal();
    const Matrix6d inverse = information.inverse();
    return positiveDefinite<6>(0.5 * (inverse + inverse.transpose()));
  }
  /// In the plane: what leaves it is held as firmly.
  Pose planarPose()
  {
    const Eigen::Vector3d v = vector<3>();
    return {Eigen::AngleAxisd(v.z(), Eigen::Vector3d::UnitZ()).toRotationMatrix(), {v.x(), v.y(), 0}};
  }
  Matrix6d planarCovariance()
  {
    const Eigen::Matrix3d C = positiveDefinite<3>(upper<3>()).inverse();
    constexpr int kAt[3] = {0, 1, 5};
    Matrix6d covariance = Matrix6d::Zero();
    covariance.diagonal() << 0, 0, C(0, 0), C(2, 2), C(2, 2), 0;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        covariance(kAt[r], kAt[c]) = 0.5 * (C(r, c) + C(c, r));
    return positiveDefinite<6>(covariance);
  }
  /// As good as fixed where it stands.
  void hold(std::size_t pose)
  {
    constexpr double kSure = 1e-6; // [m], [rad]
    m_graph.pose_priors.push_back({pose, {m_graph.poses[pose].wMb, kSure * kSure * Matrix6d::Identity()}});
  }
  Trunk trunk()
  {
    const Vector5d v = vector<5>();
    if (!std::isnormal(std::exp(v(2))))
      fail("{}: log_r = {}, must be the logarithm of a radius", m_fields[0], v(2));
    return {v.head<2>(), v(2), v.tail<2>()};
  }

  void readLine()
  {
    const std::string tag = word();
    if (tag == "VERTEX_SE3:QUAT")
      readPose([this] { return pose(); });
    else if (tag == "VERTEX_SE2")
      readPose([this] { return planarPose(); });
    else if (tag == "VERTEX_TRUNK")
      readTrunk();
    else if (tag == "EDGE_SE3:QUAT")
      readOdometry([this] { return pose(); }, [this] { return covariance(); });
    else if (tag == "EDGE_SE2")
      readOdometry([this] { return planarPose(); }, [this] { return planarCovariance(); });
    else if (tag == "EDGE_SE3_PRIOR:QUAT" || tag == "EDGE_SE3_PRIOR")
      readPosePrior(tag == "EDGE_SE3_PRIOR");
    else if (tag == "FIX")
      readFixed();
    else if (tag == "EDGE_TRUNK_SUMMARY")
      readSummary();
    else if (tag == "EDGE_DIRECTION")
      readDirection();
    else if (tag == "PARAMS_SE3OFFSET") {
      const std::int64_t name = id();
      m_graph.bMc = m_offset_of[name] = pose();
    }
    else if (tag == "LOSS")
      readLoss();
    else
      fail("tag = {}, must be VERTEX_SE3:QUAT, VERTEX_SE2, VERTEX_TRUNK, EDGE_SE3:QUAT, EDGE_SE2, EDGE_SE3_PRIOR:QUAT, "
           "EDGE_SE3_PRIOR, EDGE_TRUNK_SUMMARY, EDGE_DIRECTION, FIX, PARAMS_SE3OFFSET or LOSS",
           tag);
    if (m_next != m_fields.size())
      fail("{}: {} fields, must be {}", tag, m_fields.size(), m_next);
  }

  std::int64_t newId()
  {
    const std::int64_t name = id();
    const auto [at, fresh] = m_line_of.emplace(name, m_line);
    if (!fresh)
      fail("id = {}, must not be that of line {}", name, at->second);
    return name;
  }
  template <typename ReadPose> void readPose(const ReadPose &read)
  {
    const std::int64_t name = newId();
    m_pose_of[name] = m_graph.poses.size();
    m_graph.poses.push_back({name, read()});
  }
  void readTrunk()
  {
    const std::int64_t name = newId();
    Graph::TrunkVertex vertex;
    vertex.id = name;
    vertex.trunk = trunk();
    vertex.prior.mean = trunk();
    vertex.prior.sigma = vector<5>();
    if (!(vertex.prior.sigma.array() > 0).all())
      fail("VERTEX_TRUNK: sigma, must be above 0");
    m_trunk_of[name] = m_graph.trunks.size();
    m_graph.trunks.push_back(vertex);
  }
  /// Adds an edge between two poses.
  template <typename Edge> void readPoses(std::vector<Edge> &edges)
  {
    const std::int64_t a = id(), b = id();
    if (a == b)
      fail("{}: must be between two poses", m_fields[0]);
    edges.emplace_back();
    later([this, &edges, a, b, i = edges.size() - 1] {
      edges[i].a = find(m_pose_of, a, "pose");
      edges[i].b = find(m_pose_of, b, "pose");
    });
  }

  template <typename ReadPose, typename ReadCovariance>
  void readOdometry(const ReadPose &read_pose, const ReadCovariance &read_covariance)
  {
    readPoses(m_graph.odometry);
    Odometry &odometry = m_graph.odometry.back().odometry;
    odometry.aMb = read_pose();
    odometry.covariance = read_covariance();
  }
  /// \p is_of_sensor: of what the pose carries at the PARAMS_SE3OFFSET that is named after it.
  void readPosePrior(bool is_of_sensor)
  {
    Graph::PosePriorEdge edge;
    const std::int64_t a = id();
    std::optional<std::int64_t> parameter;
    if (is_of_sensor)
      parameter = id();
    edge.prior.mean = pose();
    edge.prior.covariance = covariance();
    m_graph.pose_priors.push_back(edge);
    later([this, a, parameter, i = m_graph.pose_priors.size() - 1] {
      Graph::PosePriorEdge &read = m_graph.pose_priors[i];
      read.pose = find(m_pose_of, a, "pose");
      if (!parameter)
        return;
      const auto offset = m_offset_of.find(*parameter);
      if (offset == m_offset_of.end())
        fail("EDGE_SE3_PRIOR: parameter {}, must be that of a PARAMS_SE3OFFSET", *parameter);
      const Matrix6d Ad = adjoint(offset->second);
      read.prior.mean = read.prior.mean * offset->second.inverse();
      read.prior.covariance = Ad * read.prior.covariance * Ad.transpose();
    });
  }
  void readFixed()
  {
    do {
      const std::int64_t name = id();
      later([this, name] { m_fixed.push_back(find(m_pose_of, name, "pose")); });
    } while (m_next < m_fields.size());
  }
  void readSummary()
  {
    Graph::ObservationEdge edge;
    const std::int64_t a = id(), b = id();
    edge.summary.optimum.cRt = rotation();
    edge.summary.optimum.log_ratio = number();
    edge.summary.energy = number();
    edge.summary.f = vector<4>();
    edge.summary.F = upper<4>();
    SquareRootSummary root;
    const SummaryStatus status = squareRoot(edge.summary, root);
    if (status == SummaryStatus::indefinite)
      fail("EDGE_TRUNK_SUMMARY: F, must be positive semi-definite");
    if (status == SummaryStatus::not_finite)
      fail("EDGE_TRUNK_SUMMARY: log(r/d), must be below 0");
    m_graph.observations.push_back(edge);
    later([this, a, b, i = m_graph.observations.size() - 1] {
      m_graph.observations[i].pose = find(m_pose_of, a, "pose");
      m_graph.observations[i].trunk = find(m_trunk_of, b, "trunk");
    });
  }
  void readDirection()
  {
    readPoses(m_graph.relative_poses);
    RelativePoseMeasurement &measurement = m_graph.relative_poses.back().measurement;
    measurement.caRcb = rotation();
    measurement.direction = vector<3>();
    if (!(std::abs(measurement.direction.norm() - 1) < 1e-3))
      fail("EDGE_DIRECTION: direction, must have length 1");
    measurement.direction.normalize();
    measurement.covariance = positiveDefinite<5>(upper<5>());
  }
  void readLoss()
  {
    const std::string which = word(), kind = word();
    if (which != "summary" && which != "direction")
      fail("LOSS: {}, must be summary or direction", which);
    Loss loss;
    try {
      loss.kind = lossKindFromString(kind);
    }
    catch (const vpException &error) {
      fail("{}", error.what());
    }
    loss.width = number();
    if (!(loss.width > 0))
      fail("LOSS: width, must be above 0");
    (which == "summary" ? m_graph.summary_loss : m_graph.direction_loss) = loss;
  }

  /// Edges may stand before their vertices: names are looked up at the end, errors keep their line.
  void later(std::function<void()> resolve) { m_later.emplace_back(m_line, std::move(resolve)); }
  void resolveEdges()
  {
    for (const auto &[line, resolve] : m_later) {
      m_line = line;
      resolve();
    }
    for (const std::size_t pose : m_fixed)
      hold(pose);
  }
  std::size_t find(const std::unordered_map<std::int64_t, std::size_t> &names, std::int64_t name,
                   const char *kind) const
  {
    const auto at = names.find(name);
    if (at == names.end())
      fail("id = {}, must be that of a {}", name, kind);
    return at->second;
  }

  TextLines m_lines;
  std::string m_name;
  std::size_t m_line = 0, m_next = 0;
  std::vector<std::string> m_fields;
  Graph m_graph;
  std::unordered_map<std::int64_t, std::size_t> m_line_of, m_pose_of, m_trunk_of;
  std::unordered_map<std::int64_t, Pose> m_offset_of;
  std::vector<std::size_t> m_fixed;
  std::vector<std::pair<std::size_t, std::function<void()>>> m_later;
};
} // namespace

Graph readG2o(std::istream &in, const std::string &name) { return Reader(in, name).read(); }

Graph readG2o(const std::string &path)
{
  std::ifstream in = openRegularFile(path);
  return readG2o(in, path);
}
} // namespace bole
