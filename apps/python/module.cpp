// SPDX-License-Identifier: GPL-2.0-or-later
// The Python module: frames, reports, trunks and trajectories as numpy arrays. What users import is apps/python/bole,
// which adds the reading of a run's folder.
#include <bole/config.h>
#include <bole/open_source.h>
#include <bole/pipeline.h>

#include <Eigen/Geometry>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>

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

Pose poseOf(const Eigen::Matrix4d &matrix)
{
  const Eigen::Matrix3d R = matrix.topLeftCorner<3, 3>();
  if (!matrix.allFinite() || (R * R.transpose() - Eigen::Matrix3d::Identity()).norm() > 1e-6 || R.determinant() < 0)
    throw py::value_error("a pose must be a 4x4 matrix of a rotation and a translation");
  return Pose(R, matrix.topRightCorner<3, 1>());
}

py::array_t<unsigned char> imageOf(const Frame &frame)
{
  return py::array_t<unsigned char>({frame.image.getHeight(), frame.image.getWidth()}, frame.image.bitmap);
}

/// \p gyro: rows of stamp [s] and angular rate [rad/s].
Frame frameOf(const py::array_t<unsigned char, py::array::c_style | py::array::forcecast> &image, double stamp_s,
              const std::optional<Eigen::Matrix4d> &odometry, const std::optional<Eigen::MatrixXd> &gyro)
{
  if (image.ndim() != 2)
    throw py::value_error("an image must be a grey one: an array of two dimensions");
  Frame frame;
  frame.stamp_ns = std::llround(1e9 * stamp_s);
  frame.image.resize(static_cast<unsigned>(image.shape(0)), static_cast<unsigned>(image.shape(1)));
  std::copy(image.data(), image.data() + image.size(), frame.image.bitmap);
  if (odometry)
    frame.wMb_odometry = poseOf(*odometry);
  if (gyro && gyro->cols() != 4)
    throw py::value_error("gyro must have rows of stamp [s], x, y, z [rad/s]");
  for (Eigen::Index i = 0; gyro && i < gyro->rows(); ++i)
    frame.gyro.push_back({std::llround(1e9 * (*gyro)(i, 0)), gyro->row(i).tail<3>().transpose(), {}});
  return frame;
}

