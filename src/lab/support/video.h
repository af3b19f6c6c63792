// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// Pictures one after the other as an mp4, by OpenCV.

#include "support/text.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>
#include <visp3/core/vpImage.h>
#include <visp3/core/vpRGBa.h>

namespace bole
{
/// Stands as `.part.mp4` beside its place until finish().
class Video
{
public:
  Video(std::string path, double rate_hz) : m_path(std::move(path)), m_rate_hz(rate_hz) {}

  void write(const vpImage<vpRGBa> &picture)
  {
    const cv::Mat rgba(static_cast<int>(picture.getHeight()), static_cast<int>(picture.getWidth()), CV_8UC4,
                       picture.bitmap);
    cv::Mat bgr;
    cv::cvtColor(rgba, bgr, cv::COLOR_RGBA2BGR);
    if (!m_writer.isOpened() &&
        !m_writer.open(beside(), cv::VideoWriter::fourcc('a', 'v', 'c', '1'), m_rate_hz, bgr.size()))
      throw ioError("{}: cannot be written", m_path);
    m_writer.write(bgr);
  }

  void finish()
  {
    if (!m_writer.isOpened())
      return;
    m_writer.release();
    if (std::rename(beside().c_str(), m_path.c_str()) != 0)
      throw ioError("{}: cannot be written", m_path);
  }

private:
  std::string beside() const { return m_path + ".part.mp4"; }

  std::string m_path;
  double m_rate_hz;
  cv::VideoWriter m_writer;
};
} // namespace bole
