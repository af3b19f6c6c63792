// SPDX-License-Identifier: GPL-2.0-or-later
#include "motion/epipolar_loops.h"

#include "geometry/vector_clones.h"

#include <algorithm>
#include <cmath>
#include <initializer_list>

namespace bole::motion
{
BOLE_VECTOR_CLONES
double costOfMatches(const RayColumns &rays, const EpipolarTerms &terms)
{
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double *E = terms.E, e00 = E[0], e01 = E[1], e02 = E[2], e10 = E[3], e11 = E[4], e12 = E[5], e20 = E[6],
               e21 = E[7], e22 = E[8];
  const double by_sigma = 1 / terms.sigma, by_kernel2 = 1 / (kKernel * kKernel);
  double cost = 0;
#pragma omp simd reduction(+ : cost)
  for (int i = 0; i < n; ++i) {
    const double l0 = e00 * bx[i] + e01 * by[i] + e02, l1 = e10 * bx[i] + e11 * by[i] + e12;
    const double l2 = e20 * bx[i] + e21 * by[i] + e22; // E b: line in a
    const double m0 = e00 * ax[i] + e10 * ay[i] + e20, m1 = e01 * ax[i] + e11 * ay[i] + e21;
    const double m2 = e02 * ax[i] + e12 * ay[i] + e22; // E^T a: line in b
    const double S = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1 + 1e-24;
    const double algebraic = (ax[i] * l0 + ay[i] * l1 + l2) * by_sigma, u2 = algebraic * algebraic / S;
    const double sine2 = (m0 * m0 + m1 * m1 + m2 * m2) / (ax[i] * ax[i] + ay[i] * ay[i] + 1);
    cost += sine2 / (sine2 + kEpipole * kEpipole) * 0.5 * u2 / (1 + u2 * by_kernel2);
  }
  return cost;
}

namespace
{
/// Upper triangle of H by rows and g, of five unknowns or of six.
template <bool kIsSheared>
[[gnu::always_inline]] inline void sumMatches(const RayColumns &rays, const EpipolarTerms &terms, double *H, double *g)
{
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double *E = terms.E, *R = terms.R, *B = terms.B;
  const double e00 = E[0], e01 = E[1], e02 = E[2], e10 = E[3], e11 = E[4], e12 = E[5], e20 = E[6], e21 = E[7],
               e22 = E[8];
  const double r00 = R[0], r01 = R[1], r02 = R[2], r10 = R[3], r11 = R[4], r12 = R[5], r20 = R[6], r21 = R[7],
               r22 = R[8];
  const double b00 = B[0], b10 = B[1], b20 = B[2], b01 = B[3], b11 = B[4], b21 = B[5];
  const double by_sigma = 1 / terms.sigma, by_kernel2 = 1 / (kKernel * kKernel);
  double h00 = 0, h01 = 0, h02 = 0, h03 = 0, h04 = 0, h11 = 0, h12 = 0, h13 = 0, h14 = 0, h22 = 0, h23 = 0, h24 = 0,
         h33 = 0, h34 = 0, h44 = 0, g0 = 0, g1 = 0, g2 = 0, g3 = 0, g4 = 0;
  double h05 = 0, h15 = 0, h25 = 0, h35 = 0, h45 = 0, h55 = 0, g5 = 0; // by the shear
  const double shear = kIsSheared ? terms.shear : 0;
#pragma omp simd reduction(+ : h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15, h22, h23, h24, h25, h33, h34,    \
                               h35, h44, h45, h55, g0, g1, g2, g3, g4, g5)
  for (int i = 0; i < n; ++i) {
    const double xa = ax[i], ya = ay[i], yb = by[i], xb = kIsSheared ? bx[i] - shear * yb : bx[i];
    const double l0 = e00 * xb + e01 * yb + e02, l1 = e10 * xb + e11 * yb + e12, l2 = e20 * xb + e21 * yb + e22;
    const double m0 = e00 * xa + e10 * ya + e20, m1 = e01 * xa + e11 * ya + e21, m2 = e02 * xa + e12 * ya + e22;
    const double S = l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1 + 1e-24, inverse = 1 / S;
    const double algebraic = xa * l0 + ya * l1 + l2, share = algebraic * inverse;
    const double scale = by_sigma * std::sqrt(inverse), u = algebraic * scale;
    const double sine2 = (m0 * m0 + m1 * m1 + m2 * m2) / (xa * xa + ya * ya + 1);
    const double root = 1 / (1 + u * u * by_kernel2), w = sine2 / (sine2 + kEpipole * kEpipole) * root * root;
    // by the direction: p x (a - share flat l) - share (R flat m) x a, with p = R b
    const double p0 = r00 * xb + r01 * yb + r02, p1 = r10 * xb + r11 * yb + r12, p2 = r20 * xb + r21 * yb + r22;
    const double c0 = xa - share * l0, c1 = ya - share * l1;
    const double q0 = share * (r00 * m0 + r01 * m1), q1 = share * (r10 * m0 + r11 * m1),
                 q2 = share * (r20 * m0 + r21 * m1);
    const double d0 = p1 - p2 * c1 - (q1 - q2 * ya), d1 = p2 * c0 - p0 - (q2 * xa - q0),
                 d2 = p0 * c1 - p1 * c0 - (q0 * ya - q1 * xa);
    // by the rotation: b x (m - share E^T flat l) + share m x flat m
    const double f0 = m0 - share * (e00 * l0 + e10 * l1), f1 = m1 - share * (e01 * l0 + e11 * l1),
                 f2 = m2 - share * (e02 * l0 + e12 * l1);
    const double j0 = scale * (yb * f2 - f1 - share * m2 * m1), j1 = scale * (f0 - xb * f2 + share * m2 * m0),
                 j2 = scale * (xb * f1 - yb * f0);
    const double j3 = scale * (b00 * d0 + b10 * d1 + b20 * d2), j4 = scale * (b01 * d0 + b11 * d1 + b21 * d2);
    const double w0 = w * j0, w1 = w * j1, w2 = w * j2, w3 = w * j3, w4 = w * j4;
    h00 += w0 * j0, h01 += w0 * j1, h02 += w0 * j2, h03 += w0 * j3, h04 += w0 * j4;
    h11 += w1 * j1, h12 += w1 * j2, h13 += w1 * j3, h14 += w1 * j4;
    h22 += w2 * j2, h23 += w2 * j3, h24 += w2 * j4, h33 += w3 * j3, h34 += w3 * j4, h44 += w4 * j4;
    g0 += w0 * u, g1 += w1 * u, g2 += w2 * u, g3 += w3 * u, g4 += w4 * u;
    if constexpr (kIsSheared) {
      const double j5 = -yb * scale * f0, w5 = w * j5;
      h05 += w5 * j0, h15 += w5 * j1, h25 += w5 * j2, h35 += w5 * j3, h45 += w5 * j4, h55 += w5 * j5, g5 += w5 * u;
    }
  }
  const auto put = [&H](std::initializer_list<double> row) { H = std::copy(row.begin(), row.end(), H); };
  if constexpr (kIsSheared) {
    put({h00, h01, h02, h03, h04, h05, h11, h12, h13, h14, h15, h22, h23, h24, h25, h33, h34, h35, h44, h45, h55});
    g[5] = g5;
  }
  else
    put({h00, h01, h02, h03, h04, h11, h12, h13, h14, h22, h23, h24, h33, h34, h44});
  g[0] = g0, g[1] = g1, g[2] = g2, g[3] = g3, g[4] = g4;
}
} // namespace

