// SPDX-License-Identifier: GPL-2.0-or-later
// The Python module: frames, reports, trunks and trajectories as numpy arrays. What users import is apps/python/bole,
// which adds the reading of a run's folder; its __init__.pyi tells the types.
#include "input/frame_check.h"
#include "input/live_video.h"
#include "pipeline/measured_camera.h"
#include <bole/config.h>
#include <bole/pipeline.h>

#include <Eigen/Geometry>
#include <cstring>
#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

namespace py = pybind11;

namespace
{
using namespace bole;

Eigen::Matrix4d matrixOf(const Pose &pose)
{
  Eigen::Matrix4d matrix = Eigen::Matrix4d::Identity();
  matrix.topLeftCorner<3, 3>() = pose.R;
  matrix.topRightCorner<3, 1>() = pose.t;
  return matrix;
}

std::string text(const py::handle &object) { return py::str(object).cast<std::string>(); }

/// \p given: numbers in rows of \p columns.
Eigen::MatrixXd rowsFrom(const py::object &given, const char *name, py::ssize_t columns)
{
  const py::array array = py::array::ensure(given);
  if (!array || std::string("fiu").find(array.dtype().kind()) == std::string::npos)
    throw py::type_error(fmt::format("{} must be an array of real numbers, not {}", name,
                                     array ? text(array.dtype()) : text(py::type::of(given))));
  if (array.ndim() != 2 || array.shape(1) != columns)
    throw py::value_error(
        fmt::format("{} has the shape {}, must have rows of {} numbers", name, text(array.attr("shape")), columns));
  return array.cast<Eigen::MatrixXd>();
}

Pose poseFrom(const py::object &given, const char *name)
{
  const Eigen::MatrixXd matrix = rowsFrom(given, name, 4);
  if (matrix.rows() != 4 || matrix.row(3) != Eigen::RowVector4d(0, 0, 0, 1))
    throw py::value_error(fmt::format("{} must be a 4x4 matrix whose last row is 0, 0, 0, 1", name));
  return Pose(matrix.topLeftCorner<3, 3>(), matrix.topRightCorner<3, 1>());
}

/// Nothing is converted: 16 bits, or a float from 0 to 1, would become another picture.
vpImage<unsigned char> imageFrom(const py::object &given)
{
  if (!py::isinstance<py::array>(given))
    throw py::type_error(fmt::format("image must be a numpy array of uint8, not {}", text(py::type::of(given))));
  const auto array = py::reinterpret_borrow<py::array>(given);
  if (array.dtype().kind() != 'u' || array.itemsize() != 1)
    throw py::type_error(
        fmt::format("image has the dtype {}, must be uint8: grey levels from 0 to 255", text(array.dtype())));
  if (array.ndim() != 2)
    throw py::value_error(
        fmt::format("image has the shape {}, must be (height, width): a grey one", text(array.attr("shape"))));
  const auto rows = py::array_t<unsigned char, py::array::c_style>::ensure(array);
  vpImage<unsigned char> image(static_cast<unsigned>(rows.shape(0)), static_cast<unsigned>(rows.shape(1)));
  std::copy(rows.data(), rows.data() + rows.size(), image.bitmap);
  return image;
}

py::array_t<unsigned char> imageOf(const Frame &frame)
{
  return py::array_t<unsigned char>({frame.image.getHeight(), frame.image.getWidth()}, frame.image.bitmap);
}

/// \p gyro: rows of stamp [s] and angular rate [rad/s].
Frame frameOf(const py::object &image, double stamp_s, const py::object &odometry, const py::object &gyro)
{
  Frame frame;
  frame.image = imageFrom(image);
  frame.stamp_ns = stampOf(stamp_s, "stamp");
  if (!odometry.is_none())
    frame.wMb_odometry = poseFrom(odometry, "odometry");
  if (!gyro.is_none()) {
    const Eigen::MatrixXd rows = rowsFrom(gyro, "gyro", 4);
    for (Eigen::Index i = 0; i < rows.rows(); ++i)
      frame.gyro.push_back({stampOf(rows(i, 0), fmt::format("gyro[{}, 0]", i)), rows.row(i).tail<3>().transpose(), {}});
  }
  requireSound(frame);
  return frame;
}

/// {"section.key": value}
Options optionsOf(const py::dict &values, Options options = {})
{
  std::vector<std::string> assignments;
  for (const auto &[key, value] : values)
    assignments.push_back(text(key) + "=" +
                          (py::isinstance<py::bool_>(value) ? value.cast<bool>() ? "true" : "false" : text(value)));
  setOptions(assignments, options, "options: ");
  return options;
}

/// A stream of frames, from its beginning for whoever iterates over it; one that is live goes on where it is.
class Input
{
public:
  Input(const std::filesystem::path &input, const SourceOptions &options)
      : m_input(input.string()), m_opened(openMeasured(m_input, options, kGiveUp_s)), m_next(std::move(m_opened.source))
  {
    m_first = m_next;
  }

