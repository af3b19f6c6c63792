// SPDX-License-Identifier: GPL-2.0-or-later
#include "support/test.h"

#include "ardrone/uvlc.h"
#include "emulator/wire_format.h"

using namespace bole;

namespace
{
/// Bytes of a text of 0 and 1, as the drone stores its words.
std::vector<std::uint8_t> wordsOf(std::string bits)
{
  bits.erase(std::remove(bits.begin(), bits.end(), ' '), bits.end());
  bits.resize((bits.size() + 31) / 32 * 32, '0');
  std::vector<std::uint8_t> bytes(bits.size() / 8);
  for (std::size_t i = 0; i < bits.size(); ++i)
    if (bits[i] == '1')
      bytes[i / 32 * 4 + 3 - i % 32 / 8] |= static_cast<std::uint8_t>(0x80 >> (i % 8));
  return bytes;
}

std::array<int, 64> readBlock(const std::string &bits, bool &good)
{
  const auto bytes = wordsOf(bits);
  UvlcBits reader(bytes.data(), bytes.size());
  std::array<int, 64> levels{};
  good = readUvlcBlock(reader, true, levels);
  return levels;
}

vpImage<unsigned char> scene(unsigned width, unsigned height)
{
  vpImage<unsigned char> image(height, width);
  for (unsigned v = 0; v < height; ++v)
    for (unsigned u = 0; u < width; ++u)
      image[v][u] =
          static_cast<unsigned char>(128 + 60 * std::sin(u * 0.15) * std::cos(v * 0.11) + (u / 40 % 2 ? 50 : -50));
  return image;
}

double largestDifference(const YuvPicture &picture, const vpImage<unsigned char> &image)
{
  double largest = 0;
  for (unsigned i = 0; i < image.getSize(); ++i)
    largest = std::max(largest, std::abs(double(picture.y[i]) - image.bitmap[i]));
  return largest;
}
const std::string kPicture = "0000000000000000100000 10 001 000 11111 00000000000000000000000000000101 ";
const std::string kBlackMacroblock = "0 10000000 0000000000 0000000000 0000000000 0000000000 0101010101 0101010101 ";
} // namespace

TEST(Uvlc, ReadsTheWorkedExampleOfTheDeveloperGuide)
{
  // -26; -3; 0; 0; 0; 0; 7; -5; end. The guide prints the DC as sixteen bits cut to ten.
  bool good = false;
  const auto levels = readBlock("1111100110 1 00111 000100 0001110 1 0001011 1 01", good);
  ASSERT_TRUE(good);
  EXPECT_EQ(levels[0], (-26) & 0x3ff);
  EXPECT_EQ(levels[1], -3);
  for (int i = 2; i < 6; ++i)
    EXPECT_EQ(levels[i], 0);
  EXPECT_EQ(levels[6], 7);
  EXPECT_EQ(levels[7], -5);
  for (int i = 8; i < 64; ++i)
    EXPECT_EQ(levels[i], 0);
}

TEST(Uvlc, ReadsEveryRowOfTheCodeTables)
{
  // run 63 cannot be (the DC is the first of 64), 62 can; levels to +-127
  struct Row
  {
    const char *bits;
    int run, level;
  };
  for (const Row &row :
       {Row{"1 10", 0, 1}, Row{"01 11", 1, -1}, Row{"0010 00100", 2, 2}, Row{"0011 00111", 3, -3},
        Row{"000111 0001000", 7, 4}, Row{"00001000 000011111", 8, -15}, Row{"0000011111 00000111110", 31, 31},
        Row{"000000111110 0000001000001", 62, -32}, Row{"1 000000011111110", 0, 127}}) {
    bool good = false;
    const auto levels = readBlock(std::string("0000000001 ") + row.bits + " 1 01", good);
    EXPECT_TRUE(good) << row.bits;
    EXPECT_EQ(levels[static_cast<std::size_t>(row.run) + 1], row.level) << row.bits;
  }
}

TEST(Uvlc, RefusesABlockOfMoreThanSixtyFourCoefficients)
{
  bool good = true;
  readBlock("0000000001 000000111111 10 1 01", good); // run 63
  EXPECT_FALSE(good);
}

