// SPDX-License-Identifier: GPL-2.0-or-later
#include "exchange/exchange.h"
#include "geometry/constants.h"
#include "geometry/failure.h"
#include "geometry/parse_number.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <sstream>

namespace bole
{
namespace
{
/// To one part of \p parts and no farther: what lies behind is noise.
double rounded(double value, double parts) { return std::round(value * parts) / parts; }
} // namespace

GeoOrigin parseOrigin(const std::string &text)
{
  std::vector<double> numbers;
  std::istringstream stream(text);
  for (std::string word; std::getline(stream >> std::ws, word, ',');)
    if (const auto number = parseNumber<double>(word))
      numbers.push_back(*number);
  if (std::count(text.begin(), text.end(), ',') != 2 || numbers.size() != 3 || std::abs(numbers[0]) > 89 ||
      std::abs(numbers[1]) > 180 || std::abs(numbers[2]) > 360)
    throw badValue("--origin {}: must be LATITUDE,LONGITUDE,HEADING in degrees, within 89, 180 and 360", text);
  return {numbers[0], numbers[1], numbers[2]};
}

Eigen::Vector2d toEarth(const GeoOrigin &origin, const Eigen::Vector2d &xy)
{
  constexpr double kMajor = 6378137, kFlattening = 1 / 298.257223563; // WGS 84
  constexpr double kE2 = kFlattening * (2 - kFlattening);
  const double sin_latitude = std::sin(origin.latitude * kDegree), w2 = 1 - kE2 * sin_latitude * sin_latitude;
  const double normal = kMajor / std::sqrt(w2), meridian = normal * (1 - kE2) / w2;
  const double s = std::sin(origin.heading * kDegree), c = std::cos(origin.heading * kDegree);
  const double east = xy.x() * s - xy.y() * c, north = xy.x() * c + xy.y() * s;
  return {origin.longitude + east / (normal * std::cos(origin.latitude * kDegree)) / kDegree,
          origin.latitude + north / meridian / kDegree};
}

std::string toGeoJson(const MapOfRun &map, const std::optional<GeoOrigin> &origin)
{
  using Json = nlohmann::ordered_json;
  const auto place = [&origin](const Eigen::Vector2d &xy) -> Json {
    if (!origin)
      return {rounded(xy.x(), 1e4), rounded(xy.y(), 1e4)};
    const Eigen::Vector2d degrees = toEarth(*origin, xy);
    return {rounded(degrees.x(), 1e9), rounded(degrees.y(), 1e9)};
  };
  Json json = {{"type", "FeatureCollection"},
               {"name", map.name},
               {"description", describe(map.reference)},
               {"units", origin ? "degrees, WGS 84" : "metres of the run's world, no place on the earth"},
               {"features", Json::array()}};
  for (const TrunkRecord &trunk : map.trunks)
    json["features"].push_back({{"type", "Feature"},
                                {"id", trunk.id},
                                {"geometry", {{"type", "Point"}, {"coordinates", place(trunk.xy)}}},
                                {"properties",
                                 {{"tree", trunk.id},
                                  {"dbh_cm", rounded(200 * trunk.radius, 1e2)},
                                  {"dbh_sigma_cm", rounded(200 * trunk.radiusSigma(), 1e2)},
                                  {"position_sigma_m", rounded(trunk.positionSigma(), 1e4)},
                                  {"probability", rounded(trunk.probability, 1e4)},
                                  {"views", trunk.observations}}}});
  Json line = Json::array();
  for (const StampedPose &pose : map.trajectory)
    line.push_back(place(pose.wMb.t.head<2>()));
  if (line.size() > 1)
    json["features"].push_back({{"type", "Feature"},
                                {"geometry", {{"type", "LineString"}, {"coordinates", line}}},
                                {"properties", {{"name", "trajectory"}}}});
  return json.dump(1) + "\n";
}
} // namespace bole
