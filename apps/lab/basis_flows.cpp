// SPDX-License-Identifier: GPL-2.0-or-later
#include "basis_flows.h"

#include "output/palette.h"
#include "output/svg.h"
#include "saliency/flow_matrix.h"

#include <fmt/format.h>

namespace bole::apps
{
std::string basisFlowsSvg(const PinholeCamera &camera)
{
  const char *axes[3] = {"turn about x (right)", "turn about y (down)", "turn about z (forward)"};
  constexpr double kTurn = 0.06; // [rad], for arrows of a length that can be seen
  const int step = camera.width / 14;
  SvgDrawing drawing(3 * camera.width + 40, camera.height + 40);
  for (int axis = 0; axis < 3; ++axis) {
    const double left = 10 + axis * (camera.width + 10), top = 10;
    drawing.polygon({{left, top},
                     {left + camera.width, top},
                     {left + camera.width, top + camera.height},
                     {left, top + camera.height}},
                    "none", fmt::format("stroke=\"{}\"", palette::kGrey));
    for (int v = step / 2; v < camera.height; v += step)
      for (int u = step / 2; u < camera.width; u += step) {
        const Eigen::Vector2d flow = kTurn * flowMatrix(camera, {u, v}).col(axis);
        drawing.line(left + u, top + v, left + u + flow.x(), top + v + flow.y(), palette::kBlue);
        drawing.circle(left + u, top + v, 1.6, palette::kBlue);
      }
    drawing.text(left, top + camera.height + 20, axes[axis]);
  }
  return drawing.finish();
}
} // namespace bole::apps