TEST(Uvlc, ReadsTheHeaderOfAPictureThatADroneSent)
{
  // First bytes of a datagram published with the description of one decoder: VGA family, 320x240,
  // intra, quantiser 31, number 20590. The rest is cut off, so nothing else can be said.
  const std::vector<std::uint8_t> bytes = {0x43, 0x82, 0x00, 0x00, 0x0d, 0x0a, 0x00, 0xe0, 0x0f, 0xe2, 0xf4, 0xcd};
  const UvlcResult result = decodeUvlc(bytes.data(), bytes.size());
  EXPECT_EQ(result.picture.width, 320);
  EXPECT_EQ(result.picture.height, 240);
  EXPECT_EQ(result.picture.number, 20590u);
  EXPECT_FALSE(result.whole);
}

TEST(Uvlc, DecodesAPictureWrittenByHand)
{
  // 160x120: eight rows of ten macroblocks. The first is white on its left half (DC 680 * 3 / 8 = 255), the second is
  // not coded, the others are black; the last four lines of the last row are not shown.
  std::string bits = kPicture;
  bits += "0 10000000 1010101000 0000000000 1010101000 0000000000 0101010101 0101010101 1 ";
  for (int i = 2; i < 10; ++i)
    bits += kBlackMacroblock;
  for (int group = 1; group < 8; ++group) {
    auto text = bits;
    text.erase(std::remove(text.begin(), text.end(), ' '), text.end());
    bits = text + std::string((32 - text.size() % 32) % 32, '0');
    bits += "00000000000000001";
    for (int bit = 4; bit >= 0; --bit)
      bits += (group >> bit & 1) ? '1' : '0';
    bits += "11111";
    for (int i = 0; i < 10; ++i)
      bits += kBlackMacroblock;
  }
  const auto bytes = wordsOf(bits);
  const UvlcResult result = decodeUvlc(bytes.data(), bytes.size());
  EXPECT_TRUE(result.whole) << result.message;
  EXPECT_EQ(result.gobs, 8);
  EXPECT_EQ(result.picture.number, 5u);
  ASSERT_EQ(result.picture.y.size(), 160u * 120u);
  EXPECT_EQ(result.picture.y[0], 255);
  EXPECT_EQ(result.picture.y[7], 255);
  EXPECT_EQ(result.picture.y[8], 0);
  EXPECT_EQ(result.picture.y[15 * 160 + 7], 255);
  EXPECT_EQ(result.picture.y[16 * 160], 0);
  EXPECT_EQ(result.picture.cb[0], 128); // 341 * 3 / 8
}

TEST(Uvlc, DecodesWhatTheSeparateEncoderWrites)
{
  for (const auto &[width, height] : {std::pair{320u, 240u}, std::pair{160u, 120u}, std::pair{176u, 144u}}) {
    const auto image = scene(width, height);
    const auto bytes = encodeUvlc(image, 42);
    const UvlcResult result = decodeUvlc(bytes.data(), bytes.size());
    ASSERT_TRUE(result.whole) << result.message;
    EXPECT_EQ(result.picture.number, 42u);
    EXPECT_EQ(result.picture.width, static_cast<int>(width));
    EXPECT_LT(largestDifference(result.picture, image), 40);
    double squares = 0;
    for (unsigned i = 0; i < image.getSize(); ++i)
      squares += std::pow(double(result.picture.y[i]) - image.bitmap[i], 2);
    EXPECT_LT(std::sqrt(squares / image.getSize()), 4.0); // the table's steps go from 3 to 31
  }
}

TEST(Uvlc, LosesOneGroupToADamagedBlockAndSaysSo)
{
  const auto image = scene(320, 240);
  auto bytes = encodeUvlc(image, 3);
  // Quantiser of group 7: its start code is on a word.
  for (std::size_t at = 0; at + 4 <= bytes.size(); at += 4)
    if (bytes[at + 3] == 0 && bytes[at + 2] == 0 && (bytes[at + 1] & 0xfc) == (0x80 | 7 << 2)) {
      bytes[at] ^= 0x40;
      break;
    }
  const UvlcResult result = decodeUvlc(bytes.data(), bytes.size());
  EXPECT_FALSE(result.whole);
  EXPECT_EQ(result.gobs, 14);
  EXPECT_NE(result.message.find("quantiser"), std::string::npos);
  EXPECT_NE(result.message.find("P264"), std::string::npos);
}

TEST(Uvlc, ACutDatagramIsNotWhole)
{
  const auto bytes = encodeUvlc(scene(320, 240), 3);
  for (std::size_t size = 0; size + 8 < bytes.size(); size += 997)
    EXPECT_FALSE(decodeUvlc(bytes.data(), size).whole) << size;
}
