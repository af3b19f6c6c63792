// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Where a drone in a plane is going to be by what it has been sent.

#include "tasks/drone_response.h"
#include <bole/pose.h>

namespace bole
{
/// Idea: a drone that is slow to obey coasts. The place where it would come to rest by itself moves at once by what is
/// sent, so a way planned from there needs to know nothing more of the lag. By how much the drone obeys (drag against
/// its velocity loop) shows over seconds in what it flew.
///
/// Law (a test): sent u / obeyed() along a straight line, a drone that obeys by a share flies at u.
class PlaneResponse
{
public:
  explicit PlaneResponse(const ResponseOptions &options = {}) : m_response(options) {}

  /// The frame of \p time_s [s] puts the drone at \p place [m].
  void see(const Eigen::Vector2d &place, double time_s);
  /// \p velocity [m/s] in the axes of the places, sent for the frame seen last.
  void send(const Eigen::Vector2d &velocity);
  Eigen::Vector2d rest() const { return m_rest; } ///< where it would come to rest
  double obeyed() const;                          ///< share of what is sent that is flown

private:
  DroneResponse m_response;
  Eigen::Vector2d m_place = Eigen::Vector2d::Zero(), m_rest = Eigen::Vector2d::Zero();
  double m_time_s = 0, m_flown = 0, m_sent = 0; ///< last seconds: [m^2], [m^2]
  bool m_has_place = false;
};
} // namespace bole
