// SPDX-License-Identifier: GPL-2.0-or-later
#include "tracking/borders.h"

#include "geometry/require_range.h"
#include "mbt/vpMbtDistanceTrunk.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <fmt/format.h>
#include <visp3/core/vpException.h>

using bole::Border;
using bole::kBorders;
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr double kProfileRate =
    0.5; ///< how fast the remembered profile follows: the background moves on behind the border

Vector3d toEigen(const vpPoint &p) { return {p.get_oX(), p.get_oY(), p.get_oZ()}; }
} // namespace

void vpMbtDistanceTrunk::Options::validate() const
{
  bole::requireRange("pieces", pieces, 1, 16);
  bole::requireRange("samples", samples, 8, 400);
  bole::requireRange("near_m", near_m, 0.001, 10);
  bole::requireRange("margin_px", margin_px, 0, 50);
  bole::requireRange("min_length_px", min_length_px, 4, 1000);
  bole::requireRange("min_width_px", min_width_px, 1, 100);
  bole::requireRange("min_contrast", min_contrast, 0, 50);
}

vpMbtDistanceTrunk::vpMbtDistanceTrunk() = default;

vpMbtDistanceTrunk::vpMbtDistanceTrunk(const Options &options) : m_options(options) { m_options.validate(); }

void vpMbtDistanceTrunk::buildFrom(const vpPoint &p1, const vpPoint &p2, double r)
{
  if (!(r > 0))
    throw vpException(vpException::badValue, fmt::format("radius = {}, must be above 0", r));
  m_object.foot = toEigen(p1);
  m_object.top = toEigen(p2);
  m_object.radius = r;
  if (!((m_object.top - m_object.foot).norm() > 1e-6))
    throw vpException(vpException::badValue, "the two points of the axis of a trunk must differ");
}

void vpMbtDistanceTrunk::predict(const vpHomogeneousMatrix &cMo, unsigned int width, unsigned int height)
{
  m_pinhole = bole::PinholeCamera::fromVisp(m_cam, int(width), int(height));
  m_camera = bole::Pose::fromVisp(cMo) * m_object;
  m_relative = bole::relativeTrunk(m_camera);
  const bool outside = m_relative.isFinite() && m_relative.ratio() < 0.95;
  for (Border side : kBorders) {
    BorderState &state = border(side);
    state.visible = false;
    state.chosen = -1;
    state.hidden.clear();
    state.peaks.clear();
    for (Piece &piece : state.pieces)
      piece.used = false;
    if (!outside)
      continue;
    const auto line = bole::visibleBorder(m_pinhole, m_camera, m_relative, side, m_options.near_m, m_options.margin_px);
    if (!line || line->length() < m_options.min_length_px)
      continue;
    state.line = *line;
    state.visible = true;
  }
  // a thin trunk: both borders within one blur
  const double width_px = 2 * m_relative.ratio() * 0.5 * (m_pinhole.fx + m_pinhole.fy);
  if (width_px < m_options.min_width_px)
    m_border[0].visible = m_border[1].visible = false;
}

void vpMbtDistanceTrunk::hideBehind(const vpMbtDistanceTrunk &nearer)
{
  const bole::RelativeTrunk &r = nearer.m_relative;
  const double own_d = m_camera.radius / m_relative.ratio(), its_d = nearer.m_camera.radius / r.ratio();
  if (!r.isFinite() || !m_relative.isFinite() || !(its_d < own_d))
    return;
  // directions inside both silhouette planes and between the ends, widened by a pixel
  const double margin = 1.0 / m_pinhole.fx;
  const Vector3d nl = r.borderNormal(Border::left), nr = r.borderNormal(Border::right);
  const Vector3d ahead = r.cRt.col(0), axis = r.cRt.col(2);
  const double low = axis.dot(nearer.m_camera.foot), high = axis.dot(nearer.m_camera.top);
  for (BorderState &state : m_border) {
    if (!state.visible)
      continue;
    for (int k = 0; k < m_options.samples; ++k) {
      const Vector3d m = m_pinhole.ray(state.line.at((k + 0.5) / m_options.samples));
      const double along = ahead.dot(m);
      if (along <= 0 || nl.dot(m) > margin || nr.dot(m) > margin)
        continue;
      const double height = axis.dot(m) / along * its_d;
      if (height < low || height > high)
        continue;
      if (state.hidden.empty())
        state.hidden.assign(std::size_t(m_options.samples), false);
      state.hidden[std::size_t(k)] = true;
    }
    if (!state.hidden.empty()) {
      const auto seen = std::count(state.hidden.begin(), state.hidden.end(), false);
      if (state.line.length() * double(seen) / m_options.samples < m_options.min_length_px)
        state.visible = false;
    }
  }
}

