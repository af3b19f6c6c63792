// SPDX-License-Identifier: GPL-2.0-or-later
#include "lab/baseline/faults.h"

#include <algorithm>
#include <fmt/format.h>
#include <random>

namespace bole
{
namespace
{
const char *toString(Fault fault)
{
  switch (fault) {
  case Fault::black:
    return "black";
  case Fault::noise:
    return "noise";
  case Fault::smear:
    return "half smeared";
  case Fault::frozen:
    return "frozen";
  case Fault::wrong_size:
    return "wrong size";
  }
  return "?";
}

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

std::string FaultCase::text() const { return fmt::format("{} {}", frames, toString(fault)); }

std::vector<FaultCase> allFaults()
{
  return {{Fault::black, 1}, {Fault::black, 5},   {Fault::noise, 1},     {Fault::noise, 5},
          {Fault::smear, 1}, {Fault::frozen, 10}, {Fault::wrong_size, 1}};
}

vpImage<unsigned char> faultyImage(const TestFlight &flight, std::size_t k, std::size_t first, Fault fault)
{
  vpImage<unsigned char> image = flight.frames[k].image;
  const unsigned w = image.getWidth(), h = image.getHeight();
  switch (fault) {
  case Fault::black:
    image = static_cast<unsigned char>(0);
    break;
  case Fault::noise: {
    std::mt19937 random(unsigned(k) + 1);
    for (unsigned i = 0; i < image.getSize(); ++i)
      image.bitmap[i] = static_cast<unsigned char>(random() & 255u);
    break;
  }
  case Fault::smear: // what a decoder shows that lost its data half-way: the last good row again and again
    for (unsigned v = h / 2; v < h; ++v)
      std::copy(image[h / 2 - 1], image[h / 2 - 1] + w, image[v]);
    break;
  case Fault::frozen:
    image = flight.frames[first - 1].image;
    break;
  case Fault::wrong_size: {
    vpImage<unsigned char> small(h / 2, w / 2);
    for (unsigned v = 0; v < h / 2; ++v)
      for (unsigned u = 0; u < w / 2; ++u)
        small[v][u] = image[2 * v][2 * u];
    image = small;
    break;
  }
  }
  return image;
}

std::vector<FaultRow> faults(const TestFlight &flight, const std::string &cao_path, std::vector<Contender> &contenders,
                             const FaultOptions &options, const Limits &limits)
{
  std::vector<FaultRow> rows;
  for (const FaultCase &fault : allFaults()) {
    std::vector<FaultRow> own(contenders.size());
    for (std::size_t i = 0; i < contenders.size(); ++i) {
      own[i].name = contenders[i].name();
      own[i].fault = fault;
    }
    for (const std::size_t begin : options.begins) {
      const std::size_t end = begin + std::size_t(fault.frames + options.tail), lead = std::size_t(options.lead);
      if (begin < lead || end > flight.frames.size())
        continue;
      const TestFlight piece = pieceOf(flight, begin - lead, end);
      vpImage<unsigned char> shown;
      const auto imageAt = [&](std::size_t k) -> const vpImage<unsigned char> & {
        if (k < lead || k >= lead + std::size_t(fault.frames))
          return piece.frames[k].image;
        vpImage<unsigned char> image = faultyImage(piece, k, lead, fault.fault);
        shown = image;
        return shown;
      };
      const std::vector<Score> scores = compare(piece, cao_path, contenders, limits, {}, imageAt);
      for (std::size_t i = 0; i < contenders.size(); ++i)
        count(scores[i], options.lead, own[i]);
    }
    rows.insert(rows.end(), own.begin(), own.end());
  }
  return rows;
}
} // namespace bole
