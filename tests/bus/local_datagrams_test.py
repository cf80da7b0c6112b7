#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Where an interface is named, those on the same computer hear every datagram once: each of them twice
costs a reader as much again, and one with DDS-Security decrypts all of it. The kernel's counters of a
namespace tell, in which there are a writer of clouds and a reader only.

    local_datagrams_test.py BUILD WRITER READER

Exit code 77: there can be no such namespace here.
"""
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "bus", "link"))
sys.dont_write_bytecode = True
from cable import Link, as_root  # noqa: E402

CLOUD_BYTES = 200_000
DATAGRAM_BYTES = 1472  # of bringup/profiles/lan.yaml
MATCHING_S = 3.0
SECONDS = 4.0
MOST_DATAGRAMS = 1.5  # for each that the clouds need: headers, heartbeats and acknowledgements are 1.15
FEWEST_CLOUDS = 0.9  # of those written: else there is nothing to count


def heard(record):
    with open(record, encoding="utf-8") as file:
        return sum(line.startswith("hear,points") for line in file)


def main(build, writer, reader):
    as_root()
    link = Link(build)
    folder = tempfile.mkdtemp()
    processes = []

    def start(vendor, name, role):
        program = os.path.join(build, "bin", f"link_peer_{vendor}")
        configs = [os.path.join(ROOT, "bringup", "profiles", "lan.yaml"), config]
        processes.append(link.start(0, [program, os.path.join(folder, name)] + configs + ["--", role], None))

    try:
        config = os.path.join(folder, "case.yaml")
        with open(config, "w", encoding="utf-8") as file:
            file.write("bus: {domain_id: 7, network_interface: lan0}\n")
        start(reader, "reader", "hear:points")
        start(writer, "writer", f"write:points:{CLOUD_BYTES}")
        time.sleep(MATCHING_S)
        before, begin = link.udp_received(0), time.monotonic()
        time.sleep(SECONDS)
        received, took_s = link.udp_received(0) - before, time.monotonic() - begin
        for process in processes:
            process.send_signal(signal.SIGTERM)
            process.wait(20)
        needed = 10 * took_s * CLOUD_BYTES / DATAGRAM_BYTES
        clouds = heard(os.path.join(folder, "reader"))
        print(f"{clouds} clouds; {received} datagrams in {took_s:.1f} s, {received / needed:.2f} for each that the clouds need")
        return 0 if received < MOST_DATAGRAMS * needed and clouds > FEWEST_CLOUDS * 10 * took_s else 1
    finally:
        for process in processes:
            if process.poll() is None:
                process.kill()
                process.wait()
        link.close()
        shutil.rmtree(folder)


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
