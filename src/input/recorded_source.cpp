// SPDX-License-Identifier: GPL-2.0-or-later
#include "input/recorded_source.h"

#include <filesystem>

namespace bole
{
const ImageRow *firstReadable(const std::vector<ImageRow> &rows, ImageFile &file)
{
  std::string fault;
  for (const ImageRow &row : rows) {
    file = readImageFile(row.path);
    if (file.status == FrameStatus::ok)
      return &row;
    fault = fault.empty() ? file.message : fault;
  }
  file.message = fault;
  return nullptr;
}

std::string ImageFilesSource::pictureName(std::size_t index) const
{
  return index < m_rows.size() ? std::filesystem::path(m_rows[index].path).filename().string() : std::string();
}

bool ImageFilesSource::next(Frame &frame)
{
  if (m_at >= m_rows.size())
    return false;
  const ImageRow &row = m_rows[m_at++];
  m_builder->build(row.stamp_ns, readImageFile(row.path, m_builder->inputWidth(), m_builder->inputHeight()), frame);
  return true;
}
} // namespace bole
