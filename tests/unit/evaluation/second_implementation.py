#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Works out with numpy what `trigpoint evaluate --json` says, and compares every figure.

    second_implementation.py RESULT.json ESTIMATE REFERENCE      files, TUM
    second_implementation.py RESULT.json SESSION                 truth, withheld fixes, all fixes

Written from the definitions (evo's APE, KITTI's error per distance, README of the component), with other formulas
than the C++ where there are any: rotations as matrices, yaw by complex numbers, SE(3) by Kabsch, places by the
ellipsoid's equations. Prints the number of figures and the largest difference; exit code 1 when one is above 1e-6.
"""
import csv
import json
import os
import re
import sys

import numpy as np

TOLERANCE = 1e-6
GAP_NS = 100_000_000
NAMES = {"none": 0, "yaw + translation": 1, "SE(3)": 2}


def stamp_ns(text):
    whole, _, fraction = text.partition(".")
    return int(whole) * 10**9 + int((fraction + "000000000")[:9])


def matrix(x, y, z, w):
    x, y, z, w = np.array([x, y, z, w]) / np.linalg.norm([x, y, z, w])
    return np.array([[1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
                     [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
                     [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)]])


def read_tum(file):
    stamps, positions, rotations = [], [], []
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            words = line.split()
            if words and not line.startswith("#"):
                stamps.append(stamp_ns(words[0]))
                values = [float(word) for word in words[1:]]
                positions.append(values[:3])
                rotations.append(matrix(*values[3:]))
    return stamps, np.array(positions), np.array(rotations)


def angle(R):
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return np.arctan2(np.linalg.norm(axis), np.trace(R) - 1)


def power(R, fraction):
    """R to a power of 0 to 1: Rodrigues' formula."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = np.linalg.norm(axis)
    if length < 1e-14:
        return np.eye(3)
    k = axis / length
    K = np.array([[0, -k[2], k[1]], [k[2], 0, -k[0]], [-k[1], k[0], 0]])
    a = fraction * angle(R)
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K


def pose_at(trajectory, t):
    stamps, p, R = trajectory
    i = int(np.searchsorted(np.array(stamps, dtype=np.int64), t))
    if i == len(stamps):
        return None
    if stamps[i] == t:
        return p[i], R[i]
    if i == 0 or stamps[i] - stamps[i - 1] > 2 * GAP_NS:
        return None
    f = (t - stamps[i - 1]) / (stamps[i] - stamps[i - 1])
    return p[i - 1] + f * (p[i] - p[i - 1]), R[i - 1] @ power(R[i - 1].T @ R[i], f)


class Pairs:
    def __init__(self, stamps, e, Re, r, Rr):
        self.stamps, self.e, self.Re, self.r, self.Rr = stamps, np.array(e), np.array(Re), np.array(r), np.array(Rr)

    def alignment(self, kind):
        e, r = self.e - self.e.mean(0), self.r - self.r.mean(0)
        if kind == 0:
            R, t = np.eye(3), np.zeros(3)
        elif kind == 1:
            turn = np.sum(np.conj(e[:, 0] + 1j * e[:, 1]) * (r[:, 0] + 1j * r[:, 1]))
            c, s = turn.real / abs(turn), turn.imag / abs(turn)
            R = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        else:
            U, _, Vt = np.linalg.svd(e.T @ r)
            R = Vt.T @ np.diag([1, 1, np.sign(np.linalg.det(Vt.T @ U.T))]) @ U.T
        if kind:
            t = self.r.mean(0) - R @ self.e.mean(0)
        return R, t

    def aligned(self, kind):
        R, t = self.alignment(kind)
        return Pairs(self.stamps, self.e @ R.T + t, R @ self.Re, self.r, self.Rr)


def associate(estimate, reference):
    found = [(t, p, R, pose_at(reference, t)) for t, p, R in zip(*estimate)]
    found = [(t, p, R, q) for t, p, R, q in found if q is not None]
    pairs = Pairs([f[0] for f in found], [f[1] for f in found], [f[2] for f in found],
                  [f[3][0] for f in found], [f[3][1] for f in found])
    times = np.array(estimate[0], dtype=np.int64)
    near = np.array([np.min(np.abs(times - t)) <= GAP_NS for t in reference[0]])
    since = np.array([t >= estimate[0][0] for t in reference[0]])
    return pairs, np.mean(near[since]) if since.any() else 0.0, np.mean(near)


def associate_fixes(estimate, fixes, lever):
    stamps, e, Re, r, since = [], [], [], [], 0
    for t, p in fixes:
        since += t >= estimate[0][0]
        at = pose_at(estimate, t)
        if at is not None:
            stamps.append(t)
            e.append(at[0] + at[1] @ lever)
            Re.append(at[1])
            r.append(p)
    pairs = Pairs(stamps, e, Re, r, [np.eye(3)] * len(r))
    return pairs, len(r) / since if since else 0.0, len(r) / len(fixes)


