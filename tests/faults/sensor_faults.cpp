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
      odometry("odometry_stands", "the pose filter stands from then on",
               [](Table &table, std::size_t i) {
                 const std::string stamp = table.rows[i][0];
                 table.rows[i] = table.rows[i - 1];
                 table.rows[i][0] = stamp;
               }),
      odometry("odometry_jumps_5m", "the pose filter jumps 5 m sideways",
               [](Table &table, std::size_t i) { table.set(i, 2, table.number(i, 2) + 5); }),
      odometry("odometry_long", "lengths of the pose filter 30 % too long",
               [](Table &table, std::size_t i) { table.set(i, 1, 1.3 * table.number(i, 1)); }),
      {"sensors", "odometry_ends", "no pose filter from then on", Duty::survive,
       [](SpoiltFlight &flight) { flight.odometry.rows.resize(kAt); }},
      gyro("gyro_zero", "the gyro says 0 from then on",
           [](Table &table, std::size_t i) {
             for (const std::size_t axis : {1, 2, 3})
               table.rows[i][axis] = "0";
           }),
      gyro("gyro_bias", "the gyro off by 0.05 rad/s about z",
           [](Table &table, std::size_t i) { table.set(i, 3, table.number(i, 3) + 0.05); }),
      {"sensors", "gyro_spike", "the gyro off by 30 rad/s about x for a second", Duty::survive,
       [](SpoiltFlight &flight) {
         const std::int64_t begin = beginOf(flight), end = begin + 1'000'000'000;
         for (std::size_t i = 0; i < flight.imu.rows.size(); ++i)
           if (flight.imu.stamp(i) >= begin && flight.imu.stamp(i) < end)
             flight.imu.set(i, 1, flight.imu.number(i, 1) + 30);
       }},
      {"sensors", "gyro_ends", "no gyro from then on", Duty::survive,
       [](SpoiltFlight &flight) {
         auto &rows = flight.imu.rows;
         while (flight.imu.stamp(rows.size() - 1) >= beginOf(flight))
           rows.pop_back();
       }},
      {"sensors", "gyro_holes", "nine of ten samples of the gyro lost", Duty::survive,
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
      poses("odometry_optical", "its axes are x right, y down, z ahead", frame(optical)),
      poses("odometry_down", "its axes are x ahead, y right, z down", frame(Vector3d(1, -1, -1).asDiagonal())),
      poses("odometry_xyzw", "quaternions with w at the end",
            [](Vector3d &, Quaterniond &q) { q = Quaterniond(q.x(), q.y(), q.z(), q.w()); }),
      poses("odometry_level", "yaw alone, no roll and no pitch",
            [](Vector3d &, Quaterniond &q) {
              const Eigen::Matrix3d R = q.toRotationMatrix();
              q = Quaterniond(Eigen::AngleAxisd(std::atan2(R(1, 0), R(0, 0)), Vector3d::UnitZ()));
            }),
      poses("odometry_cm", "poses in centimetres", [](Vector3d &t, Quaterniond &) { t *= 100; }),
      poses("odometry_sea", "heights over the sea", [](Vector3d &t, Quaterniond &) { t.z() += 500; }),
      thinned("odometry_1hz", "a pose a second", &SpoiltFlight::odometry, 10),
      fromTheFirst("odometry_late_2s", "its clock 2 s late",
                   [](SpoiltFlight &flight) {
                     everyStamp(flight.odometry, [](std::int64_t t) { return std::to_string(t + 2'000'000'000); });
                   }),
      samples("imu_axes", "y, z, x for x, y, z",
              [](Vector3d &rate, Vector3d &force) {
                rate = Vector3d(rate.y(), rate.z(), rate.x());
                force = Vector3d(force.y(), force.z(), force.x());
              }),
      samples("gyro_scale", "rates 10 % too large", [](Vector3d &rate, Vector3d &) { rate *= 1.1; }),
      samples("gyro_saturated", "no rate above 0.2 rad/s",
              [](Vector3d &rate, Vector3d &) { rate = rate.cwiseMin(0.2).cwiseMax(-0.2); }),
      samples("force_down", "an accelerometer that says -9.81 at rest",
              [](Vector3d &, Vector3d &force) { force = -force; }),
      thinned("imu_20hz", "20 samples a second", &SpoiltFlight::imu, 10),
      fromTheFirst("imu_drift", "its clock 1 % slow",
                   [](SpoiltFlight &flight) {
                     everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(t / 100 * 101); });
                   }),
  };
}

