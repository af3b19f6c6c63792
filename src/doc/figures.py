#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Draws the pictures of README and documentation from runs (Debian: python3-opencv python3-matplotlib python3-pil).

  cmake --build --preset release --target figures   (park-forward.gif, park-forward-map.svg, system.png)
  src/doc/figures.py frames data/figures/frames.svg
  src/doc/figures.py beside run/overlay.mp4 data/figures/success-and-failure.png 12 45   (run of data/park-forward)
  src/doc/figures.py growth build/check/bole data/figures/growth.svg   (ten minutes)
  src/doc/figures.py curves curves.csv data/figures/smoother_flat.svg --log   (what benchmark_smoothing_flat has written)"""
import argparse
import csv
import math
import os
import re
import resource
import subprocess
import tempfile

import cv2
import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.patches as patches  # noqa: E402
import matplotlib.pyplot as plt  # noqa: E402
from PIL import Image  # noqa: E402

BLUE, ORANGE, GREEN, RED, GREY = "#0072B2", "#E69F00", "#009E73", "#D55E00", "#777777"  # Okabe and Ito


def rows_of(path):
    with open(path, encoding="utf-8") as text:
        return [r for r in csv.DictReader(text) if not next(iter(r.values())).startswith("#")]


def pictures_of(path):
    video, pictures = cv2.VideoCapture(path), []
    while True:
        ok, picture = video.read()
        if not ok:
            return pictures
        pictures.append(cv2.cvtColor(picture, cv2.COLOR_BGR2RGB))


def palette_of(pictures, colours):
    """A palette of which half is for what is drawn, and half for the wood."""
    pixels = np.vstack(pictures).reshape(-1, 3)
    coloured = pixels[np.ptp(pixels.astype(int), axis=1) > 50]
    greys = pixels[:: max(1, 2 * len(pixels) // max(1, len(coloured)))]
    return Image.fromarray(np.vstack([coloured, greys])[None]).quantize(colours)


def shrunk(picture, width):
    scale = width / picture.shape[1]
    return cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def gif(arguments):
    """A moving picture at the speed of the video (10 frames a second), small enough for a page."""
    small = [shrunk(p, arguments.width) for p in pictures_of(arguments.video)[::arguments.every]]
    palette = palette_of(small[:: max(1, len(small) // 8)], arguments.colours)
    frames = [Image.fromarray(p).quantize(palette=palette, dither=Image.Dither.NONE) for p in small]
    frames[0].save(arguments.out, save_all=True, append_images=frames[1:], duration=100 * arguments.every, loop=0,
                   optimize=True)


def beside(arguments):
    """Some frames of a video beside one another, small enough for a page."""
    pictures = pictures_of(arguments.video)
    shown = np.hstack([shrunk(pictures[i], arguments.width) for i in arguments.frames])
    palette = palette_of([shown], arguments.colours)
    Image.fromarray(shown).quantize(palette=palette, dither=Image.Dither.NONE).save(arguments.out, optimize=True)


def intrinsics_of(flight):
    """fx, fy, cx, cy of a flight whose camera looks ahead, as the simulated ones do."""
    with open(os.path.join(flight, "mav0/cam0/sensor.yaml"), encoding="utf-8") as text:
        found = re.search(r"^intrinsics: *\[(.*?)\]", text.read(), re.M | re.S)
    return tuple(float(v) for v in found.group(1).split(","))


def pose_of(run, stamp):
    """World pose of the body nearest to a stamp: R, t."""
    poses = np.loadtxt(os.path.join(run, "trajectory.tum"))
    _, x, y, z, qx, qy, qz, qw = poses[np.argmin(abs(poses[:, 0] - stamp))]
    R = np.array([[1 - 2 * (qy * qy + qz * qz), 2 * (qx * qy - qz * qw), 2 * (qx * qz + qy * qw)],
                  [2 * (qx * qy + qz * qw), 1 - 2 * (qx * qx + qz * qz), 2 * (qy * qz - qx * qw)],
                  [2 * (qx * qz - qy * qw), 2 * (qy * qz + qx * qw), 1 - 2 * (qx * qx + qy * qy)]])
    return R, np.array([x, y, z]), poses[:, 1:4]


def border_in_image(trunk, R, t, camera, side, heights):
    """Pixels (u, v) where the border of a trunk stands at some heights: the tangents from the camera (Eq. 7)."""
    u = []
    for z in heights:
        lean = (z - 1.3) * np.array([float(trunk["lean_x"]), float(trunk["lean_y"])])
        to = np.array([float(trunk["x"]), float(trunk["y"])]) + lean - t[:2]
        d, bearing = np.hypot(*to), math.atan2(to[1], to[0]) + side * math.asin(float(trunk["radius"]) / np.hypot(*to))
        reach = math.sqrt(d * d - float(trunk["radius"]) ** 2)
        body = R.T @ np.array([reach * math.cos(bearing), reach * math.sin(bearing), z - t[2]])
        fx, fy, cu, cv = camera
        u.append([cu - fx * body[1] / body[0], cv - fy * body[2] / body[0]])
    return np.array(u)


def energy_of(image, border, shifts):
    """Minus the strength of the mean signed gradient along the border, moved sideways by so many pixels (Eq. 3)."""
    blurred = cv2.GaussianBlur(image.astype(np.float32), (0, 0), 1)
    gradient = (np.roll(blurred, -1, 1) - np.roll(blurred, 1, 1)) / 2
    (u0, v0), (u1, v1) = border[0], border[-1]
    v = np.arange(max(0, int(min(v0, v1))), min(image.shape[0], int(max(v0, v1))))
    u = u0 + (v - v0) / (v1 - v0) * (u1 - u0)
    sampled = [cv2.remap(gradient, (u + s).astype(np.float32)[None], v.astype(np.float32)[None], cv2.INTER_LINEAR)
               for s in shifts]
    return -np.array([abs(s.mean()) for s in sampled])


def system(arguments):
    run, flight, k = arguments.run, arguments.flight, arguments.frame
    images = sorted(os.listdir(os.path.join(flight, "mav0/cam0/data")))
    image = cv2.imread(os.path.join(flight, "mav0/cam0/data", images[k]), cv2.IMREAD_GRAYSCALE)
    stamp = float(rows_of(os.path.join(run, "frames.csv"))[k]["stamp"])
    R, t, path = pose_of(run, stamp)
    seen = {r["id"] for r in rows_of(os.path.join(run, "views.csv")) if int(r["frame"]) == k}
    trunks = rows_of(os.path.join(run, "trunks.csv"))
    shown = [r for r in trunks if r["id"] in seen]
    camera = intrinsics_of(flight)

    figure, axes = plt.subplots(2, 3, figsize=(12, 7.2))
    (frame, near, borders), (relative, summary, map_) = axes
    frame.imshow(image, cmap="gray")
    frame.set_title("1  a frame, gyro, odometry", loc="left")

    saliency = pictures_of(os.path.join(run, "saliency.mp4"))[k]
    half = saliency[:, saliency.shape[1] // 2:]
    near.imshow(half[: int(half.shape[1] * 0.75)])
    near.set_title("2  what is near enough to matter (Eq. 10-17)", loc="left")

    borders.imshow(image, cmap="gray")
    heights = np.linspace(0.2, 2.2, 9)
    for trunk in shown:
        for side in (-1, 1):
            line = border_in_image(trunk, R, t, camera, side, heights)
            borders.plot(line[:, 0], line[:, 1], color=ORANGE, lw=2)
    borders.set_xlim(0, image.shape[1] - 1), borders.set_ylim(image.shape[0] - 1, 0)
    borders.set_title("3  the borders of each trunk (Eq. 3)", loc="left")
    for axis in (frame, near, borders):
        axis.set_xticks([]), axis.set_yticks([])

    draw_relative(relative)
    relative.set_title("4  relative trunk: bearing, inclination, r/d", loc="left")

    width = lambda r: float(r["radius"]) / np.hypot(float(r["x"]) - t[0], float(r["y"]) - t[1])  # noqa: E731
    nearest = max(shown, key=width)
    shifts = np.arange(-8, 8.01, 0.25)
    line = border_in_image(nearest, R, t, camera, 1, heights)
    energy = energy_of(image, line, shifts)
    best = np.argmin(np.where(abs(shifts) < 4, energy, 0))
    curvature = (energy[best + 4] - 2 * energy[best] + energy[best - 4]) / 1.0
    summary.plot(shifts, energy, color=GREY, label="energy of the image")
    inside = abs(shifts - shifts[best]) < 3
    summary.plot(shifts[inside], (energy[best] + curvature / 2 * (shifts - shifts[best]) ** 2)[inside], color=ORANGE,
                 lw=2.5, label="summary factor")
    summary.set_ylim(energy.min() * 1.1, 0), summary.set_yticks([])
    summary.set_xlabel(f"left border of trunk {nearest['id']}, moved sideways [px]")
    summary.legend(frameon=False, loc="lower right")
    summary.set_title("5  a quadratic replaces the image (Eq. 9)", loc="left")

    for row in rows_of(os.path.join(run, "evidence.csv")):
        map_.add_patch(patches.Rectangle((float(row["x"]) - .05, float(row["y"]) - .05), .1, .1, color="#DDDDDD", lw=0))
    map_.plot(path[:, 0], path[:, 1], color=BLUE, lw=1.5)
    map_.plot(t[0], t[1], "o", color=BLUE, ms=6)
    truth = os.path.join(flight, "trees.csv")
    for row in rows_of(truth) if os.path.exists(truth) else []:
        columns = list(row.values())
        map_.add_patch(patches.Circle((float(columns[1]), float(columns[2])), float(columns[3]), color="#999999", lw=0))
    for row in trunks:
        map_.add_patch(patches.Circle((float(row["x"]), float(row["y"])), float(row["radius"]), fill=False, lw=2,
                                      color=ORANGE))
    centre = path.mean(axis=0)
    map_.set_xlim(path[:, 0].min() - 2, path[:, 0].max() + 7), map_.set_ylim(centre[1] - 6, centre[1] + 6)
    map_.set_aspect("equal"), map_.set_xlabel("x [m]"), map_.set_ylabel("y [m]")
    map_.set_title("6  path and map (Eq. 2); grey: truth", loc="left")
    figure.tight_layout()
    figure.savefig(arguments.out, dpi=80)


def draw_relative(axis):
    """A trunk from above, as the camera c sees it."""
    d, r = 3.0, 0.55
    half = math.asin(r / d)
    axis.add_patch(patches.Circle((d, 0), r, color="#DDC9A8"))
    axis.plot([0, d], [0, 0], color=GREY, lw=1)
    for side in (-1, 1):
        axis.plot([0, 4.2 * math.cos(half)], [0, side * 4.2 * math.sin(half)], color=ORANGE, lw=2)
    axis.plot([d, d], [0, r], color=GREY, lw=1)
    axis.text(d + 0.06, r / 2, "r"), axis.text(d / 2, -0.16, "d"), axis.text(-0.2, 0.08, "c")
    axis.plot(0, 0, "o", color=BLUE)
    axis.add_patch(patches.Arc((0, 0), 2.8, 2.8, theta1=0, theta2=math.degrees(half), color=GREEN, lw=2))
    axis.text(1.5, 0.08, "asin r/d", color=GREEN)
    axis.set_xlim(-0.4, 4.4), axis.set_ylim(-1.3, 1.3), axis.set_aspect("equal"), axis.axis("off")


def frames(arguments):
    """World, body, camera and trunk, from the side."""
    figure, axis = plt.subplots(figsize=(8, 3.6))
    axis.axhline(0, color="#8a7a5a", lw=2)
    axis.add_patch(patches.Rectangle((5.6, 0), 0.5, 3, color="#DDC9A8"))

    def arrows(at, name, directions):
        for (dx, dz), label, colour in directions:
            axis.annotate("", (at[0] + dx, at[1] + dz), at, arrowprops={"arrowstyle": "->", "color": colour, "lw": 2})
            axis.text(at[0] + 1.12 * dx + (0.04 if not dx else 0), at[1] + 1.12 * dz + 0.04, label, color=colour)
        axis.plot(*at, "o", color="black", ms=5)
        axis.text(at[0] - 0.12, at[1] - 0.3, name, ha="right", fontsize=12, weight="bold")

    arrows((0, 0), "w", [((0.8, 0), "x", RED), ((0, 0.8), "z up", BLUE)])
    arrows((2, 1.5), "b", [((0.7, 0), "x ahead", RED), ((0, 0.7), "z", BLUE)])
    arrows((3.6, 1.35), "c", [((0.7, 0), "z ahead", BLUE), ((0, -0.6), "y down", GREEN)])
    arrows((5.85, 0), "t", [((0.7, 0), "x away", RED), ((0, 1.0), "z along the axis", BLUE)])
    axis.plot([2, 3.6], [1.5, 1.35], color=GREY, lw=1, ls="--")
    axis.text(2.95, 1.2, "bMc", ha="center", color=GREY)
    axis.plot([0, 2], [0, 1.5], color=GREY, lw=1, ls="--")
    axis.text(0.85, 0.9, "wMb", ha="right", color=GREY)
    axis.text(2, 2.55, "y of b: left; x of c: right", color=GREY)
    axis.set_xlim(-0.6, 7.8), axis.set_ylim(-0.5, 3.1), axis.set_aspect("equal"), axis.axis("off")
    figure.tight_layout()
    figure.savefig(arguments.out)


def processor_ms(command, times):
    """Milliseconds that all threads of a command take, the least of some runs: other work on the machine only adds."""
    spent = []
    for _ in range(times):
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        if subprocess.run(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, check=False).returncode not in (0, 3):
            raise SystemExit("failed: " + " ".join(command))  # 3: done, but nothing was found
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        spent.append(1e3 * (after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime))
    return min(spent)


def things_that_grow():
    """Lists the curves, each with its label and its points: name, place on the axis (None: trunks in view), scene,
    settings, and the frames from and to which the time is counted."""
    sizes = [(320, 240), (640, 480), (960, 540), (1280, 720), (1920, 1080)]
    camera = "camera: {{width: {0}, height: {1}, fx: {2}, fy: {2}, cx: {3}, cy: {4}}}\n".format
    yield "megapixels", [(f"{w} x {h}", 1e-6 * w * h, camera(w, h, 0.625 * w, (w - 1) / 2, (h - 1) / 2), [], 20, 50)
                         for w, h in sizes]
    yield "trunks in view", [(f"{density:g} a m²", None, f"forest: {{density: {density}}}\n", [], 20, 100)
                             for density in (0.01, 0.03, 0.06, 0.12, 0.2)]
    yield "frames of the window", [("", n, "", [f"detection.window={n}"], 40, 110) for n in (6, 12, 18, 36)]
    yield "minutes of flight", [("", to / 600, "flight: {path: loop}\n", [], 20, to)
                                 for to in (200, 400, 800, 1200)]


def trunks_in_view(run, first):
    views = [int(row["frame"]) for row in rows_of(os.path.join(run, "views.csv"))]
    late = [frame for frame in views if frame >= first]
    return len(late) / max(1, len(set(late)))


def growth(arguments):
    """Draws what a frame costs against the resolution, the trunks in view, the window and the length of the flight. The
    cost is the processor time of all threads, the least of some runs; it includes reading the frame, but no final pass."""
    figure, axes = plt.subplots(1, 4, figsize=(13, 3.2))
    with tempfile.TemporaryDirectory() as folder:
        for axis, (label, points) in zip(axes, things_that_grow()):
            places, costs, before = [], [], None
            for name, place, scene, settings, first, last in points:
                flight, run, file = (os.path.join(folder, part) for part in ("flight", "run", "scene.yaml"))
                if scene != before:
                    with open(file, "w", encoding="utf-8") as text:
                        text.write(scene)
                    subprocess.run([arguments.bole, "simulate", *(["--scene", file] if scene else []), "--seed", "301",
                                    "-o", flight, "--frames", str(max(p[5] for p in points)), "--overwrite", "-q"],
                                   check=True, stdout=subprocess.DEVNULL)
                before = scene
                track = [arguments.bole, "track", flight, "-o", run, "--no-video", "--online", "-q", "--set",
                         "stages.calibration=false", *(a for s in settings for a in ("--set", s)), "--frames"]
                both = [processor_ms([*track, str(frames)], arguments.times) for frames in (first, last)]
                costs.append((both[1] - both[0]) / (last - first))
                places.append(trunks_in_view(run, first) if place is None else place)
                axis.annotate(name, (places[-1], costs[-1]), (3, -10), textcoords="offset points", fontsize=7,
                              color=GREY)
                print(f"{label} {places[-1]:.3g} ({name}): {costs[-1]:.1f} ms", flush=True)
            axis.plot(places, costs, "o-", color=BLUE)
            axis.set_xlabel(label), axis.set_xlim(0, 1.3 * max(places)), axis.set_ylim(0, 1.1 * max(costs))
            axis.spines[["top", "right"]].set_visible(False)
    axes[0].set_ylabel("processor time of a frame [ms]")
    figure.tight_layout()
    figure.savefig(arguments.out)


def curves(arguments):
    """Draws what a benchmark has written: a curve's name, x and y in each row, under the title and the names of the axes."""
    rows = rows_of(arguments.table)
    title, x, y = rows[0]
    figure, axis = plt.subplots(figsize=(7.2, 3.9))
    for name in dict.fromkeys(row[title] for row in rows):
        mine = [row for row in rows if row[title] == name]
        axis.plot([float(row[x]) for row in mine], [float(row[y]) for row in mine], label=name)
    axis.set(xlabel=x, ylabel=y, title=title)
    if arguments.log:
        axis.loglog()
    axis.legend(frameon=False)
    figure.tight_layout()
    figure.savefig(arguments.out)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    what = parser.add_subparsers(required=True)
    part = what.add_parser("system", help="how the system works, on one frame of a run")
    part.add_argument("run"), part.add_argument("flight"), part.add_argument("out")
    part.add_argument("--frame", type=int, default=60)
    part.set_defaults(draw=system)
    part = what.add_parser("gif", help="a moving picture of a video")
    part.add_argument("video"), part.add_argument("out")
    part.add_argument("--every", type=int, default=3, help="shows one picture in so many")
    part.add_argument("--width", type=int, default=400), part.add_argument("--colours", type=int, default=48)
    part.set_defaults(draw=gif)
    part = what.add_parser("beside", help="frames of a video beside one another")
    part.add_argument("video"), part.add_argument("out"), part.add_argument("frames", type=int, nargs="+")
    part.add_argument("--width", type=int, default=480, help="of each frame [px]")
    part.add_argument("--colours", type=int, default=128)
    part.set_defaults(draw=beside)
    part = what.add_parser("frames", help="the coordinate frames")
    part.add_argument("out")
    part.set_defaults(draw=frames)
    part = what.add_parser("growth", help="what a frame costs against resolution, trunks, window and length")
    part.add_argument("bole"), part.add_argument("out")
    part.add_argument("--times", type=int, default=3, help="runs of which the least counts")
    part.set_defaults(draw=growth)
    part = what.add_parser("curves", help="what a benchmark has measured")
    part.add_argument("table"), part.add_argument("out")
    part.add_argument("--log", action="store_true", help="both axes are logarithmic")
    part.set_defaults(draw=curves)
    arguments = parser.parse_args()
    arguments.draw(arguments)


if __name__ == "__main__":
    main()
