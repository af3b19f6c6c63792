// SPDX-License-Identifier: GPL-2.0-or-later
#include "baseline/comparison.h"

#include <algorithm>
#include <fmt/format.h>

namespace bole
{
namespace
{
TestFlight pieceOf(const TestFlight &flight, std::size_t first, std::size_t last)
{
  TestFlight piece = flight;
  piece.frames.assign(flight.frames.begin() + std::ptrdiff_t(first), flight.frames.begin() + std::ptrdiff_t(last));
  return piece;
}

/// Adds one run to \p row; the fault stands in frames [lead, lead + n) of the run.
void count(const Score &score, int lead, FaultRow &row)
{
  const int n = row.fault.frames, frames = int(score.errors.size());
  const auto isGood = [&](int k) { // errors[k] is of frame k + 1
    return k < frames && !score.errors[std::size_t(k)].complained && !score.errors[std::size_t(k)].wrong;
  };
  ++row.runs;
  row.fault_frames += n;
  for (int k = lead - 1; k < frames; ++k) {
    const FrameError &e = score.errors[std::size_t(k)];
    row.noticed += k < lead - 1 + n && e.complained ? 1 : 0;
    row.silent_failures += e.wrong && !e.complained ? 1 : 0;
  }
  const int after = lead - 1 + n;
  for (int k = after; k + 2 < frames; ++k)
    if (isGood(k) && isGood(k + 1) && isGood(k + 2)) {
      ++row.recovered;
      row.slowest = std::max(row.slowest, k - after + 1);
      return;
    }
}
} // namespace

std::string FaultCase::text() const { return fmt::format("{} {}", frames, toString(kind)); }

std::vector<FaultCase> allFaults()
{
  return {{FaultKind::black, 1}, {FaultKind::black, 5},   {FaultKind::noise, 1},     {FaultKind::noise, 5},
          {FaultKind::smear, 1}, {FaultKind::freeze, 10}, {FaultKind::wrong_size, 1}};
}

std::vector<FaultRow> faults(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                             const FaultRuns &runs)
{
  std::vector<FaultRow> rows;
  for (const FaultCase &fault : allFaults()) {
    std::vector<FaultRow> own(contenders.size());
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      own[i].name = contenders[i].name();
      own[i].fault = fault;
    }
    for (const std::size_t begin : runs.begins) {
      const std::size_t end = begin + std::size_t(fault.frames + runs.tail), lead = std::size_t(runs.lead);
      if (begin < lead || end > flight.frames.size())
        continue;
      const TestFlight piece = pieceOf(flight, begin - lead, end);
      vpImage<unsigned char> shown;
      const auto imageAt = [&](std::size_t k) -> const vpImage<unsigned char> & {
        if (k < lead || k >= lead + std::size_t(fault.frames))
          return piece.frames[k].image;
        shown = piece.frames[k].image;
        spoil(shown, fault.kind, piece.frames[lead - 1].image, unsigned(k) + 1);
        return shown;
      };
      const std::vector<Score> scores = compare(piece, cao_path, contenders, imageAt);
      for (std::size_t i = 0; i < contenders.size(); ++i)
        count(scores[i], runs.lead, own[i]);
    }
    rows.insert(rows.end(), own.begin(), own.end());
  }
  return rows;
}
} // namespace bole
