// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The lines of an ASL folder, for those that write one. AslSource reads them.

#include <bole/frame.h>
#include <bole/open_source.h>

#include <string>

namespace bole::asl
{
constexpr const char *kImagesHead = "#timestamp [ns],filename\n";
constexpr const char *kImuHead = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
                                 "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n";
constexpr const char *kPosesHead = "#timestamp [ns],p_RS_R_x [m],p_RS_R_y [m],p_RS_R_z [m],q_RS_w [],q_RS_x [],"
                                   "q_RS_y [],q_RS_z []\n";

/// cam0/sensor.yaml; \p comment in one line.
std::string sensorYaml(const MountedCamera &camera, const std::string &comment, double rate_hz);
std::string imuLine(std::int64_t stamp_ns, const Eigen::Vector3d &rate, const Eigen::Vector3d &force);
std::string poseLine(std::int64_t stamp_ns, const Pose &pose);
} // namespace bole::asl
