#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Every program is linked with the library of its DDS vendor and with no other's.

    linked_libraries_test.py VENDOR PROGRAM...
"""
import subprocess
import sys

LIBRARY = {"fastdds": "libfastrtps.so", "cyclonedds": "libddsc.so"}


def violations(vendor, program):
    linked = subprocess.run(["ldd", program], capture_output=True, check=True, text=True).stdout
    for each, library in LIBRARY.items():
        if (library in linked) != (each == vendor):
            yield f"{program} is {'' if library in linked else 'not '}linked with {library}, and is for {vendor}"


def main(vendor, programs):
    found = [text for program in programs for text in violations(vendor, program)]
    print("\n".join(found) or f"{len(programs)} programs use {LIBRARY[vendor]} alone")
    return 1 if found or not programs else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], sys.argv[2:]))
