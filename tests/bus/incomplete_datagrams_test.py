#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""`trigpoint doctor` on a computer that gets datagrams larger than a frame over a cable that loses frames:
it says so with the remedy, says nothing where the cable loses none, and finds no fault in what was lost
before it listened.

    incomplete_datagrams_test.py BUILD

Exit code 77: there can be no such cable here, or its kernel's patience cannot be set.
"""
import os
import subprocess
import sys
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "bus", "link"))
sys.dont_write_bytecode = True
from cable import HOSTS, SKIPPED, Link, as_root  # noqa: E402

SENDING = f"""
import socket, time
out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
while True:
    out.sendto(bytes(8000), ("{HOSTS[1]}", 9))
    time.sleep(0.01)
"""
PATIENCE_S = 1  # for which pieces wait for others
SENTENCE = "datagrams came in pieces of which some were lost"
OF_THE_PAST = "none while this listened"


def doctor(link, build):
    command = ["nsenter", f"--net={link.networks[1]}", os.path.join(build, "bin", "trigpoint"), "doctor", "--seconds", "4"]
    return subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, check=False, text=True, timeout=60).stdout


def main(build):
    as_root()
    link = Link(build)
    patience = f"echo {PATIENCE_S} > /proc/sys/net/ipv4/ipfrag_time"
    if subprocess.run(["nsenter", f"--net={link.networks[1]}", "sh", "-c", patience], check=False).returncode != 0:
        print("skipped: ipfrag_time cannot be set here")
        return SKIPPED
    sender = link.start(0, [sys.executable, "-c", SENDING], None)
    try:
        link.order("rate 1000 20\n")
        without_loss = doctor(link, build)
        link.order("loss 5\n")
        with_loss = doctor(link, build)
        sender.kill()
        sender.wait()
        time.sleep(PATIENCE_S + 1)
        afterwards = doctor(link, build)
        print(without_loss, with_loss, afterwards)
        now = [SENTENCE in output for output in (without_loss, with_loss, afterwards)]
        past = [OF_THE_PAST in output for output in (without_loss, with_loss, afterwards)]
        return 0 if now == [False, True, False] and past == [False, False, True] else 1
    finally:
        sender.kill()
        sender.wait()
        link.close()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1]))