void vpMbtDistanceTrunk::scan(const vpImage<unsigned char> &I, int half_px)
{
  for (BorderState &state : m_border) {
    state.chosen = -1;
    state.peaks.clear();
    if (!state.visible)
      continue;
    state.profile =
        bole::sampleBorder(I, state.line, half_px + kProfileReach, m_options.samples, m_options.pieces, state.hidden);
    state.whole = state.profile.whole();
    state.contrast = state.profile.contrast(-1);
    state.peaks = bole::contrastPeaks(state.contrast);
    const auto weak = [&](const bole::ContrastPeak &p) {
      return std::abs(p.contrast) < m_options.min_contrast || std::abs(p.offset_px) > half_px + 0.5;
    };
    state.peaks.erase(std::remove_if(state.peaks.begin(), state.peaks.end(), weak), state.peaks.end());
  }
}

void vpMbtDistanceTrunk::choose(Border side, int chosen, double reach_px)
{
  BorderState &state = border(side);
  state.chosen = chosen;
  state.pieces.assign(std::size_t(m_options.pieces), Piece());
  if (chosen < 0)
    return;
  const bole::ContrastPeak peak = state.peaks[std::size_t(chosen)];
  for (int p = 0; p < m_options.pieces; ++p) {
    Piece &piece = state.pieces[std::size_t(p)];
    piece.share = double(state.profile.visible[std::size_t(p)]);
    if (piece.share < 0.5)
      continue;
    double best = 0, offset = 0;
    for (const bole::ContrastPeak &own : bole::contrastPeaks(state.profile.contrast(p))) {
      const double away = (own.offset_px - peak.offset_px) / reach_px;
      if (own.contrast * peak.contrast <= 0 || std::abs(away) > 1)
        continue;
      const double score = std::abs(own.contrast) * (1 - 0.5 * away * away);
      if (score > best)
        best = score, offset = own.offset_px, piece.contrast = own.contrast;
    }
    if (best < m_options.min_contrast)
      continue;
    piece.used = true;
    piece.found_px = state.line.at(state.profile.centre[std::size_t(p)]) + offset * state.line.normal;
  }
}

void vpMbtDistanceTrunk::search(const vpImage<unsigned char> &I, int half_px)
{
  scan(I, half_px);
  for (Border side : kBorders) {
    const BorderState &state = border(side);
    int best = -1;
    for (int k = 0; k < int(state.peaks.size()); ++k)
      if (best < 0 ||
          std::abs(state.peaks[std::size_t(k)].contrast) > std::abs(state.peaks[std::size_t(best)].contrast))
        best = k;
    choose(side, best, 3);
  }
}

double vpMbtDistanceTrunk::BorderState::likeness(int offset_px) const
{
  const int middle = int(whole.size()) / 2 + offset_px;
  if (remembered_profile.empty() || middle < kProfileReach || middle + kProfileReach >= int(whole.size()))
    return 0;
  const float *now = whole.data() + middle - kProfileReach;
  const float n = 2 * kProfileReach + 1;
  float a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  for (int k = 0; k < 2 * kProfileReach + 1; ++k) {
    const float x = now[k], y = remembered_profile[std::size_t(k)];
    a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
  }
  const float va = aa - a * a / n, vb = bb - b * b / n;
  return va > 1 && vb > 1 ? double((ab - a * b / n) / std::sqrt(va * vb)) : 0;
}

