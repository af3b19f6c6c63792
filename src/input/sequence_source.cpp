// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/recorded_source.h"

#include "geometry/failure.h"
#include "input/yaml_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <filesystem>
#include <fmt/format.h>
#include <map>
#include <numeric>
#include <optional>
#include <regex>

namespace bole
{
namespace fs = std::filesystem;
namespace
{
/// The one `%d` or `%0Nd` of a pattern.
std::smatch placeholderOf(const std::string &name)
{
  static const std::regex kPlaceholder("%(0[0-9]{1,2})?d");
  std::smatch match;
  if (!std::regex_search(name, match, kPlaceholder) || std::count(name.begin(), name.end(), '%') != 1)
    throw badValue("{}: must have one number such as %04d in its name", name);
  return match;
}

std::string imagePath(const std::string &pattern, long number)
{
  const std::string name = fs::path(pattern).filename().string();
  const std::smatch match = placeholderOf(name);
  const std::string digits = match[1].matched ? match[1].str().substr(1) : "0";
  const std::string padded = fmt::format("{:0{}d}", number, std::stoi("0" + digits));
  return (fs::path(pattern).parent_path() / (match.prefix().str() + padded + match.suffix().str())).string();
}

/// The number in the place of \p placeholder in \p name, -1 where there is none.
long numberOf(const std::string &name, const std::smatch &placeholder)
{
  const auto before = static_cast<std::size_t>(placeholder.prefix().length());
  const auto behind = static_cast<std::size_t>(placeholder.suffix().length());
  long number = -1;
  if (name.size() > before + behind)
    std::from_chars(name.data() + before, name.data() + name.size() - behind, number);
  return number;
}

/// Throws where so many numbers in a row have no image that two flights stand in one folder, or a name means no number.
void requireNoHole(const std::vector<long> &sorted, const std::string &pattern)
{
  constexpr long kLargest = 10000; // images: minutes of a flight
  for (std::size_t i = 1; i < sorted.size(); ++i)
    if (sorted[i] - sorted[i - 1] > kLargest)
      throw badValue("{}: no image from number {} to {}, must be at most {} in a row", pattern, sorted[i - 1] + 1,
                     sorted[i] - 1, kLargest);
}

/// Of all images, rising.
std::vector<long> numbersOf(const std::string &pattern)
{
  const fs::path folder = fs::path(pattern).parent_path().empty() ? "." : fs::path(pattern).parent_path();
  const std::string name = fs::path(pattern).filename().string();
  const std::smatch placeholder = placeholderOf(name);
  if (!fs::is_directory(folder))
    throw ioError("{}: no such folder", folder.string());
  std::vector<long> all;
  for (const auto &entry : fs::directory_iterator(folder)) {
    const long number = numberOf(entry.path().filename().string(), placeholder);
    if (number < 0 || fs::path(imagePath(pattern, number)).filename() != entry.path().filename())
      continue;
    all.push_back(number);
  }
  if (all.empty())
    throw ioError("{}: no such image", pattern);
  std::sort(all.begin(), all.end());
  requireNoHole(all, pattern);
  return all;
}

/// How far apart the numbers are, which is 1 but where somebody took every fifth picture of a video.
long stepOf(const std::vector<long> &numbers)
{
  constexpr std::size_t kFewest = 4; // that cannot be so by chance
  long step = 0;
  for (const long number : numbers)
    step = std::gcd(step, number - numbers.front());
  return numbers.size() < kFewest ? 1 : step;
}
} // namespace

bool SequenceSource::isImage(const std::string &path)
{
  std::string extension = fs::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  static const std::vector<std::string> kExtensions = {".png", ".jpg", ".jpeg", ".pgm", ".ppm",
                                                       ".pnm", ".bmp", ".tif",  ".tiff"};
  return std::find(kExtensions.begin(), kExtensions.end(), extension) != kExtensions.end();
}

SequenceSource::SequenceSource(const std::string &pattern, const SourceOptions &options)
{
  requireUsed(options, pattern, kNumberedImages);
  m_name = fs::is_directory(pattern) ? patternOf(pattern) : pattern;
  if (m_name.empty())
    throw ioError("{}: no numbered images in it", pattern);
  const std::vector<long> numbers = numbersOf(m_name);
  const long first_number = numbers.front(), step = stepOf(numbers);
  if (step > 1 && !options.frame_rate_hz)
    throw badValue(
        "{}: the numbers go in steps of {}: frame_rate_hz (--rate) must tell how many of them pass in a second", m_name,
        step);
  constexpr double kUsual_hz = 25;
  const std::optional<double> told_hz =
      options.frame_rate_hz ? options.frame_rate_hz : readFrameRate(options.camera_path);
  const double rate_hz = told_hz.value_or(kUsual_hz);
  if (!told_hz)
    m_rate_note = fmt::format("numbered images without a rate: {:g} frames a second assumed, by which all times are "
                              "counted; frame_rate_hz (--rate) tells another",
                              kUsual_hz);
  for (long number = first_number; number <= numbers.back(); number += step)
    m_rows.push_back(
        {std::llround(static_cast<double>(number - first_number) * 1e9 / rate_hz), imagePath(m_name, number)});
  ImageFile first;
  if (firstReadable(m_rows, first) == nullptr)
    throw ioError("{}: none of the images can be read; {}", m_name, first.message);
  const MountedCamera camera =
      cameraFor(options, static_cast<int>(first.image.getWidth()), static_cast<int>(first.image.getHeight()), m_note);
  Recording recording;
  recording.odometry = readOdometry(options);
  requireOverlap(recording.odometry, 0, m_rows.back().stamp_ns, options.odometry_path, m_name);
  m_builder = std::make_unique<FrameBuilder>(camera, options, std::move(recording));
}

std::string SequenceSource::note() const
{
  return m_note + (m_note.empty() || m_rate_note.empty() ? "" : "; ") + m_rate_note;
}

std::string SequenceSource::patternOf(const std::string &folder)
{
  if (!fs::is_directory(folder))
    return {};
  static const std::regex kNumbered("^([^0-9]*(?:[0-9]+[^0-9]+)*?)([0-9]+)(\\.[A-Za-z]+)$");
  std::map<std::string, int> counts; // of the images of each pattern
  for (const auto &entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    std::smatch match;
    if (!isImage(name) || name.find('%') != std::string::npos || !std::regex_match(name, match, kNumbered))
      continue;
    const std::string digits = match[2].str();
    const bool is_padded = digits.size() > 1 && digits.front() == '0';
    ++counts[match[1].str() + (is_padded ? fmt::format("%0{}d", digits.size()) : "%d") + match[3].str()];
  }
  // image0099.png counts for %04d, image1000.png for %d: the padded pattern knows both.
  std::string best;
  for (const auto &[pattern, count] : counts) {
    const bool is_padded = pattern.find("%d") == std::string::npos;
    const bool best_is_padded = !best.empty() && best.find("%d") == std::string::npos;
    if (best.empty() || is_padded > best_is_padded || (is_padded == best_is_padded && count > counts[best]))
      best = pattern;
  }
  return best.empty() ? best : (fs::path(folder) / best).string();
}
} // namespace bole
