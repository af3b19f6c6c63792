#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-2.0-or-later
"""Draws what the laboratory has measured, as SVG beside it: `bole compare` (compare.json), runs of `bole servo` (samples.csv,
failure.json) and `bole reproduce` (figures.json: figures 5 to 8 of the paper). Prints the name of each picture.

usage: figures.py FOLDER...     needs Debian's python3-matplotlib"""
import csv
import json
import math
import os
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

FAR = 30  # of true trunks that are told apart [m]


def save(figure, path):
    figure.savefig(path, format="svg", bbox_inches="tight")
    plt.close(figure)
    print(path)


def top_view(ax, trunks, believed, believed_colour="tab:red"):
    """True trunks green, believed ones red; x to the right, y up [m]."""
    for x, y, r in trunks:
        ax.add_patch(plt.Circle((x, y), max(r, 0.05), fill=False, color="tab:green", lw=1.5))
    for x, y, r in believed:
        ax.add_patch(plt.Circle((x, y), max(r, 0.04), color=believed_colour, alpha=0.6))
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")


# --- bole compare -------------------------------------------------------------------------------------------------------


def compare(folder):
    with open(os.path.join(folder, "compare.json"), encoding="utf-8") as file:
        report = json.load(file)
    figure, ax = plt.subplots(figsize=(9, 4))
    for i, tracker in enumerate(report["trackers"]):
        errors = [e["position_m"] for e in tracker["errors"]]
        ax.semilogy(range(1, len(errors) + 1), errors, "-" if i < 10 else "--", label=f"{tracker['tracker']}, {tracker['help']}")
    ax.set(xlabel="frame", ylabel="position error [m], all frames, whatever the tracker said", ylim=(0.005, 10), title=report["sequence"])
    ax.legend(bbox_to_anchor=(1.01, 1), loc="upper left", fontsize=8)
    save(figure, os.path.join(folder, "compare.svg"))
    if not report["basin"]:
        return
    figure, ax = plt.subplots(figsize=(9, 4))
    for row in report["basin"]:
        name = row["tracker"] + (", forest" if row["clutter"] else ", plain")
        ax.plot(row["steps_px"], [100 * share for share in row["success"]], "-o", label=name)
    ax.set(xlabel="yaw between two frames [px]", ylabel="right answers [%]")
    ax.legend(bbox_to_anchor=(1.01, 1), loc="upper left", fontsize=8)
    save(figure, os.path.join(folder, "basin.svg"))


# --- bole servo ---------------------------------------------------------------------------------------------------------


