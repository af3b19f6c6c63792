// SPDX-License-Identifier: GPL-2.0-or-later
#include "mbt/model_trunk.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace bole
{
using Eigen::Vector2d;
using Eigen::Vector3d;

namespace
{
constexpr double kContrastRate = 0.15; ///< how fast the remembered contrast follows
constexpr double kProfileRate = 0.5;   ///< and the remembered profile: the background moves on behind the border
constexpr double kInside = 0.95;       ///< r/d from which the camera is taken to touch the trunk

/// The rows that are read along a border, each in the middle of its share.
void chooseRows(ModelBorder &border)
{
  border.rows.resize(std::size_t(kSamples));
  for (int k = 0; k < kSamples; ++k)
    border.rows[std::size_t(k)] = border.image.line.row_begin + (2 * k + 1) * border.image.line.rows() / (2 * kSamples);
}

void readProfiles(const vpImage<unsigned char> &I, int half, ModelBorder &border)
{
  for (std::size_t p = 0; p < kPieces; ++p) {
    std::vector<float> &mean = border.profile[p];
    mean.assign(std::size_t(2 * half + 1), 0.f);
    int read = 0;
    double centre = 0;
    for (std::size_t k = p * kSamples / kPieces; k < (p + 1) * kSamples / kPieces; ++k) {
      if (border.rows[k] < 0)
        continue;
      addAcross(I, border.image, border.rows[k], half, mean.data());
      centre += border.rows[k];
      ++read;
    }
    border.seen[p] = float(read) * kPieces / kSamples;
    border.centre[p] = read > 0 ? centre / read : 0;
    for (float &v : mean)
      v /= float(std::max(read, 1));
  }
  border.whole.assign(std::size_t(2 * half + 1), 0.f);
  const float total = border.seen[0] + border.seen[1] + border.seen[2] + border.seen[3];
  for (std::size_t p = 0; p < kPieces && total > 0; ++p)
    for (std::size_t k = 0; k < border.whole.size(); ++k)
      border.whole[k] += border.seen[p] / total * border.profile[p][k];
}

/// The profile around the chosen peak, moved to its sub-pixel place, is mixed into the remembered one.
void rememberProfile(ModelBorder &border)
{
  const double middle = double(border.whole.size() / 2) + border.peaks[std::size_t(border.chosen)].offset_px;
  const int first = int(std::floor(middle)) - kMemory_px;
  if (first < 0 || first + 2 * kMemory_px + 1 >= int(border.whole.size()))
    return;
  const float part = float(middle - std::floor(middle)),
              gain = border.known_profile.empty() ? 1.f : float(kProfileRate);
  border.known_profile.resize(2 * kMemory_px + 1, 0.f);
  for (std::size_t k = 0; k < border.known_profile.size(); ++k) {
    const float *at = border.whole.data() + first + k;
    border.known_profile[k] += gain * ((1 - part) * at[0] + part * at[1] - border.known_profile[k]);
  }
}

void forgetBorder(ModelBorder &border)
{
  border.known_contrast.reset();
  border.known_frames = 0;
  border.known_profile.clear();
}
} // namespace

BorderPlane::BorderPlane(const Cylinder &c, const RelativeTrunk &relative, Border side)
    : m_n(relative.borderNormal(side)), m_a(relative.cRt.col(2)), m_b(m_a.cross(m_n)), m_h(m_n.head<2>().norm())
{
  const double bp = m_b.dot(c.foot);
  m_beta_v = m_n / bp;
  m_beta_w = (c.foot.cross(m_n) - m_a.dot(c.foot) * m_b) / bp;
  m_beta_radius = -c.radius / bp;
}

void BorderPlane::derive(const Vector3d &m, Row6d &by_twist, double &by_log_radius) const
{
  // de = (m - e (n_x, n_y, 0) / h) . dn / h
  const double e = residual(m);
  const Vector3d by_n = (m - e / m_h * Vector3d(m_n.x(), m_n.y(), 0)) / m_h;
  const double by_a = by_n.dot(m_a), by_b = by_n.dot(m_b);
  by_twist.head<3>() = by_b * m_beta_v.transpose();
  by_twist.tail<3>() = (by_a * m_b + by_b * m_beta_w).transpose();
  by_log_radius = by_b * m_beta_radius;
}

Row6d BorderPlane::sideways(const PinholeCamera &camera, const Vector3d &m, bool is_flat) const
{
  Row6d by_twist;
  double by_log_radius = 0;
  derive(m, by_twist, by_log_radius);
  const double across = is_flat ? camera.fy * m_h / m_n.y() : camera.fx * m_h / m_n.x();
  return -across * by_twist;
}

double ModelBorder::likeness(int offset_px) const
{
  const int middle = int(whole.size()) / 2 + offset_px;
  if (known_profile.empty() || middle < kMemory_px || middle + kMemory_px >= int(whole.size()))
    return 0;
  const float *now = whole.data() + middle - kMemory_px;
  constexpr int n = 2 * kMemory_px + 1;
  float a = 0, b = 0, aa = 0, bb = 0, ab = 0;
  for (int k = 0; k < n; ++k) {
    const float x = now[k], y = known_profile[std::size_t(k)];
    a += x, b += y, aa += x * x, bb += y * y, ab += x * y;
  }
  const float va = aa - a * a / n, vb = bb - b * b / n;
  return va > 1 && vb > 1 ? double((ab - a * b / n) / std::sqrt(va * vb)) : 0;
}

void ModelTrunk::predict(const Pose &cMo, const PinholeCamera &camera, const Options &options, double margin_px)
{
  m_camera.foot = cMo * m_object.foot;
  m_camera.top = cMo * m_object.top;
  m_camera.radius = m_object.radius;
  m_relative = relativeTrunk(m_camera);
  const bool is_seen = m_relative.isFinite() && m_relative.ratio() < kInside &&
                       m_relative.ratio() * (camera.fx + camera.fy) >= options.min_width_px;
  for (const Border side : kBorders) {
    ModelBorder &border = m_borders[side == Border::left ? 0 : 1];
    border.visible = false;
    border.chosen = -1;
    for (FoundPiece &piece : border.pieces)
      piece.used = false;
    if (!is_seen)
      continue;
    border.plane = BorderPlane(m_camera, m_relative, side);
    const ContactLine contact = contactLine(m_camera, m_relative, side);
    border.image = imageBorder(camera, border.plane.normal(), contact.foot, contact.top, margin_px);
    border.visible = border.image.isVisible() && border.image.length() >= options.min_length_px;
    if (!border.visible)
      continue;
    if (border.image.is_flat != border.known_is_flat) // contrasts across rows and columns do not compare
      forgetBorder(border);
    border.known_is_flat = border.image.is_flat;
    const BorderLine &line = border.image.line;
    const Vector2d middle = border.image.at(0.5 * (line.row_begin + line.row_end - 1));
    border.sideways_by_twist = border.plane.sideways(camera, camera.ray(middle), border.image.is_flat);
    chooseRows(border);
  }
}

void ModelTrunk::hideBehind(const ModelTrunk &nearer, const PinholeCamera &camera, const Options &options)
{
  if (!nearer.m_relative.isFinite() || !(nearer.distance() < distance()))
    return;
  const double margin = 1 / camera.fx, d = nearer.distance();
  const Vector3d axis = nearer.m_relative.cRt.col(2);
  const Vector3d left = nearer.m_relative.borderNormal(Border::left),
                 right = nearer.m_relative.borderNormal(Border::right);
  const Silhouette silhouette(nearer.m_relative, margin, axis.dot(nearer.m_camera.foot) / d,
                              axis.dot(nearer.m_camera.top) / d);
  for (ModelBorder &border : m_borders) {
    if (!border.visible)
      continue;
    const Vector3d first = camera.ray(border.image.at(border.image.line.row_begin)),
                   last = camera.ray(border.image.at(border.image.line.row_end - 1));
    const auto isBeside = [&](const Vector3d &n) { return n.dot(first) > 2 * margin && n.dot(last) > 2 * margin; };
    if (isBeside(left) || isBeside(right)) // then no point between the ends is covered either
      continue;
    int seen = 0;
    for (int &row : border.rows) {
      if (row >= 0 && silhouette.covers(camera.ray(border.image.at(row))))
        row = -1;
      seen += row >= 0 ? 1 : 0;
    }
    border.visible = border.image.length() * seen / kSamples >= options.min_length_px;
  }
}

void ModelTrunk::scan(const vpImage<unsigned char> &I, int half_px, double min_contrast)
{
  for (ModelBorder &border : m_borders) {
    border.chosen = -1;
    border.peaks.clear();
    if (!border.visible)
      continue;
    readProfiles(I, half_px + kMemory_px, border);
    differentiate(border.whole, border.contrast);
    border.peaks = peaksOf(border.contrast, 1, min_contrast);
    const auto isOutside = [&](const BorderPeak &p) { return std::abs(p.offset_px) > half_px + 0.5; };
    border.peaks.erase(std::remove_if(border.peaks.begin(), border.peaks.end(), isOutside), border.peaks.end());
  }
}

void ModelTrunk::choose(ModelBorder &border, int chosen, double reach_px, const PinholeCamera &camera,
                        double min_contrast)
{
  border.chosen = chosen;
  for (FoundPiece &piece : border.pieces)
    piece.used = false;
  if (chosen < 0)
    return;
  const BorderPeak peak = border.peaks[std::size_t(chosen)];
  std::vector<float> contrast;
  for (std::size_t p = 0; p < kPieces; ++p) {
    if (border.seen[p] < 0.5f)
      continue;
    differentiate(border.profile[p], contrast);
    double best = 0, offset = 0;
    for (const BorderPeak &own : peaksOf(contrast, 1, min_contrast)) {
      const double away = (own.offset_px - peak.offset_px) / reach_px;
      const double score = std::abs(own.contrast) * (1 - 0.5 * away * away);
      if (own.contrast * peak.contrast > 0 && std::abs(away) <= 1 && score > best)
        best = score, offset = own.offset_px;
    }
    if (best < min_contrast)
      continue;
    FoundPiece &piece = border.pieces[p];
    piece.used = true;
    piece.robust = 1;
    piece.share = double(border.seen[p]) / kPieces;
    piece.m = camera.ray(border.image.at(border.centre[p], offset));
  }
}

void ModelTrunk::linearise(const Pose &cMo)
{
  m_camera.foot = cMo * m_object.foot;
  m_camera.top = cMo * m_object.top;
  m_relative = relativeTrunk(m_camera);
  for (const Border side : kBorders) {
    ModelBorder &border = m_borders[side == Border::left ? 0 : 1];
    if (border.chosen < 0)
      continue;
    border.plane = BorderPlane(m_camera, m_relative, side);
    for (FoundPiece &piece : border.pieces)
      if (piece.used) {
        piece.residual = border.plane.residual(piece.m);
        border.plane.derive(piece.m, piece.by_twist, piece.by_log_radius);
      }
  }
}

void ModelTrunk::remember()
{
  for (ModelBorder &border : m_borders) {
    if (!border.visible || border.chosen < 0)
      continue;
    const double before = border.known_contrast.value_or(0);
    const double gain = std::max(kContrastRate, 1.0 / (border.known_frames + 1));
    border.known_contrast = before + gain * (border.peaks[std::size_t(border.chosen)].contrast - before);
    ++border.known_frames;
    rememberProfile(border);
  }
}

void ModelTrunk::forget()
{
  for (ModelBorder &border : m_borders)
    forgetBorder(border);
}
} // namespace bole