  const FrameSource &source() const { return *m_first; }
  const std::string &note() const { return m_opened.note; }
  Options options() const
  {
    Options options;
    options.camera.compressed = source().isCompressed();
    return options;
  }
  double focalSigma() const
  {
    return bole::focalSigma(source(), m_opened.is_camera_known, m_opened.field_of_view_sigma_deg);
  }
  /// The frames from the first on.
  std::shared_ptr<FrameSource> begin()
  {
    if (dynamic_cast<LiveVideoSource *>(m_first.get()) != nullptr)
      return m_first;
    return m_next ? std::move(m_next) : std::shared_ptr<FrameSource>(openSource(m_input, m_opened.options));
  }

private:
  static constexpr double kGiveUp_s = 10;

  std::string m_input;
  MeasuredSource m_opened;
  std::shared_ptr<FrameSource> m_first, m_next; ///< \p m_next: opened, and nothing read
};

/// One pass over an input.
struct Pass
{
  std::shared_ptr<FrameSource> source;
};

Frame nextOf(Pass &pass)
{
  Frame frame;
  const py::gil_scoped_release release;
  if (!pass.source->next(frame))
    throw py::stop_iteration();
  return frame;
}

/// As the command maps it.
Pipeline pipelineFor(const Input &input, const py::dict &values)
{
  Options options = optionsOf(values, input.options());
  if (options.camera.focal_sigma == 0)
    options.camera.focal_sigma = input.focalSigma();
  return Pipeline(input.source().camera(), input.source().bMc(), options);
}

Pipeline pipelineOf(const std::array<double, 4> &camera, const std::array<int, 2> &size, const py::dict &options)
{
  return Pipeline({camera[0], camera[1], camera[2], camera[3], size[0], size[1]}, forwardCamera(), optionsOf(options));
}

/// A mistake in the words of this module.
std::string inPython(std::string message)
{
  const std::pair<const char *, const char *> kWords[] = {{"frame_rate_hz (--rate)", "rate"},
                                                          {"field_of_view_deg (--field-of-view)", "field_of_view"},
                                                          {"odometry_offset_s (--odometry-offset)", "odometry_offset"},
                                                          {"frame_rate_hz", "rate"},
                                                          {"field_of_view_deg", "field_of_view"},
                                                          {"max_width_px", "max_width"},
                                                          {"odometry_offset_s, --odometry-offset,", "odometry_offset"},
                                                          {"odometry_offset_s", "odometry_offset"}};
  for (const auto &[there, here] : kWords)
    if (const auto at = message.find(there); at != std::string::npos)
      message.replace(at, std::strlen(there), here);
  return message;
}

template <class Value, class Get> py::array_t<Value> column(const std::vector<TrunkRecord> &trunks, Get get)
{
  py::array_t<Value> values(static_cast<py::ssize_t>(trunks.size()));
  for (std::size_t i = 0; i < trunks.size(); ++i)
    values.mutable_at(i) = get(trunks[i]);
  return values;
}

/// A column of each number, under the names of trunks.csv; the covariances [n x 5 x 5] beside them.
py::dict trunkColumns(const Pipeline &pipeline, bool confirmed)
{
  std::vector<TrunkRecord> trunks;
  for (const TrunkRecord &trunk : pipeline.map()) {
    if ((trunk.status == TrunkStatus::confirmed) == confirmed)
      trunks.push_back(trunk);
  }
  py::array_t<double> covariance(std::vector<py::ssize_t>{static_cast<py::ssize_t>(trunks.size()), 5, 5});
  for (std::size_t i = 0; i < trunks.size(); ++i) {
    for (int j = 0; j < 25; ++j)
      covariance.mutable_at(i, j / 5, j % 5) = trunks[i].covariance(j / 5, j % 5);
  }
  py::list status;
  for (const TrunkRecord &trunk : trunks)
    status.append(toString(trunk.status));
  using T = const TrunkRecord &;
  py::dict columns;
  columns["id"] = column<int>(trunks, [](T t) { return t.id; });
  columns["status"] = status;
  columns["x"] = column<double>(trunks, [](T t) { return t.xy.x(); });
  columns["y"] = column<double>(trunks, [](T t) { return t.xy.y(); });
  columns["radius"] = column<double>(trunks, [](T t) { return t.radius; });
  columns["lean_x"] = column<double>(trunks, [](T t) { return t.lean.x(); });
  columns["lean_y"] = column<double>(trunks, [](T t) { return t.lean.y(); });
  columns["ground_z"] = column<double>(trunks, [](T t) { return t.ground_z; });
  columns["probability"] = column<double>(trunks, [](T t) { return t.probability; });
  columns["first_seen"] = column<double>(trunks, [](T t) { return t.first_seen_s; });
  columns["last_seen"] = column<double>(trunks, [](T t) { return t.last_seen_s; });
  columns["views"] = column<int>(trunks, [](T t) { return t.observations; });
  columns["covariance"] = covariance;
  return columns;
}

/// Rows of stamp [s], x, y, z [m], quaternion x, y, z, w, as in a TUM file.
Eigen::MatrixXd rowsOf(const Trajectory &trajectory)
{
  Eigen::MatrixXd rows(trajectory.size(), 8);
  for (std::size_t i = 0; i < trajectory.size(); ++i) {
    const Eigen::Quaterniond q(trajectory[i].wMb.R);
    rows.row(i) << 1e-9 * static_cast<double>(trajectory[i].stamp_ns), trajectory[i].wMb.t.transpose(), q.x(), q.y(),
        q.z(), q.w();
  }
  return rows;
}

py::list verdictsOf(const FrameReport &report)
{
  py::list verdicts;
  for (const SensorVerdict &verdict : report.verdicts)
    verdicts.append(py::dict(py::arg("sensor") = verdict.sensor, py::arg("kind") = verdict.kind,
                             py::arg("since") = verdict.since_s, py::arg("text") = verdict.text));
  return verdicts;
}

py::list trunksInView(const FrameReport &report)
{
  py::list trunks;
  for (const TrunkInView &trunk : report.trunks)
    trunks.append(py::dict(py::arg("id") = trunk.id, py::arg("status") = toString(trunk.status),
                           py::arg("is_tracked") = trunk.is_tracked, py::arg("outcome") = trunk.outcome,
                           py::arg("ratio") = trunk.relative.ratio(), py::arg("distance") = trunk.distance));
  return trunks;
}
} // namespace