def statistics(values):
    values = np.abs(np.array(values))
    return {"rmse": np.sqrt(np.mean(values**2)), "mean": values.mean(), "median": np.median(values),
            "std": values.std(), "min": values.min(), "max": values.max()}


def absolute(pairs, has_attitude):
    d = pairs.e - pairs.r
    result = {"position_m": statistics(np.linalg.norm(d, axis=1)),
              "horizontal_m": statistics(np.hypot(d[:, 0], d[:, 1])), "bias_m": d.mean(0).tolist()}
    for axis, name in enumerate("xyz"):
        result[f"{name}_m"] = statistics(d[:, axis])
    turned = [np.degrees(angle(a.T @ b)) for a, b in zip(pairs.Rr, pairs.Re)]
    result["rotation_deg"] = statistics(turned) if has_attitude else dict.fromkeys(
        ("rmse", "mean", "median", "std", "min", "max"))
    return result


def motion_error(pairs, i, j):
    def motion(p, R):
        return R[i].T @ (p[j] - p[i]), R[i].T @ R[j]
    pr, Rr = motion(pairs.r, pairs.Rr)
    pe, Re = motion(pairs.e, pairs.Re)
    return np.linalg.norm(Rr.T @ (pe - pr)), np.degrees(angle(Rr.T @ Re))


def along(pairs):
    return np.concatenate([[0], np.cumsum(np.linalg.norm(np.diff(pairs.r, axis=0), axis=1))])


def relative(pairs, length, has_attitude):
    way = along(pairs)
    errors = []
    for i in range(len(way)):
        later = np.nonzero(way - way[i] >= length)[0]
        if later.size == 0:
            break
        j = later[0]
        if has_attitude:
            errors.append(motion_error(pairs, i, j))
        else:
            errors.append((np.linalg.norm((pairs.e[j] - pairs.e[i]) - (pairs.r[j] - pairs.r[i])), np.nan))
    mean = np.mean(errors, axis=0) / length if errors else (None, np.nan)
    return {"length_m": length, "segments": len(errors),
            "translation_percent": None if mean[0] is None else 100 * mean[0],
            "rotation_deg_per_m": None if np.isnan(mean[1]) else mean[1]}


def step(trajectory, lio):
    stamps, p, R = trajectory
    best, count, before = (0.0, 0), 0, None
    for i, t in enumerate(stamps):
        odom = pose_at(lio, t) if lio else (np.zeros(3), np.eye(3))
        if lio is None and i > 0:
            before = p[i - 1], R[i - 1]
        if odom is not None and before is not None:
            count += 1
            far = np.linalg.norm(p[i] - (before[1] @ odom[0] + before[0]))
            best = max(best, (far, t), key=lambda b: b[0])
        if lio:
            before = None if odom is None else (p[i] - R[i] @ odom[1].T @ odom[0], R[i] @ odom[1].T)
    return {"distance_m": best[0], "stamp_ns": best[1], "intervals": count}


def outage(pairs, window):
    inside = [i for i, t in enumerate(pairs.stamps) if window["begin_ns"] < t < window["end_ns"]]
    far = np.linalg.norm(pairs.e - pairs.r, axis=1)[inside]
    way = np.sum(np.linalg.norm(np.diff(pairs.r[inside], axis=0), axis=1)) if inside else None
    return {"pairs": len(inside), "begin_m": far[0] if inside else None, "max_m": far.max() if inside else None,
            "end_m": far[-1] if inside else None, "distance_m": way}


def score_of(said, pairs, has_attitude):
    if said["error"] is None:
        return {"error": None}
    kind = NAMES[said["alignment"]]
    R, t = pairs.alignment(kind)
    # Two quaternions mean one rotation: the angle between it and what was said is compared with 0.
    turned = angle(R.T @ matrix(*said["quaternion_xyzw"]))
    said["turned_rad"] = turned
    return {"error": absolute(pairs.aligned(kind), has_attitude), "translation_m": t.tolist(), "turned_rad": 0.0}


def expected_of(said, trajectory, lio, pairs, coverage, has_attitude):
    result = {"pairs": len(pairs.stamps), "coverage_from_first": coverage[0], "coverage_whole": coverage[1]}
    result["scores"] = [score_of(score, pairs, has_attitude) for score in said["scores"]]
    way = pairs if has_attitude else pairs.aligned(1)
    result["relative"] = [relative(way, length, has_attitude) for length in (10.0, 50.0, 100.0)]
    if has_attitude:
        far, turned = motion_error(pairs, 0, -1)
        result["end_to_end"] = {"error_m": far, "error_deg": turned, "distance_m": along(pairs)[-1],
                                "percent": 100 * far / along(pairs)[-1]}
    result["step"] = step(trajectory, lio)
    result["outages"] = [outage(pairs, window) for window in said["outages"]]
    if said["gps_good"] is not None:
        good = [not any(w["begin_ns"] < t < w["end_ns"] for w in said["outages"]) for t in pairs.stamps]
        result["gps_good"] = statistics(np.linalg.norm(pairs.e - pairs.r, axis=1)[good])
    return result


