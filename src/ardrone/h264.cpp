// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/h264.h"

#include <algorithm>

extern "C" {
#include <libavutil/frame.h>
}

namespace bole
{
namespace
{
void copyPlane(const std::uint8_t *from, int stride, int width, int height, std::vector<std::uint8_t> &to)
{
  to.resize(static_cast<std::size_t>(width) * height);
  for (int row = 0; row < height; ++row)
    std::copy_n(from + static_cast<std::ptrdiff_t>(row) * stride, width,
                to.begin() + static_cast<std::ptrdiff_t>(row) * width);
}

std::uint8_t clampToByte(double value) { return static_cast<std::uint8_t>(std::clamp(value + 0.5, 0.0, 255.0)); }
} // namespace

void YuvPicture::toGrey(vpImage<unsigned char> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  std::copy(y.begin(), y.end(), image.bitmap);
}

void YuvPicture::toColour(vpImage<vpRGBa> &image) const
{
  image.resize(static_cast<unsigned>(height), static_cast<unsigned>(width));
  const int half = (width + 1) / 2;
  for (int v = 0; v < height; ++v)
    for (int u = 0; u < width; ++u) {
      const std::size_t at = static_cast<std::size_t>(v) * width + u;
      const std::size_t colour = static_cast<std::size_t>(v / 2) * half + u / 2;
      const double luma = y[at], blue = cb[colour] - 128.0, red = cr[colour] - 128.0;
      image.bitmap[at] = vpRGBa(clampToByte(luma + 1.402 * red), clampToByte(luma - 0.344136 * blue - 0.714136 * red),
                                clampToByte(luma + 1.772 * blue));
    }
}

H264Decoder::Result H264Decoder::decode(const std::vector<std::uint8_t> &access_unit, int width, int height,
                                        YuvPicture &picture)
{
  m_message.clear();
  if (!m_decoder.send(access_unit.data(), access_unit.size())) {
    m_message = "the decoder refused the frame";
    return Result::damaged;
  }
  const AVFrame *frame = m_decoder.receive();
  if (frame == nullptr && !m_decoder.hasFailed())
    return Result::nothing;
  if (frame == nullptr || !PictureDecoder::isYuv420(*frame)) {
    m_message = frame == nullptr ? "the frame could not be decoded" : "the frame is not YCbCr 4:2:0";
    return Result::damaged;
  }
  picture.width = width > 0 ? std::min(width, frame->width) : frame->width;
  picture.height = height > 0 ? std::min(height, frame->height) : frame->height;
  copyPlane(frame->data[0], frame->linesize[0], picture.width, picture.height, picture.y);
  copyPlane(frame->data[1], frame->linesize[1], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cb);
  copyPlane(frame->data[2], frame->linesize[2], (picture.width + 1) / 2, (picture.height + 1) / 2, picture.cr);
  if (!PictureDecoder::isDamaged(*frame))
    return Result::picture;
  m_message = "parts of the frame were concealed";
  return Result::damaged;
}
} // namespace bole
