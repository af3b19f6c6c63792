// SPDX-License-Identifier: GPL-2.0-or-later
#include "spoilt_flight.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <fstream>
#include <iterator>
#include <opencv2/imgcodecs.hpp>
#include <sstream>
#include <stdexcept>

namespace bole::faults
{
namespace fs = std::filesystem;
namespace
{
const char *const kCamera = "mav0/cam0/data.csv", *const kOdometry = "mav0/odom0/data.csv",
                  *const kImu = "mav0/imu0/data.csv";

std::string contentOf(const fs::path &path)
{
  std::ifstream file(path, std::ios::binary);
  if (!file)
    throw std::runtime_error(path.string() + ": cannot be read");
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

SpoiltFlight::Table readTable(const fs::path &path)
{
  SpoiltFlight::Table table;
  std::istringstream text(contentOf(path));
  std::getline(text, table.header);
  for (std::string line; std::getline(text, line);) {
    std::istringstream fields(line);
    table.rows.emplace_back();
    for (std::string field; std::getline(fields, field, ',');)
      table.rows.back().push_back(field);
  }
  return table;
}

std::string textOf(const SpoiltFlight::Table &table)
{
  std::string text = table.header + "\n";
  for (const SpoiltFlight::Row &row : table.rows)
    text += fmt::format("{}\n", fmt::join(row, ","));
  return text;
}
} // namespace

void SpoiltFlight::Table::set(std::size_t row, std::size_t column, double value)
{
  rows[row][column] = fmt::format("{:.9f}", value);
}

SpoiltFlight::SpoiltFlight(fs::path original, const std::string &name)
    : camera(readTable(original / kCamera)),
      odometry(readTable(original / kOdometry)),
      imu(readTable(original / kImu)),
      m_original(std::move(original))
{
  std::seed_seq seed(name.begin(), name.end());
  random.seed(seed);
  for (const Row &row : camera.rows)
    m_names.push_back(row[1]);
}

cv::Mat SpoiltFlight::image(std::size_t frame) const
{
  return cv::imread((m_original / "mav0/cam0/data" / m_names[frame]).string(), cv::IMREAD_GRAYSCALE);
}

std::string SpoiltFlight::bytesOf(std::size_t frame) const
{
  return contentOf(m_original / "mav0/cam0/data" / m_names[frame]);
}

void SpoiltFlight::setBytes(std::size_t frame, std::string bytes)
{
  m_files["mav0/cam0/data/" + m_names[frame]] = std::move(bytes);
}

void SpoiltFlight::set(std::size_t frame, const cv::Mat &image)
{
  cv::Mat grey;
  image.convertTo(grey, CV_8U);
  std::vector<unsigned char> bytes;
  cv::imencode(".png", grey, bytes, {cv::IMWRITE_PNG_COMPRESSION, 1});
  setBytes(frame, {bytes.begin(), bytes.end()});
}

void SpoiltFlight::change(std::size_t first, std::size_t count,
                          const std::function<cv::Mat(const cv::Mat &, std::size_t)> &change)
{
  for (std::size_t k = 0; k < count && first + k < frames(); ++k)
    set(first + k, change(image(first + k), k));
}

void SpoiltFlight::reorder(std::size_t first, std::size_t count,
                           const std::function<std::size_t(std::size_t)> &frame_of)
{
  for (std::size_t i = first; i < first + count && i < frames(); ++i)
    camera.rows[i][1] = m_names[frame_of(i)];
}

std::string SpoiltFlight::text(const std::string &file) const
{
  if (file == kCamera || file == kOdometry || file == kImu)
    return textOf(file == kCamera ? camera : file == kOdometry ? odometry : imu);
  return contentOf(m_original / file);
}

void SpoiltFlight::write(const fs::path &copy) const
{
  fs::remove_all(copy);
  fs::create_directories(copy);
  for (const auto &entry : fs::recursive_directory_iterator(m_original)) {
    const fs::path to = copy / fs::relative(entry.path(), m_original);
    if (entry.is_directory())
      fs::create_directories(to);
    else
      fs::create_symlink(fs::absolute(entry.path()), to);
  }
  const auto put = [&copy](const std::string &file, const std::string &text) {
    fs::remove(copy / file);
    std::ofstream(copy / file, std::ios::binary) << text;
  };
  for (const char *table : {kCamera, kOdometry, kImu})
    put(table, text(table));
  for (const auto &[file, text] : m_files)
    put(file, text);
  for (const std::string &file : m_removed)
    fs::remove(copy / file);
  if (afterwards)
    afterwards(copy);
}
} // namespace bole::faults