class Differences:
    def __init__(self):
        self.figures, self.largest, self.worst = 0, 0.0, []

    def compare(self, expected, said, where):
        if isinstance(expected, dict):
            for key, value in expected.items():
                self.compare(value, said[key], f"{where}.{key}")
        elif isinstance(expected, list):
            if len(expected) != len(said):
                raise SystemExit(f"{where}: {len(said)} values, expected {len(expected)}")
            for i, value in enumerate(expected):
                self.compare(value, said[i], f"{where}[{i}]")
        elif expected is None or said is None:
            self.figures += 1
            if (expected is None) != (said is None):
                self.worst.append(f"{where}: {said}, expected {expected}")
        else:
            self.figures += 1
            difference = abs(float(said) - float(expected))
            self.largest = max(self.largest, difference)
            if not difference <= TOLERANCE:
                self.worst.append(f"{where}: {said}, expected {expected}")


def places(session):
    """Fixes in map: (stamp, position, withheld), by the equations of the WGS 84 ellipsoid."""
    a, f = 6378137.0, 1 / 298.257223563
    e2 = f * (2 - f)

    def geocentric(lat, lon, h):
        n = a / np.sqrt(1 - e2 * np.sin(lat)**2)
        return np.array([(n + h) * np.cos(lat) * np.cos(lon), (n + h) * np.cos(lat) * np.sin(lon),
                         (n * (1 - e2) + h) * np.sin(lat)])

    with open(os.path.join(session, "datum.yaml"), encoding="utf-8") as file:
        datum = dict(re.findall(r"^(\w+): ([-+\d.e]+)", file.read(), re.MULTILINE))
    with open(os.path.join(session, "config.yaml"), encoding="utf-8") as file:
        config = file.read()
    lever = [float(x) for x in re.search(r"antenna_position_base_m: \[(.*?)\]", config).group(1).split(",")]
    undulation = re.search(r"geoid_undulation_m: ([-+\d.e]+)", config)
    up = float(undulation.group(1)) if undulation else 0.0
    lat, lon = np.radians(float(datum["latitude_deg"])), np.radians(float(datum["longitude_deg"]))
    origin = geocentric(lat, lon, float(datum["height_m"]))
    axes = np.array([[-np.sin(lon), np.cos(lon), 0],
                     [-np.sin(lat) * np.cos(lon), -np.sin(lat) * np.sin(lon), np.cos(lat)],
                     [np.cos(lat) * np.cos(lon), np.cos(lat) * np.sin(lon), np.sin(lat)]])
    fixes = {}
    with open(os.path.join(session, "fixes.csv"), encoding="utf-8", newline="") as file:
        for row in csv.DictReader(file):
            if row["status"] != "no_fix":
                p = geocentric(np.radians(float(row["latitude_deg"])), np.radians(float(row["longitude_deg"])),
                               float(row["altitude_m"]) + up)
                fixes.setdefault(int(row["stamp_ns"]), (axes @ (p - origin), row["withheld"] == "1"))
    return [(t, *fixes[t]) for t in sorted(fixes)], np.array(lever)


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        result = json.load(file)
    differences = Differences()
    session = sys.argv[2] if os.path.isdir(sys.argv[2]) else None
    for block in result["blocks"]:
        for said in block["compared"]:
            trajectory = read_tum(os.path.join(session, said["estimate"]) if session else sys.argv[2])
            lio = read_tum(os.path.join(session, "lio.tum")) if said["step"]["relative_to_lio"] else None
            if block["reference"].endswith("fixes"):
                fixes, lever = places(session)
                chosen = [(t, p) for t, p, withheld in fixes if withheld or block["reference"] == "all fixes"]
                pairs, *coverage = associate_fixes(trajectory, chosen, lever)
            else:
                reference = read_tum(os.path.join(session, "truth.tum") if session else sys.argv[3])
                pairs, *coverage = associate(trajectory, reference)
            has_attitude = not block["reference"].endswith("fixes")
            expected = expected_of(said, trajectory, lio, pairs, coverage, has_attitude)
            differences.compare(expected, said, f"{said['estimate']} against {block['reference']}")
    print(f"{differences.figures} figures, largest difference {differences.largest:.3g}")
    print("\n".join(differences.worst))
    return 1 if differences.worst or differences.figures == 0 else 0


if __name__ == "__main__":
    sys.exit(main())