/// {"section.key": value} as the command line's --set would have it.
Options optionsOf(const py::dict &values)
{
  std::vector<std::string> assignments;
  for (const auto &[key, value] : values) {
    const std::string text =
        py::isinstance<py::bool_>(value) ? (value.cast<bool>() ? "true" : "false") : py::str(value).cast<std::string>();
    assignments.push_back(py::str(key).cast<std::string>() + "=" + text);
  }
  Options options;
  setOptions(assignments, options);
  return options;
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
  py::register_local_exception_translator([](std::exception_ptr raised) {
    try {
      if (raised)
        std::rethrow_exception(raised);
    }
    catch (const vpException &error) {
      PyErr_SetString(PyExc_ValueError, error.getStringMessage().c_str());
    }
  });

  py::class_<Frame>(module, "Frame", "One picture with all that the sensors said about its time.")
      .def(py::init(&frameOf), py::arg("image"), py::arg("stamp"), py::arg("odometry") = py::none(),
           py::arg("gyro") = py::none(),
           "image: grey uint8 [height x width], rectified; stamp [s]; odometry: 4x4 pose of the body in the world; "
           "gyro: rows "
           "of stamp [s] and angular rate [rad/s], since the frame before")
      .def_property_readonly("image", &imageOf, "grey, uint8, [height x width], rectified")
      .def_property_readonly(
          "stamp", [](const Frame &f) { return 1e-9 * static_cast<double>(f.stamp_ns); }, "[s]")
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
              rows.row(i) << 1e-9 * static_cast<double>(f.gyro[i].stamp_ns), f.gyro[i].rate.transpose();
            return rows;
          },
          "rows of stamp [s] and angular rate [rad/s]");

  py::class_<FrameSource>(module, "Source", "A stream of frames: iterate over it.")
      .def("__iter__", [](py::object self) { return self; })
      .def("__next__",
           [](FrameSource &source) {
             Frame frame;
             py::gil_scoped_release release;
             if (!source.next(frame))
               throw py::stop_iteration();
             return frame;
           })
      .def("__len__", &FrameSource::size)
      .def_property_readonly("name", &FrameSource::name)
      .def_property_readonly("note", &FrameSource::note, "what is assumed about the input")
      .def_property_readonly(
          "camera",
          [](const FrameSource &s) {
            const PinholeCamera c = s.camera();
            return py::make_tuple(c.fx, c.fy, c.cx, c.cy, c.width, c.height);
          },
          "fx, fy, cx, cy [px], width, height")
      .def_property_readonly(
          "mount", [](const FrameSource &s) { return matrixOf(s.bMc()); }, "4x4: the camera in the body");

  module.def(
      "open",
      [](const std::string &input, const std::string &camera, const std::string &odometry,
         const std::optional<double> &rate, double field_of_view, int max_width) {
        SourceOptions options;
        options.camera_path = camera;
        options.odometry_path = odometry;
        options.frame_rate_hz = rate;
        options.field_of_view_deg = field_of_view;
        options.max_width_px = max_width;
        return openSource(input, options);
      },
      py::arg("input"), py::arg("camera") = "", py::arg("odometry") = "", py::arg("rate") = py::none(),
      py::arg("field_of_view") = SourceOptions().field_of_view_deg, py::arg("max_width") = SourceOptions().max_width_px,
      "Opens an ASL folder, a video or numbered images. rate [Hz] is that of numbered images (None: the camera file's "
      "rate_hz, else 25), field_of_view [degrees] is assumed where no camera is known.");

  py::class_<FrameReport>(module, "Report", "All that is known right after a frame.")
      .def_readonly("index", &FrameReport::index)
      .def_property_readonly(
          "stamp", [](const FrameReport &r) { return 1e-9 * static_cast<double>(r.stamp_ns); }, "[s]")
      .def_property_readonly("status", [](const FrameReport &r) { return toString(r.frame_status); })
      .def_readonly("reason", &FrameReport::reason)
      .def_property_readonly(
          "pose", [](const FrameReport &r) { return matrixOf(r.wMb); }, "4x4: the body in the world")
      .def_property_readonly(
          "camera_pose", [](const FrameReport &r) { return matrixOf(r.wMc); }, "4x4")
      .def_readonly("pose_covariance", &FrameReport::pose_covariance, "of translation [m], then rotation [rad]")
      .def_property_readonly("trunks", &trunksInView, "the trunks that were looked for, a dict each");

  py::class_<Pipeline>(module, "Pipeline", "From frames to a map of trunks and a trajectory.")
      .def(py::init([](const FrameSource &source, const py::dict &options) {
             return Pipeline(source.camera(), source.bMc(), optionsOf(options));
           }),
           py::arg("source"), py::arg("options") = py::dict(),
           "options: {'section.key': value}, as `bole options` lists them")
      .def(py::init([](const std::array<double, 4> &camera, const std::array<int, 2> &size, const py::dict &options) {
             PinholeCamera pinhole;
             pinhole.fx = camera[0], pinhole.fy = camera[1], pinhole.cx = camera[2], pinhole.cy = camera[3];
             pinhole.width = size[0], pinhole.height = size[1];
             return Pipeline(pinhole, forwardCamera(), optionsOf(options));
           }),
           py::arg("camera"), py::arg("size"), py::arg("options") = py::dict(),
           "camera: fx, fy, cx, cy [px]; size: width, height [px]; for frames of one's own")
      .def("process", &Pipeline::process, py::arg("frame"), py::call_guard<py::gil_scoped_release>(),
           "Takes in a frame.")
      .def("finish", &Pipeline::finish, py::call_guard<py::gil_scoped_release>(), "Smooths the whole flight once more.")
      .def(
          "trunks", [](const Pipeline &p) { return trunkColumns(p, true); }, "The map: a column of each number.")
      .def(
          "hypotheses", [](const Pipeline &p) { return trunkColumns(p, false); }, "What is not confirmed.")
      .def(
          "trajectory", [](const Pipeline &p) { return rowsOf(p.smoothedTrajectory()); },
          "Rows of stamp [s], x, y, z [m], quaternion x, y, z, w.");

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
