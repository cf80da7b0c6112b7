#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""The type hashes that our endpoints announce (components/bus/src/type_hash.cpp), computed anew from the IDL:
the SHA-256 of a type's description with those of the types in it, as JSON (REP 2016; RIHS01). The types of
ROS 2 must also have the hashes that ROS 2's own packages announce.

    type_hash_test.py           compares
    type_hash_test.py --print   prints what is to stand in type_hash.cpp
"""
import glob
import hashlib
import json
import os
import re
import sys

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
PRIMITIVES = {"int8": 2, "uint8": 3, "int16": 4, "uint16": 5, "int32": 6, "uint32": 7, "int64": 8, "uint64": 9,
              "float": 10, "double": 11, "boolean": 15, "octet": 16, "string": 17}
NESTED, ARRAY, SEQUENCE = 1, 48, 144  # the latter two are added to the number of what is in them
# Bytes on the wire either way; ROS 2 calls this one `byte`.
OCTETS = {("diagnostic_msgs/msg/DiagnosticStatus", "level")}
PUBLISHED = {
    "builtin_interfaces/msg/Time": "b106235e25a4c5ed35098aa0a61a3ee9c9b18d197f398b0e4206cea9acf9c197",
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "geometry_msgs/msg/TwistWithCovarianceStamped": "77b67434531e6529b7a0091357b186b6ebdb17fd9ffd3e0c7ce9d3fb11a44563",
    "nav_msgs/msg/Odometry": "3cc97dc7fb7502f8714462c526d369e35b603cfc34d946e3f2eda2766dfec6e0",
    "rosgraph_msgs/msg/Clock": "692f7a66e93a3c83e71765d033b60349ba68023a8c689a79e48078bcb5c58564",
    "sensor_msgs/msg/Imu": "7d9a00ff131080897a5ec7e26e315954b8eae3353c3f995c55faf71574000b5b",
    "sensor_msgs/msg/NavSatFix": "62223ab3fe210a15976021da7afddc9e200dc9ec75231c1b6a557fc598a65404",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
}


def structs():
    """Type to its fields, each (IDL type, name)."""
    found = {}
    for name in glob.glob(os.path.join(ROOT, "idl", "*.idl")):
        with open(name, encoding="utf-8") as file:
            text = re.sub(r"//.*|^#.*", "", file.read(), flags=re.M)
        package = re.search(r"module (\w+)", text).group(1)
        for struct, body in re.findall(r"struct (\w+)\s*\{(.*?)\}\s*;", text, flags=re.S):
            fields = [tuple(field.split()) for field in body.split(";") if field.strip()]
            found[f"{package}/msg/{struct}"] = [
                ("octet", name) if (f"{package}/msg/{struct}", name) in OCTETS else (kind, name) for kind, name in fields]
    return found


def described_field(kind, name):
    """As ROS 2 describes it; it allows no capitals in names."""
    offset, capacity = 0, 0
    sequence, array = re.fullmatch(r"sequence<(.*)>", kind), re.fullmatch(r"(\w+)\[(\d+)\]", name)
    if sequence:
        kind, offset = sequence.group(1), SEQUENCE
    if array:
        name, capacity, offset = array.group(1), int(array.group(2)), ARRAY
    nested = "" if kind in PRIMITIVES else kind.replace("::", "/")
    return {"name": name.lower(),
            "type": {"type_id": PRIMITIVES.get(kind, NESTED) + offset, "capacity": capacity, "string_capacity": 0, "nested_type_name": nested}}


def described(types, name):
    return {"type_name": name, "fields": [described_field(*field) for field in types[name]]}


def inner_types(types, name, seen):
    for field in described(types, name)["fields"]:
        inner = field["type"]["nested_type_name"]
        if inner and inner not in seen:
            seen.add(inner)
            inner_types(types, inner, seen)
    return sorted(seen)


def hash_of(types, name):
    whole = {"type_description": described(types, name),
             "referenced_type_descriptions": [described(types, inner) for inner in inner_types(types, name, set())]}
    return hashlib.sha256(json.dumps(whole).encode()).hexdigest()


def announced():
    """DDS type name to hash, as type_hash.cpp has them."""
    with open(os.path.join(ROOT, "components", "bus", "src", "type_hash.cpp"), encoding="utf-8") as file:
        return dict(re.findall(r'\{"([\w:]+)",\s*"RIHS01_([0-9a-f]{64})"\}', file.read()))


def written_types():
    """All that a topic of ours has, by type_ops.cpp."""
    with open(os.path.join(ROOT, "components", "bus", "src", "type_ops.cpp"), encoding="utf-8") as file:
        return sorted(set(re.findall(r'TRIGPOINT_BUS_TYPE\([\w:]+,\s*"([\w/]+)"\)', file.read())))


def dds_name(ros_type):
    package, _, name = ros_type.split("/")
    return f"{package}::msg::dds_::{name}_"


def main(prints):
    types = structs()
    computed = {dds_name(name): hash_of(types, name) for name in written_types()}
    if prints:
        print("\n".join(f'      {{"{name}",\n       "RIHS01_{value}"}},' for name, value in computed.items()))
        return 0
    faults = [f"{name}: ROS 2 announces {value}, from our IDL comes {hash_of(types, name)}"
              for name, value in PUBLISHED.items() if hash_of(types, name) != value]
    faults += [f"type_hash.cpp has {announced().get(name)} for {name}, from the IDL comes {value}: --print says what is to stand there"
               for name, value in computed.items() if announced().get(name) != value]
    print("\n".join(faults) or f"{len(computed)} types, {len(PUBLISHED)} hashes of ROS 2: as announced")
    return 1 if faults or not computed else 0


if __name__ == "__main__":
    sys.exit(main("--print" in sys.argv))
