// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Navigation data of the AR.Drone 1 and 2: one datagram in, named numbers out.

#include <bole/ardrone_wire.h>

namespace bole
{
enum class NavdataError
{
  none,
  too_short,
  header,
  option_size,
  no_checksum,
  checksum
};
const char *toString(NavdataError error);

/// Reads one datagram. Only packets with a right checksum get through.
/// Laws (each a test): parse(encode(n)) == n; any single changed byte is an error; any input terminates.
NavdataError parseNavdata(const std::uint8_t *data, std::size_t size, Navdata &navdata);
} // namespace bole