BOLE_VECTOR_CLONES
EpipolarSums sumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms)
{
  EpipolarSums sums;
  sumMatches<false>(rays, terms, sums.H, sums.g);
  return sums;
}

BOLE_VECTOR_CLONES
ShearSums shearSumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms)
{
  ShearSums sums;
  sumMatches<true>(rays, terms, sums.H, sums.g);
  return sums;
}

BOLE_VECTOR_CLONES
void residualsOfMatches(const RayColumns &rays, const EpipolarTerms &terms, double *__restrict residuals)
{
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double *E = terms.E, e00 = E[0], e01 = E[1], e02 = E[2], e10 = E[3], e11 = E[4], e12 = E[5], e20 = E[6],
               e21 = E[7], e22 = E[8], shear = terms.shear;
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const double yb = by[i], xb = bx[i] - shear * yb;
    const double l0 = e00 * xb + e01 * yb + e02, l1 = e10 * xb + e11 * yb + e12, l2 = e20 * xb + e21 * yb + e22;
    const double m0 = e00 * ax[i] + e10 * ay[i] + e20, m1 = e01 * ax[i] + e11 * ay[i] + e21;
    residuals[i] = (ax[i] * l0 + ay[i] * l1 + l2) / std::sqrt(l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1 + 1e-24);
  }
}

