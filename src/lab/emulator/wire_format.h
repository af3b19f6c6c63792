// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// The drone's end of the wire: what it says as bytes, and what it is told.
#include <bole/ardrone_wire.h>
#include <bole/visp.h>

#include <cstdint>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>

namespace bole
{
/// The datagram of \p navdata: its typed options 0, 1 and 3 where they are set (with zeros for what the struct leaves
/// out), the others as bytes, and the checksum.
std::vector<std::uint8_t> encodeNavdata(const Navdata &navdata);

/// Navdata::time of \p microseconds since any start, reduced to the 2048 s that the word holds.
std::uint32_t navdataTimeWord(std::int64_t microseconds);

/// The bytes of \p header, header_size long.
std::vector<std::uint8_t> encodePaveHeader(const PaveHeader &header);

/// A command: `AT*NAME=sequence,arguments\r`.
struct AtCommand
{
  std::string name;                   ///< "REF", "PCMD", "CONFIG", "COMWDG", ...
  std::int64_t sequence = 0;          ///< rising
  std::vector<std::string> arguments; ///< without quotes
};
/// The commands of a datagram; what is not a command is left out.
std::vector<AtCommand> parseAtCommands(const std::string &datagram);

/// Encodes a grey picture (colours neutral) as an AR.Drone 1 does, quantiser 31. Written from the facts that stand in
/// src/ardrone/uvlc.h and from the decoder's mathematics by definition: no code in common. Sides must be 160x120 or
/// 88x72 times a power of two; throws vpException else.
std::vector<std::uint8_t> encodeUvlc(const vpImage<unsigned char> &image, std::uint32_t number);
} // namespace bole
