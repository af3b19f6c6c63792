// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// UVLC, the intra-only video of the AR.Drone 1, which no packaged library decodes.
///
/// Facts, each found alike in at least two of: (a) AR.Drone Developer Guide, SDK 1.6 and 1.7, section 7.2 "The video
/// stream"; (b) the SDK's own description, VLIB/Docs/uvlc.txt; (c) the notes of djtrance's ardrone1_video_decoder; (d)
/// the decoders of JavaDrone's family (cvdrone, libkovan).
/// - A datagram is a picture: little-endian 32-bit words, read from their most significant bit (c, d).
/// - Start code of 22 bits, `0000 0000 0000 0000 1nnn nn`, on a byte of the stream; n = 0 begins a picture,
///   1 .. 30 a group of blocks (GOB), 31 ends the sequence (a, b, d).
/// - Picture: format 2 bits (1 CIF family, 88x72 base; 2 VGA family, 160x120 base), resolution 3 bits
///   (base << (resolution - 1)), type 3 bits (0 intra), quantiser 5 bits, number 32 bits; the
///   header of the first GOB is left out (a, b, c, d). Other GOBs: quantiser 5 bits (a, b, d).
/// - GOB: a row of 16x16 macroblocks. Macroblock: 1 bit, **0 when it is coded** ((a) and (b) print the
///   opposite; (c) says that they err, (d) reads it so); then 8 bits, least significant first: AC
///   coefficients in Y0 Y1 Y2 Y3 Cb Cr, quantiser change, always 1 (a, b, c, d); then the blocks.
/// - Block: DC 10 bits; with AC, pairs of run and level. Run: n zeros, a one, then n - 1 bits x: 0 for
///   n = 0, else 2^(n-1) + x. Level the same with a sign bit behind (1 = negative), but for n = 0,
///   which is
///   +-1, and n = 1, which ends the block (a, c, d).
/// - Quantiser 31, the only one ever seen on the wire (c), stands for the table 3 + 2 (i + j), DC too; any
///   other is refused (c, d). Order zigzag, orthonormal 8x8 DCT, no level shift: the DC is positive
///   (a, d).
/// - P264, the drone's other video (video:video_codec 64 instead of 32, in the enumerations of the
///   SDK and of xcs), is not documented and not read; the message says so.
///
/// Deviation: (a) prints the DC as a signed number; intra pictures only have DC >= 0, and a bright
/// block (mean above 191) needs all ten bits, so it is read without sign, as (d) does.

#include <bole/visp.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// A decoded picture in the planes of YCbCr 4:2:0, colour planes at half the size.
struct YuvPicture
{
  int width = 0, height = 0;           ///< [px]
  std::vector<std::uint8_t> y, cb, cr; ///< rows without padding; colour rows of (width + 1) / 2
  std::uint32_t number = 0;            ///< frame number as the drone counts

  bool empty() const { return y.empty(); }
  void toGrey(vpImage<unsigned char> &image) const;
  void toColour(vpImage<vpRGBa> &image) const;
};

/// Reads bits from little-endian 32-bit words, most significant first. Past the end it gives zeros and says so.
class UvlcBits
{
public:
  UvlcBits(const std::uint8_t *data, std::size_t size);
  std::uint32_t read(int count);       ///< \param count 0 .. 32
  std::uint32_t peek(int count) const; ///< \param count 0 .. 32
  void skip(int count) { m_position += static_cast<std::size_t>(count); }
  int countZeros();                                   ///< zeros in front of the next one, which is read too; at most 32
  std::size_t position() const { return m_position; } ///< [bit]
  std::size_t size() const { return m_size_bits; }    ///< [bit]
  bool exhausted() const { return m_position > m_size_bits; }
  void alignToByte() { m_position = (m_position + 7) / 8 * 8; }

private:
  std::uint32_t bit(std::size_t at) const;
  const std::uint8_t *m_data;
  std::size_t m_size_bits;
  std::size_t m_position = 0;
};

/// One block as coded, in zigzag order: DC and AC levels before dequantisation.
/// \return false when the block runs past 64 coefficients or past the data.
bool readUvlcBlock(UvlcBits &bits, bool has_ac, std::array<int, 64> &levels);

struct UvlcResult
{
  YuvPicture picture;  ///< empty when not even the picture header could be read
  int gobs = 0;        ///< groups of blocks decoded
  bool whole = false;  ///< every group was decoded and nothing looked wrong
  std::string message; ///< what looked wrong first
};

/// Decodes the picture in a datagram (or in the bytes of a file). After damage it goes on at the
/// next start code; groups that were lost stay black and the result is not `whole`. Never throws.
/// Laws (each a test): decodes the guide's worked example; decode(encode(I)) is I within the
/// quantiser's step; any input terminates.
UvlcResult decodeUvlc(const std::uint8_t *data, std::size_t size);
} // namespace bole
