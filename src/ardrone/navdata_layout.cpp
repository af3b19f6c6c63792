// SPDX-License-Identifier: GPL-2.0-or-later
// What the manufacturer's SDK 2.0 puts into each option (facts of navdata_common.h, sizes verified
// against a packet of a real drone): name and type of each field, in order. "f4 theta" is one
// float, "u2 motor 4" four 16-bit numbers.
#include "ardrone/navdata.h"

#include "ardrone/bytes.h"

#include <sstream>

namespace bole
{
namespace
{
struct Layout
{
  std::uint16_t id;
  const char *name;
  const char *fields;
};

const std::vector<Layout> &layouts()
{
  static const std::vector<Layout> all = {
      {0, "demo",
       "u4 control_state, u4 battery_percent, f4 theta_mdeg, f4 phi_mdeg, f4 psi_mdeg, i4 "
       "altitude_mm, f4 velocity_mm_s 3, "
       "u4 frames, f4 detection_rotation 9, f4 detection_translation 3, u4 detection_tag, u4 "
       "detection_camera, "
       "f4 camera_rotation 9, f4 camera_translation 3"},
      {1, "time", "u4 time"},
      {2, "raw_measures",
       "u2 acceleration 3, i2 gyro 3, i2 gyro_110 2, u4 battery_mv, u2 echo_start, u2 echo_end, u2 "
       "echo_association, "
       "u2 echo_distance, u2 curve_time, u2 curve_value, u2 curve_reference, u2 echo_flag, u2 "
       "echo_count, u4 echo_sum, "
       "i4 altitude_raw, i2 gradient"},
      {3, "phys_measures",
       "f4 acceleration_temperature, u2 gyro_temperature, f4 acceleration_mg 3, f4 gyro_deg_s 3, "
       "u4 supply_3v3, "
       "u4 reference_1, u4 reference_2"},
      {4, "gyros_offsets", "f4 offset 3"},
      {5, "euler_angles", "f4 theta, f4 phi"},
      {6, "references",
       "i4 theta, i4 phi, i4 theta_integral, i4 phi_integral, i4 pitch, i4 roll, i4 yaw, i4 psi, "
       "f4 vx, f4 vy, f4 theta_mod, "
       "f4 phi_mod, f4 k_vx, f4 k_vy, u4 k_mode, f4 ui_time, f4 ui_theta, f4 ui_phi, f4 ui_psi, f4 "
       "ui_psi_accuracy, "
       "i4 ui_sequence"},
      {7, "trims", "f4 angular_rate, f4 theta, f4 phi"},
      {8, "rc_references", "i4 pitch, i4 roll, i4 yaw, i4 gaz, i4 ag"},
      {9, "pwm",
       "u1 motor 4, u1 motor_saturated 4, f4 gaz_feed_forward, f4 gaz_altitude, f4 "
       "altitude_integral, f4 vz_reference, "
       "i4 pitch, i4 roll, i4 yaw, f4 yaw_integral, i4 pitch_planned, i4 roll_planned, i4 "
       "yaw_planned, f4 gaz_planned, "
       "u2 motor_current 4, f4 altitude_proportional, f4 altitude_derivative"},
      {10, "altitude",
       "i4 vision, f4 vz, i4 reference, i4 raw, f4 observed_acceleration, f4 observed_altitude, f4 "
       "observed_state_x 3, "
       "u4 observed_state, f4 estimated_velocity 2, u4 estimated_state"},
      {11, "vision_raw", "f4 tx, f4 ty, f4 tz"},
      {12, "vision_of", "f4 flow_x 5, f4 flow_y 5"},
      {13, "vision",
       "u4 state, i4 misc, f4 phi_trim, f4 phi_reference, f4 theta_trim, f4 theta_reference, i4 "
       "new_raw_picture, "
       "f4 theta_capture, f4 phi_capture, f4 psi_capture, i4 altitude_capture, u4 time_capture, f4 "
       "velocity 3, "
       "f4 delta_phi, f4 delta_theta, f4 delta_psi, u4 gold_defined, u4 gold_reset, f4 gold_x, f4 "
       "gold_y"},
      {14, "vision_perf",
       "f4 time_corners, f4 time_computation, f4 time_tracking, f4 time_translation, f4 "
       "time_update, f4 time_custom 21"},
      {15, "trackers_send", "i4 locked 30, i4 point 60"},
      {16, "vision_detect",
       "u4 count, u4 type 4, u4 xc 4, u4 yc 4, u4 width 4, u4 height 4, u4 distance 4, f4 "
       "orientation 4, f4 rotation 36, "
       "f4 translation 12, u4 camera 4"},
      {17, "watchdog", "u4 watchdog"},
      {18, "adc_data_frame", "u4 version, u1 data 32"},
      {19, "video_stream",
       "u1 quantiser, u4 frame_size, u4 frame_number, u4 command_sequence, u4 command_mean_gap, f4 "
       "command_gap_variance, "
       "u4 command_quality, u4 bit_rate, u4 desired_bit_rate, i4 data 5, u4 tcp_queue, u4 "
       "fifo_queue"},
      {20, "games", "u4 double_taps, u4 finish_lines"},
      {21, "pressure_raw", "i4 up, i2 ut, i4 temperature, i4 pressure"},
      {22, "magneto",
       "i2 raw 3, f4 raw_mg 3, f4 rectified_mg 3, f4 offset_mg 3, f4 heading_deg, f4 "
       "heading_gyro_deg, f4 heading_fused_deg, "
       "u1 calibrated, u4 state, f4 radius, f4 error_mean, f4 error_variance"},
      {23, "wind_speed", "f4 speed, f4 angle, f4 compensation_theta, f4 compensation_phi, f4 state 6, f4 debug 3"},
      {24, "kalman_pressure",
       "f4 offset_pressure, f4 z, f4 z_rate, f4 bias_pwm, f4 bias_pressure, f4 offset_sonar, f4 "
       "predicted_sonar, "
       "f4 covariance_altitude, f4 covariance_pwm, f4 covariance_velocity, u4 ground_effect, f4 "
       "innovation_sum, "
       "u4 sonar_rejected, f4 multisine, f4 gaz_altitude, u4 multisine_on, u4 multisine_start"},
      {25, "hdvideo_stream",
       "u4 state, u4 fifo_packets, u4 fifo_size, u4 usb_size, u4 usb_free, u4 frame_number, u4 "
       "usb_time_left"},
      {26, "wifi", "u4 link_quality"},
      {27, "gps", "f8 latitude_deg, f8 longitude_deg, f8 elevation_m, f8 hdop, i4 available, u1 rest 176"},
  };
  return all;
}

const Layout *find(std::uint16_t id)
{
  for (const Layout &layout : layouts())
    if (layout.id == id)
      return &layout;
  return nullptr;
}

double readNumber(const std::string &type, const std::uint8_t *p)
{
  if (type == "u1")
    return *p;
  if (type == "u2")
    return readLittleEndian<std::uint16_t>(p);
  if (type == "i2")
    return readLittleEndian<std::int16_t>(p);
  if (type == "u4")
    return readLittleEndian<std::uint32_t>(p);
  if (type == "i4")
    return readLittleEndian<std::int32_t>(p);
  return type == "f4" ? static_cast<double>(readLittleEndian<float>(p)) : readLittleEndian<double>(p);
}

/// Calls \p use(type, name, size, count) for each field of the layout.
template <typename Use> void forEachField(const Layout &layout, const Use &use)
{
  std::istringstream fields(layout.fields);
  for (std::string field; std::getline(fields, field, ',');) {
    std::istringstream words(field);
    std::string type, name;
    int count = 1;
    words >> type >> name >> count;
    use(type, name, static_cast<std::size_t>(type[1] - '0'), words.fail() ? 1 : count);
  }
}
} // namespace

std::string navdataOptionName(std::uint16_t id)
{
  const Layout *layout = find(id);
  return layout != nullptr ? layout->name : "option " + std::to_string(id);
}

std::size_t navdataOptionSize(std::uint16_t id)
{
  std::size_t total = 0;
  if (const Layout *layout = find(id))
    forEachField(*layout, [&](const std::string &, const std::string &, std::size_t size, int count) {
      total += size * static_cast<std::size_t>(count);
    });
  return total;
}

std::vector<NavdataField> navdataFields(std::uint16_t id, const std::vector<std::uint8_t> &bytes)
{
  std::vector<NavdataField> out;
  const Layout *layout = find(id);
  if (layout == nullptr)
    return out;
  std::size_t at = 0;
  forEachField(*layout, [&](const std::string &type, const std::string &name, std::size_t size, int count) {
    for (int i = 0; i < count && at + size <= bytes.size(); ++i, at += size)
      out.push_back({count == 1 ? name : name + "_" + std::to_string(i + 1), readNumber(type, bytes.data() + at)});
  });
  return out;
}
} // namespace bole
