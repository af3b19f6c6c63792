// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A flight that faults are put into, and its copy on disk.

#include <opencv2/core.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <random>
#include <string>
#include <vector>

namespace bole::faults
{
/// An ASL folder in memory. What is not touched is linked to the original, whose images are read when they are needed.
class SpoiltFlight
{
public:
  /// One line of a table, in fields; headers are kept as they are.
  using Row = std::vector<std::string>;
  struct Table
  {
    std::string header;
    std::vector<Row> rows;
    std::int64_t stamp(std::size_t row) const { return std::stoll(rows[row][0]); }
    double number(std::size_t row, std::size_t column) const { return std::stod(rows[row][column]); }
    void set(std::size_t row, std::size_t column, double value);
  };

  /// \param name of the fault, the seed of its noise
  SpoiltFlight(std::filesystem::path original, const std::string &name);

  std::size_t frames() const { return camera.rows.size(); }
  /// The original image of a frame; what it was renamed to does not matter.
  cv::Mat image(std::size_t frame) const;
  std::string bytesOf(std::size_t frame) const;
  /// Other pixels, or other bytes, for a frame.
  void set(std::size_t frame, const cv::Mat &image);
  void setBytes(std::size_t frame, std::string bytes);
  /// Applies \p change to the frames [first, first + count).
  void change(std::size_t first, std::size_t count, const std::function<cv::Mat(const cv::Mat &, std::size_t)> &change);
  /// Shows at each of [first, first + count) the image of another frame.
  void reorder(std::size_t first, std::size_t count, const std::function<std::size_t(std::size_t)> &frame_of);
  /// Another text in the place of a file of the folder; with no text it is not there.
  void replace(const std::string &file, std::string text) { m_files[file] = std::move(text); }
  void remove(const std::string &file) { m_removed.push_back(file); }
  /// The text that a file would be written with.
  std::string text(const std::string &file) const;
  /// Called with the copy when it stands, for what is no file.
  std::function<void(const std::filesystem::path &copy)> afterwards;

  void write(const std::filesystem::path &copy) const;

  Table camera, odometry, imu;
  std::mt19937 random;

private:
  std::filesystem::path m_original;
  std::vector<std::string> m_names; ///< of the original images by frame
  std::map<std::string, std::string> m_files;
  std::vector<std::string> m_removed;
};
} // namespace bole::faults
