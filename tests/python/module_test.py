#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""The module bole as a program uses it: what it takes, what it refuses, and in which words.

usage: module_test.py SOURCE_FOLDER"""
import ast
import os
import subprocess
import sys
import tempfile
import unittest

import bole
import numpy as np

SOURCES = os.path.abspath(sys.argv.pop(1))
FLIGHT = os.path.join(SOURCES, "data/park-forward")
CAMERA = (200, 200, 159.5, 119.5), (320, 240)
GREY = (np.arange(320 * 240).reshape(240, 320) * 7 % 256).astype(np.uint8)


class Images(unittest.TestCase):
    def test_grey_levels_are_taken_as_they_are_however_they_lie_in_memory(self):
        wide = np.repeat(np.repeat(GREY, 2, 0), 2, 1)
        for given in (GREY, np.asfortranarray(GREY), np.dstack([GREY] * 3)[:, :, 1], wide[::2, ::2]):
            np.testing.assert_array_equal(bole.Frame(given, 0.0).image, GREY)
        np.testing.assert_array_equal(bole.Frame(GREY[::-1, ::-1], 0.0).image, GREY[::-1, ::-1])

    def test_nothing_is_made_a_picture_by_conversion(self):
        for given in (GREY / 255.0, GREY.astype(np.float32), GREY.astype(np.uint16) * 257, GREY.astype(np.int64),
                      GREY.astype(np.int8), GREY > 128, GREY.astype(complex), GREY.astype(object), GREY.tolist(), None):
            with self.assertRaisesRegex(TypeError, "image .*uint8"):
                bole.Frame(given, 0.0)
        for given in (np.dstack([GREY] * 3), GREY[:, :, None], GREY[0]):
            with self.assertRaisesRegex(ValueError, r"image has the shape \(.*\), must be \(height, width\)"):
                bole.Frame(given, 0.0)


class Frames(unittest.TestCase):
    def test_a_stamp_is_a_time(self):
        for stamp in (float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 1e12):
            with self.assertRaisesRegex(ValueError, "stamp = .* s, must be"):
                bole.Frame(GREY, stamp)
        with self.assertRaises(TypeError):
            bole.Frame(GREY, "3")
        self.assertEqual(bole.Frame(GREY, 1.7e9 + 0.25).stamp, 1.7e9 + 0.25)

    def test_an_odometry_is_a_rigid_motion(self):
        good = np.eye(4)
        good[:3, 3] = 1, 2, 3
        np.testing.assert_array_equal(bole.Frame(GREY, 0, good.tolist()).odometry, good)
        for row, column, value in ((0, 3, np.nan), (1, 1, np.nan), (2, 3, np.inf), (0, 0, 3), (1, 1, -1), (3, 0, 1)):
            odd = good.copy()
            odd[row, column] = value
            with self.assertRaisesRegex(ValueError, "odometry"):
                bole.Frame(GREY, 0.0, odometry=odd)
        with self.assertRaisesRegex(ValueError, "odometry has the shape"):
            bole.Frame(GREY, 0.0, odometry=good[:, :3])
        with self.assertRaisesRegex(TypeError, "odometry must be an array of real numbers"):
            bole.Frame(GREY, 0.0, odometry=good * 1j)

    def test_a_gyro_is_finite_and_in_the_order_of_time(self):
        good = np.array([[0.01, 0.1, 0, 0], [0.02, 0.1, 0, 0]])
        np.testing.assert_allclose(bole.Frame(GREY, 0.1, gyro=good).gyro, good)
        for odd in (good * np.nan, good * [1, np.nan, 1, 1], good * [np.nan, 1, 1, 1], good[::-1], good[:, :3], good[0]):
            with self.assertRaisesRegex(ValueError, "gyro"):
                bole.Frame(GREY, 0.1, gyro=odd)


class Pipelines(unittest.TestCase):
    def test_a_camera_that_cannot_be_is_refused(self):
        nan = float("nan")
        for camera, size in (((0, 200, 159.5, 119.5), (320, 240)), ((200, 200, 159.5, 119.5), (0, 0)),
                             ((nan, 200, 159.5, 119.5), (320, 240)), ((200, 200, 1e9, 119.5), (320, 240)),
                             ((200, -200, 159.5, 119.5), (320, 240)), ((200, 200, 159.5, 119.5), (-320, 240)),
                             ((200, 200, 1, 1), (4, 4)), ((200, 200, 159.5, 119.5), (20000, 20000))):
            with self.assertRaisesRegex(ValueError, "camera: "):
                bole.Pipeline(camera, size)

    def test_frames_that_do_not_follow_each_other_are_refused_and_leave_no_trace(self):
        def flown(offers_odd_frames):
            pipeline = bole.Pipeline(*CAMERA)
            poses = []
            for k in range(8):
                if offers_odd_frames and k > 0:
                    for stamp in (k - 1, -5):
                        with self.assertRaisesRegex(ValueError, f"frame {k} at .* must be later than {k - 1} s"):
                            pipeline.process(bole.Frame(GREY, stamp))
                poses.append(pipeline.process(bole.Frame(np.roll(GREY, k, 1), k)).pose)
            return np.array(poses)

        np.testing.assert_array_equal(flown(True), flown(False))

    def test_a_picture_of_another_size_is_a_status(self):
        pipeline = bole.Pipeline(*CAMERA)
        for k, (image, status) in enumerate(((GREY[:100], "resized"), (GREY, "ok"), (GREY[:0], "missing"), (GREY, "ok"))):
            self.assertEqual(pipeline.process(bole.Frame(image, k)).status, status)

    def test_mistakes_are_told_in_words_of_the_module(self):
        for call in (lambda: bole.Pipeline(*CAMERA, {"map.lag": -1}), lambda: bole.Pipeline(*CAMERA, {"map.lagg": 1}),
                     lambda: bole.open(FLIGHT, max_width=3), lambda: bole.open(FLIGHT, field_of_view=500),
                     lambda: bole.open(FLIGHT, rate=-1)):
            with self.assertRaises(ValueError) as raised:
                call()
            self.assertNotRegex(str(raised.exception), "--|_px|_hz|_deg")
        with self.assertRaisesRegex(ValueError, "options: map.lag=-1: map.lag = -1, must be"):
            bole.Pipeline(*CAMERA, {"map.lag": -1})

    def test_sensors_that_contradict_the_others_are_named(self):
        source = bole.open(FLIGHT)
        pipeline = bole.Pipeline(source)
        for k, frame in enumerate(source):
            frozen = frame.odometry if k < 20 else frozen
            report = pipeline.process(bole.Frame(frame.image, frame.stamp, frozen, frame.gyro))
            if k == 19:
                self.assertEqual(report.verdicts, [])
            if k == 60:
                break
        self.assertEqual({verdict["sensor"] for verdict in report.verdicts}, {"odometry"})
        self.assertEqual(set(report.verdicts[0]), {"sensor", "kind", "since", "text"})


class Sources(unittest.TestCase):
    def test_every_pass_begins_with_the_first_frame(self):
        source = bole.open(FLIGHT)
        self.assertEqual(len(source), 120)
        first = [frame.stamp for frame in source]
        self.assertEqual(len(first), 120)
        self.assertEqual([frame.stamp for frame in source], first)
        self.assertEqual(next(iter(source)).stamp, next(iter(source)).stamp)

    def test_a_video_tells_its_field_of_view(self):
        with tempfile.TemporaryDirectory() as folder:
            video = os.path.join(folder, "flight.mp4")
            images = os.path.join(folder, "%04d.png")
            for k, name in enumerate(sorted(os.listdir(FLIGHT + "/mav0/cam0/data"))):
                os.symlink(os.path.join(FLIGHT, "mav0/cam0/data", name), images % k)
            try:
                subprocess.run(["ffmpeg", "-loglevel", "error", "-framerate", "10", "-i", images, video], check=True)
            except FileNotFoundError:
                self.skipTest("ffmpeg is not installed")
            measured, given = bole.open(video), bole.open(video, field_of_view=70)
        self.assertIn("the camera moves as one with a field of view of", measured.note)
        self.assertAlmostEqual(given.camera[0], 160 / np.tan(np.radians(35)))
        self.assertNotEqual(measured.camera[0], given.camera[0])


class Module(unittest.TestCase):
    def test_tells_what_it_is(self):
        self.assertRegex(bole.__version__, r"^\d+\.\d+\.\d+$")
        source = bole.open(FLIGHT)
        pipeline = bole.Pipeline(source)
        frame = next(iter(source))
        report = pipeline.process(frame)
        self.assertRegex(repr(source), r"<bole.Source .*park-forward: 120 frames of 320x240 px>")
        self.assertEqual(repr(frame), "<bole.Frame at 0 s: 320x240 px, ok>")
        self.assertRegex(repr(report), r"<bole.Report of frame 0 at 0 s: ok, \d+ trunks in view>")
        self.assertEqual(repr(pipeline), "<bole.Pipeline after 1 frames>")

    def test_its_stubs_name_all_that_it_has(self):
        folder = os.path.dirname(bole.__file__)
        self.assertTrue(os.path.exists(os.path.join(folder, "py.typed")))
        with open(os.path.join(folder, "__init__.pyi"), encoding="utf-8") as text:
            stub = {getattr(node, "name", None) or node.target.id: node for node in ast.parse(text.read()).body
                    if isinstance(node, (ast.ClassDef, ast.FunctionDef, ast.AnnAssign))}
        self.assertEqual(sorted(stub), sorted(bole.__all__))
        for name, node in stub.items():
            if not isinstance(node, ast.ClassDef) or name == "Run":
                continue
            told = {part.name for part in node.body if not part.name.startswith("__")}
            self.assertEqual(told, {part for part in dir(getattr(bole, name)) if not part.startswith("_")}, name)


if __name__ == "__main__":
    unittest.main()
