// SPDX-License-Identifier: GPL-2.0-or-later
#include "ardrone/drone_link.h"
#include "geometry/failure.h"
#include "geometry/parse_number.h"
#include "input/user_text.h"

#include <fmt/format.h>

namespace bole
{
namespace
{
const std::string kScheme = "ardrone://";

double readNumber(const std::string &address, const std::string &key, const std::string &value, double low, double high)
{
  const auto number = parseNumber<double>(value);
  if (!number || !(*number >= low && *number <= high))
    throw badValue("{}: {} = {}, must be a number from {} to {}", address, key, value, low, high);
  return *number;
}
} // namespace

bool ArDroneAddress::accepts(const std::string &text) { return text.rfind(kScheme, 0) == 0; }

ArDroneAddress ArDroneAddress::parse(const std::string &address)
{
  if (!accepts(address))
    throw badValue("address = {}, must be ardrone://HOST[?key=value&...]", address);
  if (const std::string shown = withoutSecrets(address); shown != address)
    throw badValue("{}: must be without name, password or key", shown);
  ArDroneAddress out;
  const std::size_t question = address.find('?');
  std::string host =
      address.substr(kScheme.size(), question == std::string::npos ? std::string::npos : question - kScheme.size());
  while (!host.empty() && host.back() == '/')
    host.pop_back();
  if (host.find(':') != std::string::npos)
    throw badValue("{}: host = {}, must be without a port; give ?offset=N, or ?navdata=N&video=N&at=N", address, host);
  if (!host.empty())
    out.host = host;

  int offset = 0;
  std::string rest = question == std::string::npos ? "" : address.substr(question + 1);
  while (!rest.empty()) {
    const std::size_t ampersand = rest.find('&');
    const std::string pair = rest.substr(0, ampersand);
    rest = ampersand == std::string::npos ? "" : rest.substr(ampersand + 1);
    const std::size_t equals = pair.find('=');
    const std::string key = pair.substr(0, equals);
    const std::string value = equals == std::string::npos ? "" : pair.substr(equals + 1);
    const auto port = [&] { return static_cast<std::uint16_t>(readNumber(address, key, value, 1, 65535)); };
    if (key == "offset")
      offset = static_cast<int>(readNumber(address, key, value, 0, 59000));
    else if (key == "navdata")
      out.navdata_port = port();
    else if (key == "video")
      out.video_port = port();
    else if (key == "at")
      out.at_port = port();
    else if (key == "generation")
      out.generation = value == "auto" ? 0 : static_cast<int>(readNumber(address, key, value, 1, 2));
    else if (key == "camera")
      out.camera_path = value;
    else if (key == "video_delay_ms")
      out.video_delay_s = readNumber(address, key, value, 0, 500) / 1000;
    else
      throw badValue("{}: key = {}, must be one of offset, navdata, video, at, generation, camera, video_delay_ms",
                     address, key);
  }
  for (std::uint16_t *p : {&out.navdata_port, &out.video_port, &out.at_port}) {
    if (*p + offset > 65535)
      throw badValue("{}: offset = {}, must keep every port below 65536", address, offset);
    *p = static_cast<std::uint16_t>(*p + offset);
  }
  return out;
}

std::string ArDroneAddress::toString() const
{
  std::string text = fmt::format("{}{}?navdata={}&video={}&at={}", kScheme, host, navdata_port, video_port, at_port);
  if (generation != 0)
    text += fmt::format("&generation={}", generation);
  if (!camera_path.empty())
    text += "&camera=" + camera_path;
  text += fmt::format("&video_delay_ms={:g}", video_delay_s * 1000);
  return text;
}
} // namespace bole
