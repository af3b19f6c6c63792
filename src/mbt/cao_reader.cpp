// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/cao_reader.h"
#include "input/atomic_file.h"
#include "input/regular_file.h"

#include <cmath>
#include <fmt/format.h>
#include <iterator>
#include <sstream>
#include <visp3/core/vpException.h>

namespace bole
{
namespace
{
/// The lines that say something, without comments and line endings.
class CaoLines
{
public:
  explicit CaoLines(const std::string &path) : m_lines(path) {}

  /// Next line as words; \p what is missing if there is none.
  std::istringstream next(const char *what)
  {
    while (m_lines.next()) {
      std::string line = m_lines.line();
      line.erase(std::min(line.find('#'), line.size()));
      const std::size_t last = line.find_last_not_of(" \t\r");
      if (last == std::string::npos)
        continue;
      line.erase(last + 1);
      return std::istringstream(line);
    }
    fail(fmt::format("the file ends, must go on with {}", what));
  }

  bool atEnd()
  {
    while (m_lines.next()) {
      const std::string &line = m_lines.line();
      if (line.find_first_not_of(" \t\r") < line.find('#'))
        return false;
    }
    return true;
  }

  [[noreturn]] void fail(const std::string &message) const
  {
    throw vpException(vpException::badValue, fmt::format("{}:{}: {}", m_lines.name(), m_lines.number(), message));
  }

  template <class T> T word(std::istringstream &line, const char *what) const
  {
    T value;
    if (!(line >> value))
      fail(fmt::format("'{}', must be {}", line.str(), what));
    return value;
  }

  void endOf(std::istringstream &line) const
  {
    std::string rest;
    if (line >> rest)
      fail(fmt::format("'{}' at the end of the line, must not be there", rest));
  }

  int count(const char *what)
  {
    std::istringstream line = next(what);
    const int n = word<int>(line, what);
    endOf(line);
    if (n < 0 || n > 100000)
      fail(fmt::format("{} = {}, must be 0 .. 100000", what, n));
    return n;
  }

  /// A part of the model that a trunk does not have: zero, or refused at the line of its count.
  void none(const char *what)
  {
    const int n = count(what);
    if (n > 0)
      fail(fmt::format("{} = {}, must be 0: a model of trunks holds cylinders only", what, n));
  }

private:
  TextLines m_lines;
};

std::string nameOf(const CaoLines &file, std::istringstream &line)
{
  std::string rest;
  std::getline(line >> std::ws, rest);
  if (rest.empty())
    return "";
  const std::string key = "name=\"";
  if (rest.compare(0, key.size(), key) != 0 || rest.size() < key.size() + 1 || rest.back() != '"')
    file.fail(fmt::format("'{}' after the radius, must be name=\"...\"", rest));
  return rest.substr(key.size(), rest.size() - key.size() - 1);
}

Cylinder readCylinder(CaoLines &file, const std::vector<Eigen::Vector3d> &points)
{
  std::istringstream line = file.next("a cylinder");
  const int i = file.word<int>(line, "two points and a radius"), j = file.word<int>(line, "two points and a radius");
  Cylinder cylinder;
  cylinder.radius = file.word<double>(line, "two points and a radius");
  for (int index : {i, j})
    if (index < 0 || index >= int(points.size()))
      file.fail(fmt::format("point = {}, must be 0 .. {}", index, int(points.size()) - 1));
  if (!(cylinder.radius > 0) || !std::isfinite(cylinder.radius))
    file.fail(fmt::format("radius = {}, must be above 0", cylinder.radius));
  cylinder.foot = points[std::size_t(i)];
  cylinder.top = points[std::size_t(j)];
  if (!((cylinder.top - cylinder.foot).norm() > 1e-6))
    file.fail("the two points of the axis must differ");
  cylinder.name = nameOf(file, line);
  return cylinder;
}
} // namespace

std::vector<Cylinder> readCao(const std::string &path)
{
  CaoLines file(path);
  std::istringstream header = file.next("V1");
  const std::string version = file.word<std::string>(header, "V1");
  if (version != "V1")
    file.fail(fmt::format("version = {}, must be V1", version));
  file.endOf(header);

  std::istringstream line = file.next("the number of points");
  if (line.str().find("load") != std::string::npos)
    file.fail(fmt::format("'{}': models inside models are not read", line.str()));
  const int n_points = file.word<int>(line, "the number of points");
  file.endOf(line);
  if (n_points < 0 || n_points > 100000)
    file.fail(fmt::format("points = {}, must be 0 .. 100000", n_points));
  std::vector<Eigen::Vector3d> points;
  for (int k = 0; k < n_points; ++k) {
    std::istringstream row = file.next("a point");
    Eigen::Vector3d p;
    for (int c = 0; c < 3; ++c)
      p(c) = file.word<double>(row, "three numbers");
    file.endOf(row);
    points.push_back(p);
  }
  file.none("lines");
  file.none("faces from lines");
  file.none("faces from points");
  std::vector<Cylinder> cylinders;
  const int n_cylinders = file.count("cylinders");
  for (int k = 0; k < n_cylinders; ++k)
    cylinders.push_back(readCylinder(file, points));
  file.none("circles");
  if (!file.atEnd())
    file.fail("more after the circles, must be the end of the file");
  return cylinders;
}

void writeCao(const std::string &path, const std::vector<Cylinder> &cylinders, const std::string &comment)
{
  std::string text = "V1\n";
  const auto out = std::back_inserter(text);
  if (!comment.empty())
    fmt::format_to(out, "# {}\n", comment);
  fmt::format_to(out, "{} # points\n", 2 * cylinders.size());
  for (const Cylinder &c : cylinders)
    for (const Eigen::Vector3d &p : {c.foot, c.top})
      fmt::format_to(out, "{:.6f} {:.6f} {:.6f}\n", p.x(), p.y(), p.z());
  fmt::format_to(out, "0 # lines\n0 # faces from lines\n0 # faces from points\n{} # cylinders\n", cylinders.size());
  for (std::size_t k = 0; k < cylinders.size(); ++k)
    fmt::format_to(out, "{} {} {:.6f}{}\n", 2 * k, 2 * k + 1, cylinders[k].radius,
                   cylinders[k].name.empty() ? "" : fmt::format(" name=\"{}\"", cylinders[k].name));
  text += "0 # circles\n";
  writeAtomically(path, text);
}
} // namespace bole
