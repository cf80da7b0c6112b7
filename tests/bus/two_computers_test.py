#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""What docs/two_computers.md says, done: sensors and mapper on one computer, filter and gate on another,
over 100 Mbit/s with 20 ms delay, 1 % loss and no multicast. The second computer's clock is 30 s ahead, and
where both vendors are built it runs the other one. The parts become one session.

    two_computers_test.py BUILD
"""
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "bus", "link"))
sys.dont_write_bytecode = True
from cable import HOSTS, Link, as_root  # noqa: E402

CLOCK_AHEAD_S = 30
CLOCK_TOLERANCE_S = 0.02  # half the round trip of 40 ms
LARGEST_RMSE_M = 0.25  # of the fused trajectory; the main job's test promises as much for this drive
SHORTEST_COVERAGE_S = 15.0  # of 24 s: GPS needs some to align
LOCAL_SCANS = 0.98  # share of sweeps that the mapper must use


def tum(name):
    """Rows of a trajectory: stamp and position."""
    with open(name, encoding="utf-8") as file:
        return [tuple(map(float, line.split()[:4])) for line in file if not line.startswith("#")]


def rmse(estimate, truth):
    """Of positions against the nearest truth in time, which has hundreds a second."""
    index, total, count = 0, 0.0, 0
    for stamp, *position in estimate:
        while index + 1 < len(truth) and abs(truth[index + 1][0] - stamp) <= abs(truth[index][0] - stamp):
            index += 1
        total += sum((a - b) ** 2 for a, b in zip(position, truth[index][1:]))
        count += 1
    return (total / max(count, 1)) ** 0.5


def run_hosts(link, build, folder):
    """Both parts of the session; the exit codes of both computers."""
    binaries = os.path.join(build, "bin")
    environment = dict(os.environ, TRIGPOINT_BIN=binaries, ROS_DOMAIN_ID="7")
    shifted = dict(environment, LD_PRELOAD=os.path.join(binaries, "libshifted_clock.so"), SHIFTED_CLOCK_S=str(CLOCK_AHEAD_S))
    other_vendor = ["--vendor", "cyclonedds"] if os.path.isdir(os.path.join(binaries, "cyclonedds")) else []
    host = [os.path.join(ROOT, "bringup", "host")]
    common = ["--no-build", "--peers", ",".join(HOSTS)]
    with open(os.path.join(folder, "robot.log"), "w", encoding="utf-8") as robot_log, open(os.path.join(folder, "base.log"), "w", encoding="utf-8") as base_log:
        base = link.start(1, host + ["base", "--out", os.path.join(folder, "base"), "--for", "short"] + common + other_vendor, base_log, shifted)
        robot = link.start(0, host + ["robot", "--out", os.path.join(folder, "robot"), "--play", "short"] + common, robot_log, environment)
        try:
            code = robot.wait(120)
            time.sleep(1.0)
            base.send_signal(signal.SIGTERM)
            return code, base.wait(60)
        finally:
            for process in (robot, base):
                if process.poll() is None:
                    process.send_signal(signal.SIGTERM)
                    process.wait(60)


def judge(session):
    """Sentences about what is wrong."""
    wrong = []
    fused, truth = tum(os.path.join(session, "fused.tum")), tum(os.path.join(session, "truth.tum"))
    error = rmse(fused, truth)
    print(f"fused.tum: {len(fused)} poses over {fused[-1][0] - fused[0][0]:.1f} s, RMSE {error:.3f} m")
    if error > LARGEST_RMSE_M:
        wrong.append(f"the fused trajectory is {error:.3f} m off")
    if fused[-1][0] - fused[0][0] < SHORTEST_COVERAGE_S:
        wrong.append("fused.tum is too short")
    with open(os.path.join(session, "lio_mapper.counts.yaml"), encoding="utf-8") as file:
        counts = dict(re.findall(r'"([\w.]+)": (\d+)', file.read()))
    print(f"mapper: used {counts['points.used']} of {counts['points.received']} sweeps")
    if int(counts["points.used"]) < LOCAL_SCANS * 10 * 24:
        wrong.append("the mapper lost sweeps")
    for name in ("map.pcd", "report.md", "datum.yaml", "gps.tum", "config.base.yaml", "logs/base"):
        if not os.path.exists(os.path.join(session, name)):
            wrong.append(f"{name} is missing")
    for name, ahead_s in (("robot", CLOCK_AHEAD_S), ("base", -CLOCK_AHEAD_S)):
        with open(os.path.join(session, f"clock.{name}.csv"), encoding="utf-8") as file:
            rows = [line.split(",") for line in file if not line.startswith("#")]
        print(f"clock of the other computer as seen by {name}: {rows[-1][2]} s ahead, round trip {float(rows[-1][3]):.4f} s")
        if abs(float(rows[-1][2]) - ahead_s) > CLOCK_TOLERANCE_S:
            wrong.append(f"{name} says that the other clock is {rows[-1][2]} s ahead")
    return wrong


def main(build):
    as_root()
    folder = tempfile.mkdtemp()
    link = Link(build)
    try:
        link.order("rate 100 100\ndelay 20\nloss 1\nmulticast off\n")
        codes = run_hosts(link, build, folder)
        session = os.path.join(folder, "session")
        collected = subprocess.run(
            [os.path.join(ROOT, "bringup", "collect"), session, os.path.join(folder, "robot"), os.path.join(folder, "base")],
            env=dict(os.environ, TRIGPOINT_BIN=os.path.join(build, "bin")), stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, text=True)
        wrong = [] if codes == (0, 0) else [f"exit codes of the hosts: {codes}"]
        wrong += [] if collected.returncode == 0 else [f"collect ended with {collected.returncode}: {collected.stdout}"]
        wrong += judge(session) if not wrong else []
        if wrong:
            for name in ("robot.log", "base.log"):
                with open(os.path.join(folder, name), encoding="utf-8") as log:
                    print(name, log.read())
        print("\n".join(wrong) or "as promised")
        return 1 if wrong else 0
    finally:
        link.close()
        shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
