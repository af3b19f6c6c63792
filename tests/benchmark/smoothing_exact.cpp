// SPDX-License-Identifier: GPL-2.0-or-later
// Final cost against dense Levenberg-Marquardt, straight and after a loop that returns to old
// trunks.
#include "support/dense_reference.h"
#include "support/flight.h"

#include <fmt/core.h>

int main(int argc, char **argv)
{
  const int most = argc > 1 ? std::atoi(argv[1]) : 500;
  for (const bool loop : {false, true})
    for (const int poses : {20, 50, 100, 200, 500}) {
      if (poses > most)
        continue;
      bole::test::FlightOptions o;
      o.poses = poses;
      o.lap = loop ? std::max(16, poses * 2 / 3) : 0;
      o.spacing = loop ? std::min(2.0, 0.1 * o.lap / 6) : 2;
      const bole::test::Flight flight = bole::test::simulateFlight(o);
      bole::test::Replay replay(flight, bole::test::smootherFor(o));
      replay.run();
      const double updates = replay.smoother.cost();
      bole::test::DenseReference dense(replay.smoother.graph());
      const double reference = dense.solve();
      replay.smoother.optimize();
      fmt::print("{:4d} poses, {}: dense {:.9g}; optimize() {:+.1e}, update() alone {:+.1e} (relative)\n", poses,
                 loop ? "loop    " : "straight", reference, replay.smoother.cost() / reference - 1,
                 updates / reference - 1);
      std::fflush(stdout);
    }
}
