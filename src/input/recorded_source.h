// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// What folders, numbered images and video files have in common as sources.

#include "input/frame_builder.h"

#include <memory>
#include <string>

namespace bole
{
/// Answers for its camera and sensors; a source adds where its images come from.
class RecordedSource : public FrameSource
{
public:
  PinholeCamera camera() const override { return m_builder->camera(); }
  Pose bMc() const override { return m_builder->bMc(); }
  std::string name() const override { return m_name; }
  bool hasOdometry() const override { return !m_builder->recording().odometry.empty(); }
  bool hasGyro() const override { return !m_builder->recording().gyro.empty(); }
  bool isCameraKnown() const override { return m_note.empty(); } // the note tells of a guess
  std::string note() const override { return m_note; }

protected:
  std::string m_name, m_note;
  std::unique_ptr<FrameBuilder> m_builder; ///< set by the constructor of the source
};
} // namespace bole
