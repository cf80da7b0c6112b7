#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Recorders on one vendor come and go while a robot on the other has clouds under way: each must end when
it is asked to, without a crash, and hear no message that was never sent. (Readers of Fast DDS 2.9 that
free their changes do in about one of six cases, and some crash.)

    coming_recorders_test.py BUILD ROBOT_VENDOR
"""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))

RECORDERS = 32
AT_A_TIME = 2
SECONDS = 1.5
LONGEST_END_S = 15.0  # from the signal on
LONGEST_START_S = 40.0
REFUSED = "is not a message of that topic's type"

def wait_for_poses(name, longest_s):
    end = time.monotonic() + longest_s
    while not (os.path.exists(name) and os.path.getsize(name) > 0):
        if time.monotonic() > end:
            raise RuntimeError(f"nothing in {name} after {longest_s} s")
        time.sleep(0.1)

def record(binaries, folder, number):
    with open(os.path.join(folder, f"{number}.log"), "w", encoding="utf-8") as log:
        return subprocess.Popen([os.path.join(binaries, "trigpoint"), "record", "--out", os.path.join(folder, str(number))], stdout=log, stderr=subprocess.STDOUT)

def end(process):
    process.send_signal(signal.SIGINT)
    try:
        return process.wait(LONGEST_END_S)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()
        return "does not end"

def main(build, vendor):
    binaries = os.path.join(build, "bin")
    folder = tempfile.mkdtemp()
    # Of its own, and above those that other tests take.
    os.environ.update(TRIGPOINT_BIN=binaries, ROS_DOMAIN_ID="119")
    robot_folder = os.path.join(folder, "robot")
    with open(os.path.join(folder, "robot.log"), "w", encoding="utf-8") as log:
        robot = subprocess.Popen([os.path.join(ROOT, "bringup", "host"), "robot", "--out", robot_folder, "--play", "campus", "--vendor", vendor, "--no-build"],
                                 stdout=log, stderr=subprocess.STDOUT)
    codes = []
    try:
        wait_for_poses(os.path.join(robot_folder, "lio.tum"), LONGEST_START_S)
        for first in range(0, RECORDERS, AT_A_TIME):
            recorders = []
            for number in range(first, first + AT_A_TIME):
                recorders.append(record(binaries, folder, number))
                time.sleep(0.15)
            time.sleep(SECONDS)
            codes += [end(recorder) for recorder in recorders]
            if robot.poll() is not None:
                raise RuntimeError("the robot's drive ended before all recorders had come")
    finally:
        if robot.poll() is None:
            robot.send_signal(signal.SIGTERM)
            robot.wait(60)
    wrong = [code for code in codes if code != 0]
    garbled = 0
    for number in range(len(codes)):
        with open(os.path.join(folder, f"{number}.log"), encoding="utf-8") as log:
            garbled += REFUSED in log.read()
    print(f"{len(codes)} recorders, not ended well: {wrong or 'none'}; {garbled} heard what nobody sent")
    shutil.rmtree(folder)
    return 1 if wrong or garbled else 0

if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:3]))
