#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Holds the architecture by reading the source: what includes what, and what every file must have.

    architecture_test.py ROOT              checks the repository
    architecture_test.py ROOT --check X    only one check
    architecture_test.py --self-test       plants a violation of every check and expects it found

A check is a function from a Tree to a list of sentences, one for each violation.
"""
import argparse
import os
import re
import subprocess
import sys

LONGEST_FILE = 500
LONGEST_TEST_FILE = 650
CORES = ("gps_odometry", "lio_mapper", "fusion_gate")
GENERATED = r"(builtin_interfaces|std_msgs|geometry_msgs|nav_msgs|sensor_msgs|tf2_msgs|diagnostic_msgs|rosgraph_msgs|trigpoint_msgs)\.h"
DDS_HEADER = re.compile(rf"^(fastdds/|fastrtps/|fastcdr/|dds/|ddsc/|{GENERATED}$)")
# Headers of the bus that bring generated types along are for process shells too.
TYPED_BUS_HEADER = re.compile(r"^trigpoint/bus/(bus|backend|convert|topics)\.hpp$")
HEAVY_HEADER = re.compile(r"^(pcl/|yaml-cpp/|spdlog/|sqlite3|rosbag/|GeographicLib/|nlohmann/|ceres/|gdal|ogr_|boost/|CLI/)")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]', re.MULTILINE)
MACHINE_PATH = re.compile(r"(?<![\w.$}{/-])/(work|root)/[\w.]")
SPDX = "SPDX-License-Identifier: Apache-2.0"


def tracked_paths(root):
    """What git tracks, or in an unpacked archive what is there, without folders that a build makes."""
    listed = subprocess.run(["git", "-C", root, "ls-files", "-z"], capture_output=True, check=False)
    if listed.returncode == 0:
        return list(filter(None, listed.stdout.decode().split("\0")))
    paths = []
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = [name for name in subfolders if name not in ("build", "install", "sessions", ".git")]
        paths += [os.path.relpath(os.path.join(folder, name), root) for name in names]
    return paths


class Tree:
    """Tracked files by path, and the order of the components."""

    def __init__(self, files):
        self.files = files

    @classmethod
    def of_repository(cls, root):
        files = {}
        for path in tracked_paths(root):
            full = os.path.join(root, path)
            if os.path.isfile(full):
                with open(full, encoding="utf-8", errors="replace") as file:
                    files[path] = file.read()
        return cls(files)

    def sources(self, *folders):
        """C++ files below any of the folders (all when none is given)."""
        for path, text in sorted(self.files.items()):
            if path.endswith((".hpp", ".cpp", ".h", ".cc")) and (not folders or path.startswith(folders)):
                yield path, text

    def order(self):
        text = self.files.get("components/CMakeLists.txt", "")
        return re.findall(r"^\s*add_subdirectory\((\w+)\)", text, re.MULTILINE)


def includes(text):
    return INCLUDE.findall(text)


def component_of(path):
    match = re.match(r"components/(\w+)/", path)
    return match.group(1) if match else None


def included_component(header):
    match = re.match(r"trigpoint/(\w+)/", header)
    return match.group(1) if match else None


def may_know_dds(path):
    return path.startswith(("components/bus/", "tests/bus/", "tests/unit/bus/")) or re.match(r"components/\w+/process/", path)


def dds_stays_in_the_bus(tree):
    return [
        f"{path} includes <{header}>: only components/bus and process/ know DDS and generated types"
        for path, text in tree.sources("components/", "tests/unit/")
        if not may_know_dds(path)
        for header in includes(text)
        if DDS_HEADER.match(header) or TYPED_BUS_HEADER.match(header)
    ]


def heavy_headers_stay_in_sources(tree):
    return [
        f"{path} includes <{header}>: heavy headers belong in .cpp files"
        for path, text in tree.sources("components/")
        if "/include/" in path
        for header in includes(text)
        if HEAVY_HEADER.match(header)
    ]


def cores_do_not_know_each_other(tree):
    return [
        f"{path} includes <{header}>: the three components share nothing but base and the bus"
        for path, text in tree.sources(*(f"components/{core}/" for core in CORES))
        for header in includes(text)
        if included_component(header) in CORES and included_component(header) != component_of(path)
    ]


def arrows_point_one_way(tree):
    order = {name: rank for rank, name in enumerate(tree.order())}
    found = []
    for path, text in tree.sources("components/"):
        if "/process/" in path:
            continue  # a program's shell, built in components/processes: nothing depends on it
        own = component_of(path)
        for header in includes(text):
            other = included_component(header)
            if other in order and order[other] > order.get(own, len(order)):
                found.append(f"{path} includes <{header}>: {other} comes after {own} in components/CMakeLists.txt")
    return found


def cores_do_not_know_the_bus(tree):
    return [
        f"{path} includes <{header}>: a core is free of the bus; its process/ wires it"
        for path, text in tree.sources(*(f"components/{core}/" for core in CORES))
        if "/process/" not in path
        for header in includes(text)
        if included_component(header) == "bus"
    ]


def every_source_has_its_licence(tree):
    return [
        f"{path}: the first line is not '// {SPDX}'"
        for path, text in tree.sources()
        if SPDX not in text.partition("\n")[0]
    ]


def no_file_is_too_long(tree):
    return [
        f"{path} has {lines} lines; at most {longest}"
        for path, text in tree.sources()
        # A test file may hold the cases of one long source whole.
        for longest in [LONGEST_TEST_FILE if path.startswith("tests/") else LONGEST_FILE]
        if (lines := text.count("\n")) > longest
    ]


def no_path_of_a_machine(tree):
    return [
        f"{path}:{number}: holds a path of one machine: {line.strip()[:80]}"
        for path, text in sorted(tree.files.items())
        for number, line in enumerate(text.splitlines(), 1)
        if MACHINE_PATH.search(line)
    ]


CHECKS = (
    dds_stays_in_the_bus,
    heavy_headers_stay_in_sources,
    cores_do_not_know_each_other,
    cores_do_not_know_the_bus,
    arrows_point_one_way,
    every_source_has_its_licence,
    no_file_is_too_long,
    no_path_of_a_machine,
)

HEAD = f"// {SPDX}\n// Copyright the Trigpoint developers\n"
SLASH = "/"  # so that this file holds no such path itself


def sound_tree():
    return {
        "components/CMakeLists.txt": "add_subdirectory(base)\nadd_subdirectory(bus)\nadd_subdirectory(lio_mapper)\nadd_subdirectory(fusion_gate)\n",
        "components/base/include/trigpoint/base/pose.hpp": HEAD + "#include <Eigen/Core>\n",
        "components/bus/src/cdr.cpp": HEAD + "#include <fastcdr/Cdr.h>\n#include \"trigpoint/bus/convert.hpp\"\n",
        "components/lio_mapper/src/map.cpp": HEAD + "#include <pcl/io/pcd_io.h>\n#include \"trigpoint/base/pose.hpp\"\n",
        "components/fusion_gate/process/main.cpp": HEAD + "#include \"sensor_msgs.h\"\n#include \"trigpoint/bus/bus.hpp\"\n",
        "components/cli/src/record.cpp": HEAD + "#include \"trigpoint/bus/cdr.hpp\"\n",
        "README.md": f"docker: WORKDIR ${{HOME}}{SLASH}work/src, https://example.org{SLASH}root/x\n",
    }


PLANTED = (
    (dds_stays_in_the_bus, "components/lio_mapper/src/map.cpp", HEAD + "#include <fastdds/dds/domain/DomainParticipant.hpp>\n"),
    (dds_stays_in_the_bus, "components/lio_mapper/src/map.cpp", HEAD + "#include <fastcdr/Cdr.h>\n"),
    (dds_stays_in_the_bus, "components/cli/src/play.cpp", HEAD + "#include \"sensor_msgs.h\"\n"),
    (dds_stays_in_the_bus, "components/cli/src/play.cpp", HEAD + "  #  include \"trigpoint/bus/topics.hpp\"\n"),
    (heavy_headers_stay_in_sources, "components/base/include/trigpoint/base/log.hpp", HEAD + "#include <spdlog/spdlog.h>\n"),
    (heavy_headers_stay_in_sources, "components/base/include/trigpoint/base/log.hpp", HEAD + "#include <sqlite3.h>\n"),
    (cores_do_not_know_each_other, "components/fusion_gate/src/gate.cpp", HEAD + "#include \"trigpoint/lio_mapper/lio_mapper.hpp\"\n"),
    (cores_do_not_know_the_bus, "components/fusion_gate/src/gate.cpp", HEAD + "#include \"trigpoint/bus/cdr.hpp\"\n"),
    (arrows_point_one_way, "components/base/src/pose.cpp", HEAD + "#include \"trigpoint/bus/cdr.hpp\"\n"),
    (every_source_has_its_licence, "tests/unit/base/pose_test.cpp", "#include <gtest/gtest.h>\n"),
    (no_file_is_too_long, "components/base/src/pose.cpp", HEAD + "\n" * LONGEST_FILE),
    (no_path_of_a_machine, "bringup/run", f"cd {SLASH}work/main\n"),
    (no_path_of_a_machine, "README.md", f"see `{SLASH}root/.config`\n"),
)


def self_test():
    failures = [
        f"{check.__name__} complains about a sound tree: {sentence}"
        for check in CHECKS
        for sentence in check(Tree(sound_tree()))
    ]
    for check, path, text in PLANTED:
        if not check(Tree(sound_tree() | {path: text})):
            failures.append(f"{check.__name__} does not see the violation planted in {path}: {text.splitlines()[-1]}")
    unplanted = set(CHECKS) - {check for check, _, _ in PLANTED}
    failures += [f"{check.__name__} has no planted violation" for check in unplanted]
    return failures


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("root", nargs="?")
    parser.add_argument("--check", choices=[check.__name__ for check in CHECKS])
    parser.add_argument("--self-test", action="store_true")
    arguments = parser.parse_args()
    if arguments.self_test:
        failures = self_test()
    elif arguments.root:
        tree = Tree.of_repository(arguments.root)
        if not list(tree.sources()):
            sys.exit(f"{arguments.root} has no tracked source files")
        failures = [s for check in CHECKS if arguments.check in (None, check.__name__) for s in check(tree)]
    else:
        parser.error("give the root of the repository, or --self-test")
    print("\n".join(failures) or "in order")
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