def servo(folder):
    """One panel an error over time: what the task believed thin, the truth bold; hovering in doubt red, the search grey."""
    with open(os.path.join(folder, "samples.csv"), encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    if not rows:
        return
    names = [key[len("believed "):] for key in rows[0] if key.startswith("believed ")]
    times = [float(row["time [s]"]) for row in rows]
    number = lambda text: float(text) if text else math.nan
    figure, axes = plt.subplots(max(len(names), 1), 1, figsize=(8, 2 * max(len(names), 1)), sharex=True, squeeze=False)
    for ax, name in zip(axes[:, 0], names):
        ax.plot(times, [number(row["believed " + name]) for row in rows], lw=0.8, color="tab:orange", label="believed")
        ax.plot(times, [number(row["true " + name]) for row in rows], lw=2, color="tab:blue", label="true")
        for t, row in zip(times, rows):
            if row["phase"] == "searching" or row["lost"] == "1":
                ax.axvspan(t - 0.05, t + 0.05, color="tab:red" if row["lost"] == "1" else "lightgrey", alpha=0.3, lw=0)
        ax.set_ylabel(name)
    axes[0, 0].legend(fontsize=8)
    axes[-1, 0].set_xlabel("time since take-off [s]")
    save(figure, os.path.join(folder, "errors.svg"))
    if os.path.exists(os.path.join(folder, "failure.json")):
        failure(folder, rows)


def failure(folder, rows):
    with open(os.path.join(folder, "failure.json"), encoding="utf-8") as file:
        sheet = json.load(file)
    maps = sheet["maps"]
    figure, axes = plt.subplots(1, max(len(maps), 1), figsize=(6 * max(len(maps), 1), 6), squeeze=False)
    for ax, seen in zip(axes[0], maps):
        x, y, heading = seen["drone"]
        confirmed = [b[:3] for b in seen["believed"] if b[3]]
        top_view(ax, seen["trunks"], confirmed, "tab:blue")
        top_view(ax, [], [b[:3] for b in seen["believed"] if not b[3]], "lightblue")
        ax.plot([float(row["true x [m]"]) for row in rows], [float(row["true y [m]"]) for row in rows], color="tab:red", lw=1)
        ax.arrow(x, y, 0.5 * math.cos(heading), 0.5 * math.sin(heading), color="tab:red", width=0.05)
        ax.set(xlim=(x - 7, x + 7), ylim=(y - 7, y + 7), title=f"at {seen['time_s']:.1f} s; blue: believed, pale: candidates")
    parted = sheet.get("parting")
    what = f"belief and truth parted at {parted['time_s']:.1f} s: {parted['what']}" if parted else "belief and truth did not part"
    end = sheet.get("end", {"time_s": 0, "phase": "", "reason": "no frame came", "clearance_m": 0})
    figure.suptitle(f"{sheet['title']}\n{what}\nended at {end['time_s']:.1f} s ({end['phase']}): {end['reason']}; "
                    f"{end['clearance_m']:.2f} m from the nearest bark\n" + "\n".join(sheet["sensors"]), fontsize=9)
    save(figure, os.path.join(folder, "failure.svg"))


# --- bole reproduce -----------------------------------------------------------------------------------------------------


class Flight:
    """What `bole reproduce` left of a flight, with the questions that figure 7 asks of its frames."""

    NEAR = 6  # [m]

    def __init__(self, folder):
        self.folder = folder
        with open(os.path.join(folder, "figures.json"), encoding="utf-8") as file:
            vars(self).update(json.load(file))
        self.matched = set(self.right)

    def right_in(self, frame):
        return sum(tree["tracked"] and tree["id"] in self.matched for tree in frame["trees"])

    def views(self, frame):
        """True trunks in the image: bearing from the heading, range, half of the angle that they fill."""
        x, y, heading = frame["truth"]
        widest = math.atan(0.5 * self.intrinsics[4] / self.intrinsics[0])
        for tx, ty, radius in self.trunks:
            distance = math.hypot(tx - x, ty - y)
            ahead = math.remainder(math.atan2(ty - y, tx - x) - heading, 2 * math.pi)
            if radius > 0 and abs(ahead) < widest and distance < FAR:
                yield ahead, distance, math.asin(min(radius / distance, 0.99))

    def missed_ahead(self, k):
        """Near trunks straight ahead of the way that no tree covers: "lack of sufficient motion parallax"."""
        if k == 0:
            return []
        frame = self.frames[k]
        (x, y, heading), (bx, by, _) = frame["truth"], self.frames[k - 1]["truth"]
        way = math.remainder(math.atan2(y - by, x - bx) - heading, 2 * math.pi)
        covered = lambda ahead, half: any(abs(math.remainder(t["bearing"] - frame["camera"][2] - ahead, 2 * math.pi)) < half + 0.02
                                          for t in frame["trees"])
        return sorted(distance for ahead, distance, half in self.views(frame)
                      if distance < self.NEAR and abs(ahead - way) < 0.15 and not covered(ahead, half))

    def behind_an_end(self, k):
        """Angle between the border of a tree that ends in this frame and that of a farther true trunk beside it."""
        frame, nearest = self.frames[k], 1.0
        for tree in frame["trees"]:
            if tree["tracked"] or tree["id"] not in self.matched or tree["range"] >= self.NEAR:
                continue
            bearing = math.remainder(tree["bearing"] - frame["camera"][2], 2 * math.pi)
            for ahead, distance, _ in self.views(frame):
                if tree["range"] + 1 < distance < 20:
                    nearest = min(nearest, abs(abs(ahead - bearing) - tree["half_angle"]))
        return nearest

    def new(self, k):
        return [t["id"] for t in self.frames[k]["trees"] if k > 0 and t["id"] >= len(self.frames[k - 1]["map"])]

    def picture(self, ax, k, kind="frame", ids=None):
        """With the trees tracked in it (cyan), what ended in it (red)."""
        frame = self.frames[k]
        ax.imshow(plt.imread(os.path.join(self.folder, f"{kind}-{frame['name']}.png")), cmap="gray")
        for tree in frame["trees"]:
            if ids is None or tree["id"] in ids:
                for u0, v0, u1, v1 in tree["borders"]:
                    ax.plot([u0, u1], [v0, v1], color="cyan" if tree["tracked"] or ids else "red", lw=1.2)
        ax.set_axis_off()

    def local_map(self, ax, k):
        """About the robot, which looks up; the map where the robot believes to be, the truth where it is."""
        def turned(circles, place):
            x, y, heading = place
            c, s = math.sin(heading), math.cos(heading)
            return [((cx - x) * c - (cy - y) * s, (cx - x) * s + (cy - y) * c, r) for cx, cy, r in circles]
        frame = self.frames[k]
        top_view(ax, turned(self.trunks, frame["truth"]), turned(frame["map"], frame["camera"]))
        ax.plot(0, 0, "^", color="tab:blue")
        ax.set(xlim=(-6, 6), ylim=(-1, 11), xlabel="", ylabel="[m]")


def aligned(path, truth):
    """cos, sin and the shift that move the map onto the truth by least squares over the trajectory, in x, y and yaw."""
    n = len(path)
    mx, my = sum(p[0] for p in path) / n, sum(p[1] for p in path) / n
    nx, ny = sum(t[0] for t in truth) / n, sum(t[1] for t in truth) / n
    dot = sum((p[0] - mx) * (t[0] - nx) + (p[1] - my) * (t[1] - ny) for p, t in zip(path, truth))
    cross = sum((p[0] - mx) * (t[1] - ny) - (p[1] - my) * (t[0] - nx) for p, t in zip(path, truth))
    c, s = dot / math.hypot(dot, cross), cross / math.hypot(dot, cross)
    return lambda x, y: (nx + c * (x - mx) - s * (y - my), ny + s * (x - mx) + c * (y - my))


def figure5(flight):
    """The columns of V (Eq. 14) over the picture [px], as a turn of 0.06 rad moves it."""
    fx, fy, cx, cy, width, height = flight.intrinsics
    step, turn = width // 14, 0.06
    figure, axes = plt.subplots(1, 3, figsize=(12, 3.2))
    for axis, (ax, name) in enumerate(zip(axes, ("x (right)", "y (down)", "z (forward)"))):
        for v in range(step // 2, int(height), step):
            for u in range(step // 2, int(width), step):
                x, y = (u - cx) / fx, (v - cy) / fy
                column = ((fx * x * y, fy * (1 + y * y)), (-fx * (1 + x * x), -fy * x * y), (fx * y, -fy * x))[axis]
                ax.arrow(u, v, turn * column[0], turn * column[1], color="tab:blue", head_width=2, lw=0.6)
        ax.set(xlim=(0, width), ylim=(height, 0), title="turn about " + name, aspect="equal")
    save(figure, os.path.join(flight.folder, "figure-5.svg"))


def figure6(flight):
    """The map moved onto the truth; what stands farther than 10 m from the trajectory is beyond the sheet."""
    poses = [frame["camera"] for frame in flight.frames]
    truth = [frame["truth"] for frame in flight.frames]
    move = aligned(poses, truth)
    figure, ax = plt.subplots(figsize=(7, 7))
    top_view(ax, flight.trunks, [(*move(x, y), r) for x, y, r in flight.map])
    ax.plot(*zip(*(p[:2] for p in truth)), color="tab:green", lw=1)
    ax.plot(*zip(*(move(*p[:2]) for p in flight.path)), color="tab:red", lw=1)
    xs, ys = [p[0] for p in truth], [p[1] for p in truth]
    ax.set(xlim=(min(xs) - 10, max(xs) + 10), ylim=(min(ys) - 10, max(ys) + 10),
           title=f"{flight.flight}: {len(flight.map)} trees, {len(flight.matched)} of them stand for a trunk of their own")
    save(figure, os.path.join(flight.folder, "figure-6.svg"))


def figure7(flight):
    """Three successes, and the two failures that the paper names, each where the flight has it."""
    count = len(flight.frames)
    best = lambda begin, end, score: max(range(begin, end), key=score)
    panels = [(best(p * count // 3, (p + 1) * count // 3, lambda k: flight.right_in(flight.frames[k])), "abc"[p]) for p in range(3)]
    titles = [f"7 {name}, frame {k}: {flight.right_in(flight.frames[k])} trees tracked that prove to be trunks" for k, name in panels]
    ahead = best(1, count, lambda k: sum(1 / d for d in flight.missed_ahead(k)))
    missed = flight.missed_ahead(ahead)
    titles.append(f"7 d, frame {ahead}: no parallax, {len(missed)} near trunks straight ahead without a tree")
    end = best(1, count, lambda k: -flight.behind_an_end(k))
    apart = flight.behind_an_end(end)
    titles.append(f"7 d, frame {end}: " + ("no near tree that proves to be a trunk ended" if apart >= 1 else
                  f"a tree (red) ends, a farther trunk {apart * flight.intrinsics[0]:.1f} px beside it"))
    figure, axes = plt.subplots(5, 2, figsize=(10, 22))
    for row, (k, title) in enumerate(zip([k for k, _ in panels] + [ahead, end], titles)):
        flight.picture(axes[row, 0], k)
        flight.local_map(axes[row, 1], k)
        axes[row, 0].set_title(title, fontsize=8)
    save(figure, os.path.join(flight.folder, "figure-7.svg"))


def figure8(flight):
    """Two frames with newly found trees (cyan), each beside its saliency: near things white."""
    count = len(flight.frames)
    figure, axes = plt.subplots(2, 2, figsize=(10, 8))
    for part in range(2):
        k = max(range(part * count // 2, (part + 1) * count // 2), key=lambda i: len(flight.new(i)))
        new = set(flight.new(k))
        for ax, kind in zip(axes[part], ("frame", "saliency")):
            flight.picture(ax, k, kind, new)
        axes[part, 0].set_title(f"frame {k}: {len(new & flight.matched)} of {len(new)} new trees prove to be trunks", fontsize=8)
    save(figure, os.path.join(flight.folder, "figure-8.svg"))


def reproduce(folder):
    flight = Flight(folder)
    for draw in (figure5, figure6, figure7, figure8):
        draw(flight)


def main():
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    draw = {"compare.json": compare, "samples.csv": servo, "figures.json": reproduce}
    found = [(root, name) for folder in sys.argv[1:] for root, _, names in os.walk(folder) for name in sorted(names) if name in draw]
    for root, name in found:
        draw[name](root)
    if not found:
        sys.exit(f"figures: no {', '.join(draw)} in {' '.join(sys.argv[1:])}")


if __name__ == "__main__":
    main()
