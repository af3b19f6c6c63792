// SPDX-License-Identifier: GPL-2.0-or-later
// What pose filters and gyros say, and how their logs are written.
#include "fault_list.h"

#include <Eigen/Geometry>

#include <cmath>

namespace bole::faults
{
namespace
{
using Table = SpoiltFlight::Table;
const char *const kOdometry = "mav0/odom0/data.csv", *const kImu = "mav0/imu0/data.csv";

/// Time at which faults begin, on the clock of the flight.
std::int64_t beginOf(const SpoiltFlight &flight) { return flight.camera.stamp(kAt); }

/// \p change to the rows of \p table from the beginning of the fault on.
template <typename Rows> void fromThenOn(SpoiltFlight &flight, Table &table, const Rows &change)
{
  for (std::size_t i = 0; i < table.rows.size(); ++i)
    if (table.stamp(i) >= beginOf(flight))
      change(table, i);
}

Fault odometry(const std::string &name, const std::string &what,
               const std::function<void(Table &, std::size_t)> &change)
{
  return {"sensors", name, what, Duty::survive,
          [=](SpoiltFlight &flight) { fromThenOn(flight, flight.odometry, change); }};
}

Fault gyro(const std::string &name, const std::string &what, const std::function<void(Table &, std::size_t)> &change)
{
  return {"sensors", name, what, Duty::survive, [=](SpoiltFlight &flight) { fromThenOn(flight, flight.imu, change); }};
}

Fault refused(const std::string &name, const std::string &what, const std::string &says,
              const std::function<void(SpoiltFlight &)> &spoil)
{
  return {"sensors", name, what, Duty::refuse, spoil, says};
}

Fault dialect(const std::string &name, const std::string &what, const std::function<void(SpoiltFlight &)> &spoil)
{
  return {"sensors", name, what, Duty::read, spoil};
}

void everyStamp(Table &table, const std::function<std::string(std::int64_t)> &write)
{
  for (SpoiltFlight::Row &row : table.rows)
    row[0] = write(std::stoll(row[0]));
}

/// In every row.
void multiply(Table &table, std::initializer_list<std::size_t> columns, double factor)
{
  for (std::size_t i = 0; i < table.rows.size(); ++i)
    for (const std::size_t column : columns)
      table.set(i, column, factor * table.number(i, column));
}

std::string replaced(std::string text, char from, const std::string &to)
{
  std::string out;
  for (const char c : text)
    out += c == from ? to : std::string(1, c);
  return out;
}

std::vector<Fault> lies()
{
  return {
      odometry("odometry_stands", "",
               [](Table &table, std::size_t i) {
                 const std::string stamp = table.rows[i][0];
                 table.rows[i] = table.rows[i - 1];
                 table.rows[i][0] = stamp;
               }),
      odometry("odometry_jumps_5m", "sideways",
               [](Table &table, std::size_t i) { table.set(i, 2, table.number(i, 2) + 5); }),
      odometry("odometry_long", "by 30 %",
               [](Table &table, std::size_t i) { table.set(i, 1, 1.3 * table.number(i, 1)); }),
      {"sensors", "odometry_ends", "", Duty::survive, [](SpoiltFlight &flight) { flight.odometry.rows.resize(kAt); }},
      gyro("gyro_zero", "",
           [](Table &table, std::size_t i) {
             for (const std::size_t axis : {1, 2, 3})
               table.rows[i][axis] = "0";
           }),
      gyro("gyro_bias", "of 0.05 rad/s",
           [](Table &table, std::size_t i) { table.set(i, 3, table.number(i, 3) + 0.05); }),
      {"sensors", "gyro_spike", "of 30 rad/s for a second", Duty::survive,
       [](SpoiltFlight &flight) {
         const std::int64_t begin = beginOf(flight), end = begin + 1'000'000'000;
         for (std::size_t i = 0; i < flight.imu.rows.size(); ++i)
           if (flight.imu.stamp(i) >= begin && flight.imu.stamp(i) < end)
             flight.imu.set(i, 1, flight.imu.number(i, 1) + 30);
       }},
      {"sensors", "gyro_ends", "", Duty::survive,
       [](SpoiltFlight &flight) {
         auto &rows = flight.imu.rows;
         while (flight.imu.stamp(rows.size() - 1) >= beginOf(flight))
           rows.pop_back();
       }},
      {"sensors", "gyro_holes", "of nine samples in ten", Duty::survive,
       [](SpoiltFlight &flight) {
         std::vector<SpoiltFlight::Row> left;
         for (SpoiltFlight::Row &row : flight.imu.rows)
           if (flight.random() % 10 == 0)
             left.push_back(std::move(row));
         flight.imu.rows = std::move(left);
       }},
  };
}

Fault fromTheFirst(const std::string &name, const std::string &what, const std::function<void(SpoiltFlight &)> &spoil)
{
  return faults::fromTheFirst({"sensors", name, what, Duty::survive, spoil});
}

/// Poses that stand otherwise from the first to the last.
Fault poses(const std::string &name, const std::string &what,
            const std::function<void(Eigen::Vector3d &, Eigen::Quaterniond &)> &change)
{
  return fromTheFirst(name, what, [=](SpoiltFlight &flight) {
    Table &table = flight.odometry;
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
      Eigen::Vector3d t(table.number(i, 1), table.number(i, 2), table.number(i, 3));
      Eigen::Quaterniond q(table.number(i, 4), table.number(i, 5), table.number(i, 6), table.number(i, 7));
      change(t, q);
      const double values[] = {t.x(), t.y(), t.z(), q.w(), q.x(), q.y(), q.z()};
      for (std::size_t k = 0; k < 7; ++k)
        table.set(i, k + 1, values[k]);
    }
  });
}

/// Rates and forces, likewise.
Fault samples(const std::string &name, const std::string &what,
              const std::function<void(Eigen::Vector3d &, Eigen::Vector3d &)> &change)
{
  return fromTheFirst(name, what, [=](SpoiltFlight &flight) {
    Table &table = flight.imu;
    for (std::size_t i = 0; i < table.rows.size(); ++i) {
      Eigen::Vector3d rate(table.number(i, 1), table.number(i, 2), table.number(i, 3)),
          force(table.number(i, 4), table.number(i, 5), table.number(i, 6));
      change(rate, force);
      for (int k = 0; k < 3; ++k) {
        table.set(i, static_cast<std::size_t>(k) + 1, rate[k]);
        table.set(i, static_cast<std::size_t>(k) + 4, force[k]);
      }
    }
  });
}

/// Every \p nth line of a table.
Fault thinned(const std::string &name, const std::string &what, Table SpoiltFlight::*table, std::size_t nth)
{
  return fromTheFirst(name, what, [=](SpoiltFlight &flight) {
    std::vector<SpoiltFlight::Row> rows;
    for (std::size_t i = 0; i < (flight.*table).rows.size(); i += nth)
      rows.push_back((flight.*table).rows[i]);
    (flight.*table).rows = std::move(rows);
  });
}

/// What was wrong before the flight began.
std::vector<Fault> conventions()
{
  using Eigen::Quaterniond;
  using Eigen::Vector3d;
  const auto frame = [](const Eigen::Matrix3d &R) {
    return [=](Vector3d &t, Quaterniond &q) {
      t = (R * t).eval();
      q = Quaterniond(Eigen::Matrix3d(R * q.toRotationMatrix() * R.transpose()));
    };
  };
  Eigen::Matrix3d optical;
  optical << 0, -1, 0, 0, 0, -1, 1, 0, 0;
  return {
      poses("odometry_optical", "axes: x right, y down, z ahead", frame(optical)),
      poses("odometry_down", "axes: x ahead, y right, z down", frame(Vector3d(1, -1, -1).asDiagonal())),
      poses("odometry_xyzw", "quaternions",
            [](Vector3d &, Quaterniond &q) { q = Quaterniond(q.x(), q.y(), q.z(), q.w()); }),
      poses("odometry_level", "by yaw alone",
            [](Vector3d &, Quaterniond &q) {
              const Eigen::Matrix3d R = q.toRotationMatrix();
              q = Quaterniond(Eigen::AngleAxisd(std::atan2(R(1, 0), R(0, 0)), Vector3d::UnitZ()));
            }),
      poses("odometry_cm", "", [](Vector3d &t, Quaterniond &) { t *= 100; }),
      poses("odometry_sea", "heights", [](Vector3d &t, Quaterniond &) { t.z() += 500; }),
      thinned("odometry_1hz", "", &SpoiltFlight::odometry, 10),
      fromTheFirst("odometry_late_2s", "",
                   [](SpoiltFlight &flight) {
                     everyStamp(flight.odometry, [](std::int64_t t) { return std::to_string(t + 2'000'000'000); });
                   }),
      samples("imu_axes", "y, z, x",
              [](Vector3d &rate, Vector3d &force) {
                rate = Vector3d(rate.y(), rate.z(), rate.x());
                force = Vector3d(force.y(), force.z(), force.x());
              }),
      samples("gyro_scale", "10 % too large", [](Vector3d &rate, Vector3d &) { rate *= 1.1; }),
      samples("gyro_saturated", "at 0.2 rad/s",
              [](Vector3d &rate, Vector3d &) { rate = rate.cwiseMin(0.2).cwiseMax(-0.2); }),
      samples("force_down", "at rest", [](Vector3d &, Vector3d &force) { force = -force; }),
      thinned("imu_20hz", "", &SpoiltFlight::imu, 10),
      fromTheFirst("imu_drift", "by 1 %",
                   [](SpoiltFlight &flight) {
                     everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(t / 100 * 101); });
                   }),
  };
}

std::vector<Fault> units()
{
  return {
      refused("odometry_1e9", "", "data.csv:52: position = 1e+09 m from the origin",
              [](SpoiltFlight &flight) { flight.odometry.rows[kAt][1] = "1e9"; }),
      refused("odometry_nan", "", "data.csv:52: x = \"nan\", must be a finite number",
              [](SpoiltFlight &flight) { flight.odometry.rows[kAt][1] = "nan"; }),
      refused("odometry_mm", "", "speed = 118 m in 0.1 s, must be at most 300 m/s",
              [](SpoiltFlight &flight) {
                multiply(flight.odometry, {1, 2, 3}, 1000);
              }),
      refused("odometry_ms", "in stamps", "stamps must be in nanoseconds",
              [](SpoiltFlight &flight) {
                everyStamp(flight.odometry, [](std::int64_t t) { return std::to_string(t / 1'000'000); });
              }),
      refused("odometry_semicolons", "", "separated by semicolons, must be by commas",
              [](SpoiltFlight &flight) { flight.replace(kOdometry, replaced(flight.text(kOdometry), ',', ";")); }),
      refused("gyro_degrees", "", "looks like degrees per second",
              [](SpoiltFlight &flight) {
                multiply(flight.imu, {1, 2, 3}, 180 / M_PI);
              }),
      refused("force_in_g", "", "looks like g",
              [](SpoiltFlight &flight) {
                multiply(flight.imu, {4, 5, 6}, 1 / 9.80665);
              }),
      refused("imu_ms", "in stamps", "stamps must be in nanoseconds",
              [](SpoiltFlight &flight) {
                everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(t / 1'000'000); });
              }),
      refused("imu_seconds", "in stamps", "timestamp = \"0.000000\", must be a whole number",
              [](SpoiltFlight &flight) {
                everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(1e-9 * static_cast<double>(t)); });
              }),
      refused("imu_empty", "", "no sample in it", [](SpoiltFlight &flight) { flight.imu.rows.clear(); }),
      refused("imu_commas", "", "written with a comma, must have a point",
              [](SpoiltFlight &flight) { flight.replace(kImu, replaced(flight.text(kImu), '.', ",")); }),
      refused("imu_back", "in time", "data.csv:103: timestamp = 500000000 ns, must be later",
              [](SpoiltFlight &flight) { std::swap(flight.imu.rows[100], flight.imu.rows[101]); }),
      refused(
          "imu_utf16", "", "is text in UTF-16, must be in UTF-8",
          [](SpoiltFlight &flight) { flight.replace(kImu, "\xFF\xFE" + replaced(flight.text(kImu), '\n', "\n\1")); }),
  };
}

std::vector<Fault> dialects()
{
  return {
      dialect("byte_order_mark", "",
              [](SpoiltFlight &flight) {
                for (const char *file : {kOdometry, kImu})
                  flight.replace(file, "\xEF\xBB\xBF" + flight.text(file));
              }),
      dialect("header_plain", "without #",
              [](SpoiltFlight &flight) {
                for (Table *table : {&flight.camera, &flight.odometry, &flight.imu})
                  table->header.erase(0, table->header.find_first_not_of("# "));
              }),
      dialect("windows_lines", "",
              [](SpoiltFlight &flight) {
                for (const char *file : {kOdometry, kImu, "mav0/cam0/data.csv"})
                  flight.replace(file, replaced(flight.text(file), '\n', "\r\n"));
              }),
  };
}
} // namespace

std::vector<Fault> sensorFaults() { return joined({lies(), conventions(), units(), dialects()}); }
} // namespace bole::faults