PYBIND11_MODULE(_bole, module)
{
  module.attr("__version__") = BOLE_VERSION;
  py::register_local_exception_translator([](std::exception_ptr raised) {
    try {
      if (raised)
        std::rethrow_exception(raised);
    }
    catch (const vpException &error) {
      PyErr_SetString(PyExc_ValueError, inPython(error.getStringMessage()).c_str());
    }
  });

  py::class_<Frame>(module, "Frame", "One picture with all that the sensors said about its time.")
      .def(py::init(&frameOf), py::arg("image"), py::arg("stamp"), py::arg("odometry") = py::none(),
           py::arg("gyro") = py::none(),
           "image: grey uint8 [height x width], rectified; stamp [s]; odometry: 4x4 pose of the body in the world; "
           "gyro: rows of stamp [s] and angular rate [rad/s], since the frame before")
      .def_property_readonly("image", &imageOf, "grey, uint8, [height x width], rectified")
      .def_property_readonly(
          "stamp", [](const Frame &f) { return secondsOfStamp(f.stamp_ns); }, "[s]")
      .def_property_readonly("status", [](const Frame &f) { return toString(f.status); })
      .def_readonly("message", &Frame::message, "why the status is not ok")
      .def_property_readonly(
          "odometry", [](const Frame &f) { return f.wMb_odometry ? py::cast(matrixOf(*f.wMb_odometry)) : py::none(); },
          "4x4 pose of the body in the world, or None")
      .def_property_readonly(
          "gyro",
          [](const Frame &f) {
            Eigen::MatrixXd rows(f.gyro.size(), 4);
            for (std::size_t i = 0; i < f.gyro.size(); ++i)
              rows.row(i) << secondsOfStamp(f.gyro[i].stamp_ns), f.gyro[i].rate.transpose();
            return rows;
          },
          "rows of stamp [s] and angular rate [rad/s]")
      .def("__repr__", [](const Frame &f) {
        return fmt::format("<bole.Frame at {} s: {}x{} px, {}>", secondsOfStamp(f.stamp_ns), f.image.getWidth(),
                           f.image.getHeight(), toString(f.status));
      });

  py::class_<Pass>(module, "_Pass", "One pass over a Source.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__", &nextOf);

  py::class_<Input>(module, "Source", "A stream of frames: iterate over it, each time from the first frame on.")
      .def("__iter__", [](Input &input) { return Pass{input.begin()}; })
      .def("__len__", [](const Input &input) { return input.source().size(); })
      .def_property_readonly("name", [](const Input &input) { return input.source().name(); })
      .def_property_readonly("note", &Input::note, "what is assumed about the input")
      .def_property_readonly(
          "camera",
          [](const Input &input) {
            const PinholeCamera c = input.source().camera();
            return py::make_tuple(c.fx, c.fy, c.cx, c.cy, c.width, c.height);
          },
          "fx, fy, cx, cy [px], width, height")
      .def_property_readonly(
          "mount", [](const Input &input) { return matrixOf(input.source().bMc()); }, "4x4: the camera in the body")
      .def("__repr__", [](const Input &input) {
        const PinholeCamera c = input.source().camera();
        return fmt::format("<bole.Source {}: {} frames of {}x{} px>", input.source().name(), input.source().size(),
                           c.width, c.height);
      });

  module.def(
      "open",
      [](const std::filesystem::path &input, const std::filesystem::path &camera, const std::filesystem::path &odometry,
         double odometry_offset, const std::optional<double> &rate, const std::optional<double> &field_of_view,
         int max_width) {
        SourceOptions options;
        options.camera_path = camera.string();
        options.odometry_path = odometry.string();
        options.odometry_offset_s = odometry_offset;
        options.frame_rate_hz = rate;
        options.field_of_view_deg = field_of_view;
        options.max_width_px = max_width;
        const py::gil_scoped_release release;
        return std::make_unique<Input>(input, options);
      },
      py::arg("input"), py::arg("camera") = "", py::arg("odometry") = "", py::arg("odometry_offset") = 0.0,
      py::arg("rate") = py::none(), py::arg("field_of_view") = py::none(),
      py::arg("max_width") = SourceOptions().max_width_px,
      "Opens an ASL folder, a video, numbered images or an address. odometry_offset [s] is added to the stamps of the "
      "file odometry; rate [Hz] is that of numbered images (None: the camera file's rate_hz, else 25); field_of_view "
      "[degrees] is the horizontal one where no camera is known (None: as the first frames tell it, else 65).");

  py::class_<FrameReport>(module, "Report", "All that is known right after a frame.")
      .def_readonly("index", &FrameReport::index)
      .def_property_readonly(
          "stamp", [](const FrameReport &r) { return secondsOfStamp(r.stamp_ns); }, "[s]")
      .def_property_readonly("status", [](const FrameReport &r) { return toString(r.frame_status); })
      .def_readonly("reason", &FrameReport::reason)
      .def_property_readonly(
          "pose", [](const FrameReport &r) { return matrixOf(r.wMb); }, "4x4: the body in the world")
      .def_property_readonly(
          "camera_pose", [](const FrameReport &r) { return matrixOf(r.wMc); }, "4x4")
      .def_readonly("pose_covariance", &FrameReport::pose_covariance, "of translation [m], then rotation [rad]")
      .def_property_readonly("trunks", &trunksInView, "the trunks that were looked for, a dict each")
      .def_property_readonly("verdicts", &verdictsOf,
                             "sensors that contradicted the others so far, a dict each: sensor, kind, since [s], text")
      .def("__repr__", [](const FrameReport &r) {
        return fmt::format("<bole.Report of frame {} at {} s: {}, {} trunks in view>", r.index,
                           secondsOfStamp(r.stamp_ns), toString(r.frame_status), r.trunks.size());
      });

  py::class_<Pipeline>(module, "Pipeline", "From frames to a map of trunks and a trajectory.")
      .def(py::init(&pipelineFor), py::arg("source"), py::arg("options") = py::dict(),
           "options: {'section.key': value}, as bole.options() lists them")
      .def(py::init(&pipelineOf), py::arg("camera"), py::arg("size"), py::arg("options") = py::dict(),
           "camera: fx, fy, cx, cy [px]; size: width, height [px]; for frames of one's own")
      .def("process", &Pipeline::process, py::arg("frame"), py::call_guard<py::gil_scoped_release>(),
           "Takes in a frame. ValueError where it cannot follow the one before: nothing has changed then.")
      .def("finish", &Pipeline::finish, py::call_guard<py::gil_scoped_release>(), "Smooths the whole flight once more.")
      .def(
          "trunks", [](const Pipeline &p) { return trunkColumns(p, true); }, "The map: a column of each number.")
      .def(
          "hypotheses", [](const Pipeline &p) { return trunkColumns(p, false); }, "What is not confirmed.")
      .def(
          "trajectory", [](const Pipeline &p) { return rowsOf(p.smoothedTrajectory()); },
          "Rows of stamp [s], x, y, z [m], quaternion x, y, z, w.")
      .def("__repr__", [](const Pipeline &p) {
        return fmt::format("<bole.Pipeline after {} frames>", p.smoothedTrajectory().size());
      });

  module.def(
      "options",
      [] {
        py::list all;
        for (const OptionDescription &o : describeOptions())
          all.append(py::dict(py::arg("key") = o.key, py::arg("unit") = o.unit, py::arg("range") = o.range,
                              py::arg("default") = o.value, py::arg("effect") = o.effect));
        return all;
      },
      "Every option, a dict each.");
}