BOLE_VECTOR_CLONES
FlowSums flowSumsOfMatches(const RayColumns &rays, const EpipolarTerms &terms, const double *t)
{
  constexpr double kLeastAhead = 0.05, kMost = 400; // of the depth in b; [sigma^2]
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double *E = terms.E, *R = terms.R;
  const double e00 = E[0], e01 = E[1], e02 = E[2], e10 = E[3], e11 = E[4], e12 = E[5], e20 = E[6], e21 = E[7],
               e22 = E[8];
  const double r00 = R[0], r01 = R[1], r02 = R[2], r10 = R[3], r11 = R[4], r12 = R[5], r20 = R[6], r21 = R[7],
               r22 = R[8];
  const double t0 = t[0], t1 = t[1], t2 = t[2];
  const double by_sigma = 1 / terms.sigma, by_kernel2 = 1 / (kKernel * kKernel);
  double along = 0, across = 0, sum = 0, agreement = 0, squares = 0;
#pragma omp simd reduction(+ : along, across, sum, agreement, squares)
  for (int i = 0; i < n; ++i) {
    const double xa = ax[i], ya = ay[i], xb = bx[i], yb = by[i];
    const double l0 = e00 * xb + e01 * yb + e02, l1 = e10 * xb + e11 * yb + e12, l2 = e20 * xb + e21 * yb + e22;
    const double m0 = e00 * xa + e10 * ya + e20, m1 = e01 * xa + e11 * ya + e21;
    const double algebraic = (xa * l0 + ya * l1 + l2) * by_sigma;
    const double u2 = algebraic * algebraic / (l0 * l0 + l1 * l1 + m0 * m0 + m1 * m1 + 1e-24);
    const double p0 = r00 * xb + r01 * yb + r02, p1 = r10 * xb + r11 * yb + r12, p2 = r20 * xb + r21 * yb + r22;
    const bool is_ahead = p2 >= kLeastAhead;
    const double inverse = 1 / (is_ahead ? p2 : 1), x = p0 * inverse, y = p1 * inverse; // where it is seen from a
    // A point of positive depth is seen from a further along the direction than from b.
    const double line_x = t0 - x * t2, line_y = t1 - y * t2, length2 = line_x * line_x + line_y * line_y;
    const double scale = length2 > 0 ? by_sigma / std::sqrt(length2 > 0 ? length2 : 1) : 0;
    const double u = ((xa - x) * line_x + (ya - y) * line_y) * scale,
                 v = ((xa - x) * line_y - (ya - y) * line_x) * scale;
    const double root = 1 / (1 + u2 * by_kernel2), w = is_ahead ? root * root : 0;
    const double vote = std::min(std::max(0.5 * u, -1.0), 1.0);
    along += w * std::min(u * u, kMost);
    across += w * v * v;
    sum += w;
    agreement += w * vote;
    squares += w * w * vote * vote;
  }
  return {along, across, sum, agreement, squares};
}

namespace
{
constexpr double kLeastDepth = 1e-3; // of a ray of b in a
} // namespace

BOLE_VECTOR_CLONES
void transferResiduals(const RayColumns &rays, const double *R, double *__restrict residuals)
{
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double r00 = R[0], r10 = R[1], r20 = R[2], r01 = R[3], r11 = R[4], r21 = R[5], r02 = R[6], r12 = R[7],
               r22 = R[8];
#pragma omp simd
  for (int i = 0; i < n; ++i) {
    const double z = std::max(r20 * bx[i] + r21 * by[i] + r22, kLeastDepth);
    residuals[i] = ax[i] - (r00 * bx[i] + r01 * by[i] + r02) / z;
    residuals[n + i] = ay[i] - (r10 * bx[i] + r11 * by[i] + r12) / z;
  }
}

BOLE_VECTOR_CLONES
TransferSums sumsOfTransfers(const RayColumns &rays, const double *R, const double *residuals, double variance)
{
  const int n = static_cast<int>(rays.ax.size());
  const double *ax = rays.ax.data(), *ay = rays.ay.data(), *bx = rays.bx.data(), *by = rays.by.data();
  const double r00 = R[0], r10 = R[1], r20 = R[2], r01 = R[3], r11 = R[4], r21 = R[5], r02 = R[6], r12 = R[7],
               r22 = R[8];
  const double by_variance = 1 / (variance * kKernel * kKernel);
  double h00 = 0, h01 = 0, h02 = 0, h11 = 0, h12 = 0, h22 = 0, g0 = 0, g1 = 0, g2 = 0;
#pragma omp simd reduction(+ : h00, h01, h02, h11, h12, h22, g0, g1, g2)
  for (int i = 0; i < n; ++i) {
    const double xb = bx[i], yb = by[i], ex = residuals[i], ey = residuals[n + i], x = ax[i] - ex, y = ay[i] - ey;
    const double inverse = 1 / std::max(r20 * xb + r21 * yb + r22, kLeastDepth);
    const double root = 1 / (1 + (ex * ex + ey * ey) * by_variance), w = root * root;
    // rows of the projection, turned into b: times the skew of the ray their cross product with it
    const double u0 = inverse * (r00 - x * r20), u1 = inverse * (r01 - x * r21), u2 = inverse * (r02 - x * r22);
    const double v0 = inverse * (r10 - y * r20), v1 = inverse * (r11 - y * r21), v2 = inverse * (r12 - y * r22);
    const double j0 = u1 - u2 * yb, j1 = u2 * xb - u0, j2 = u0 * yb - u1 * xb;
    const double k0 = v1 - v2 * yb, k1 = v2 * xb - v0, k2 = v0 * yb - v1 * xb;
    h00 += w * (j0 * j0 + k0 * k0), h01 += w * (j0 * j1 + k0 * k1), h02 += w * (j0 * j2 + k0 * k2);
    h11 += w * (j1 * j1 + k1 * k1), h12 += w * (j1 * j2 + k1 * k2), h22 += w * (j2 * j2 + k2 * k2);
    g0 += w * (j0 * ex + k0 * ey), g1 += w * (j1 * ex + k1 * ey), g2 += w * (j2 * ex + k2 * ey);
  }
  return {{h00, h01, h02, h11, h12, h22}, {g0, g1, g2}};
}
} // namespace bole::motion