/// The profile around the chosen peak, moved to its sub-pixel place, is mixed into the remembered one.
void vpMbtDistanceTrunk::rememberProfile(BorderState &state, double rate)
{
  const double middle = double(state.whole.size() / 2) + state.peaks[std::size_t(state.chosen)].offset_px;
  const int first = int(std::floor(middle)) - kProfileReach;
  if (first < 0 || first + 2 * kProfileReach + 1 >= int(state.whole.size()))
    return;
  const float part = float(middle - std::floor(middle)), gain = state.remembered_profile.empty() ? 1.f : float(rate);
  state.remembered_profile.resize(2 * kProfileReach + 1, 0.f);
  for (std::size_t k = 0; k < state.remembered_profile.size(); ++k) {
    const float *at = state.whole.data() + first + k;
    state.remembered_profile[k] += gain * ((1 - part) * at[0] + part * at[1] - state.remembered_profile[k]);
  }
}

void vpMbtDistanceTrunk::remember(double rate)
{
  for (BorderState &state : m_border) {
    if (!state.visible || state.chosen < 0)
      continue;
    const double seen = state.peaks[std::size_t(state.chosen)].contrast;
    const double gain = std::max(rate, 1.0 / (state.remembered_frames + 1));
    state.remembered_contrast += gain * (seen - state.remembered_contrast);
    ++state.remembered_frames;
    rememberProfile(state, kProfileRate);
  }
}

void vpMbtDistanceTrunk::forget()
{
  for (BorderState &state : m_border) {
    state.remembered_contrast = 0;
    state.remembered_frames = 0;
    state.remembered_profile.clear();
  }
}

void vpMbtDistanceTrunk::initInteractionMatrixError()
{
  nbFeature = 0;
  for (const BorderState &state : m_border)
    if (state.visible)
      for (const Piece &piece : state.pieces)
        nbFeature += piece.used ? 1 : 0;
  L.resize(nbFeature, 6);
  error.resize(nbFeature);
  by_log_radius.resize(nbFeature);
  weight.resize(nbFeature);
}

void vpMbtDistanceTrunk::computeInteractionMatrixError(const vpHomogeneousMatrix &cMo)
{
  const bole::Cylinder in_camera = bole::Pose::fromVisp(cMo) * m_object;
  unsigned int k = 0;
  Eigen::Matrix<double, 1, 6> row;
  for (Border side : kBorders) {
    const BorderState &state = border(side);
    if (!state.visible)
      continue;
    for (const Piece &piece : state.pieces) {
      if (!piece.used)
        continue;
      error[k] = residual(in_camera, side, m_pinhole.ray(piece.found_px), &row, &by_log_radius[k]);
      for (unsigned int c = 0; c < 6; ++c)
        L[k][c] = row(int(c));
      weight[k] = piece.share / m_options.pieces;
      ++k;
    }
  }
}

double vpMbtDistanceTrunk::residual(const bole::Cylinder &c, Border side, const Vector3d &m,
                                    Eigen::Matrix<double, 1, 6> *row, double *by_log_radius)
{
  const bole::RelativeTrunk relative = bole::relativeTrunk(c);
  const Vector3d n = relative.borderNormal(side);
  const double h = n.head<2>().norm(), distance = n.dot(m) / h;
  if (!row && !by_log_radius)
    return distance;
  const Vector3d a = relative.cRt.col(2), b = a.cross(n), p = c.foot;
  const double bp = b.dot(p), ap = a.dot(p);
  // dn = alpha a + beta b, both linear in (v, w)
  const Vector3d alpha_w = b;
  const Vector3d beta_v = n / bp, beta_w = (p.cross(n) - ap * b) / bp;
  // de = (m - distance * (n_x, n_y, 0) / h) . dn / h
  const Vector3d by_n = (m - distance / h * Vector3d(n.x(), n.y(), 0)) / h;
  if (by_log_radius)
    *by_log_radius = -by_n.dot(b) * c.radius / bp;
  if (!row)
    return distance;
  row->head<3>() = (by_n.dot(b) * beta_v).transpose();
  row->tail<3>() = (by_n.dot(a) * alpha_w + by_n.dot(b) * beta_w).transpose();
  return distance;
}