std::vector<Fault> units()
{
  return {
      refused("odometry_1e9", "a pose 1e9 m away", "data.csv:52: position",
              [](SpoiltFlight &flight) { flight.odometry.rows[kAt][1] = "1e9"; }),
      refused("odometry_nan", "a pose that is no number", "data.csv:52: x = \"nan\"",
              [](SpoiltFlight &flight) { flight.odometry.rows[kAt][1] = "nan"; }),
      refused("odometry_mm", "poses in millimetres", "must be at most 300 m/s",
              [](SpoiltFlight &flight) {
                multiply(flight.odometry, {1, 2, 3}, 1000);
              }),
      refused("odometry_ms", "its stamps in milliseconds", "data.csv",
              [](SpoiltFlight &flight) {
                everyStamp(flight.odometry, [](std::int64_t t) { return std::to_string(t / 1'000'000); });
              }),
      refused("odometry_semicolons", "columns separated by semicolons", "semicolons",
              [](SpoiltFlight &flight) { flight.replace(kOdometry, replaced(flight.text(kOdometry), ',', ";")); }),
      refused("gyro_degrees", "a gyro in degrees a second", "looks like degrees per second",
              [](SpoiltFlight &flight) {
                multiply(flight.imu, {1, 2, 3}, 180 / M_PI);
              }),
      refused("force_in_g", "an accelerometer in g", "looks like g",
              [](SpoiltFlight &flight) {
                multiply(flight.imu, {4, 5, 6}, 1 / 9.80665);
              }),
      refused("imu_ms", "stamps of the gyro in milliseconds", "imu0/data.csv",
              [](SpoiltFlight &flight) {
                everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(t / 1'000'000); });
              }),
      refused("imu_seconds", "stamps of the gyro in seconds", "timestamp",
              [](SpoiltFlight &flight) {
                everyStamp(flight.imu, [](std::int64_t t) { return std::to_string(1e-9 * static_cast<double>(t)); });
              }),
      refused("imu_empty", "a table without a line", "no sample in it",
              [](SpoiltFlight &flight) { flight.imu.rows.clear(); }),
      refused("imu_commas", "decimals written with commas", "written with a comma",
              [](SpoiltFlight &flight) { flight.replace(kImu, replaced(flight.text(kImu), '.', ",")); }),
      refused("imu_back", "a stamp that goes back", "must be later than",
              [](SpoiltFlight &flight) { std::swap(flight.imu.rows[100], flight.imu.rows[101]); }),
      refused(
          "imu_utf16", "a table in UTF-16", "UTF-16",
          [](SpoiltFlight &flight) { flight.replace(kImu, "\xFF\xFE" + replaced(flight.text(kImu), '\n', "\n\1")); }),
  };
}

std::vector<Fault> dialects()
{
  return {
      dialect("byte_order_mark", "tables that begin with the mark of UTF-8",
              [](SpoiltFlight &flight) {
                for (const char *file : {kOdometry, kImu})
                  flight.replace(file, "\xEF\xBB\xBF" + flight.text(file));
              }),
      dialect("header_plain", "headers without #",
              [](SpoiltFlight &flight) {
                for (Table *table : {&flight.camera, &flight.odometry, &flight.imu})
                  table->header.erase(0, table->header.find_first_not_of("# "));
              }),
      dialect("windows_lines", "lines that end as on Windows",
              [](SpoiltFlight &flight) {
                for (const char *file : {kOdometry, kImu, "mav0/cam0/data.csv"})
                  flight.replace(file, replaced(flight.text(file), '\n', "\r\n"));
              }),
  };
}
} // namespace

std::vector<Fault> sensorFaults() { return joined({lies(), conventions(), units(), dialects()}); }
} // namespace bole::faults
