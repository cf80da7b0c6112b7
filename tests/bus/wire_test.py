#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""What the bus announces and sends, read from a capture by tshark's RTPS dissector, is what ROS 2 nodes match with:
names of topics and types, QoS as in the table of idl/README.md, type hashes, and plain little-endian CDR.

    wire_test.py BUS_PEER          one vendor's bus_peer against itself
    wire_test.py --table BUS_PEER  prints what was announced

Exit code 77: tshark is not installed, or may not capture on lo.
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
sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
sys.dont_write_bytecode = True
import type_hash_test  # noqa: E402

SKIPPED = 77
LISTEN_S = 4.0  # discovery takes 0.1 s here, and every example is sent again each 20 ms
LONGEST_WAIT_S = 20.0
OPTIONAL_TOPICS = {"robot.twist_topic": "twist", "robot.yaw_topic": "yaw"}  # without a name of their own
NO_KEY = {"PUBLICATIONS": "Application-defined writer (no key)", "SUBSCRIPTIONS": "Application-defined reader (no key)"}


def own_domain():
    """Of 215 to 231, whose ports are above the ephemeral ones and which no other test uses."""
    return 215 + os.getpid() % 17


def documented_topics():
    """Topic to type, reliability, durability and depth, from the table in idl/README.md."""
    with open(os.path.join(ROOT, "idl", "README.md"), encoding="utf-8") as file:
        rows = [line.strip("|\n ").split("|") for line in file if line.startswith("| `")]
    topics = {}
    for names, types, _, _, qos in (map(str.strip, row) for row in rows):
        names = re.findall(r"`([^`]+)`", names.split(", none")[0])
        texts = qos.split(";") if ";" in qos else [qos] * len(names)
        package, name = re.match(r"(\w+)/(\w+)", types).groups()
        for topic, text in zip(names, texts):
            topics["rt/" + OPTIONAL_TOPICS.get(topic, topic)] = {
                "type": f"{package}::msg::dds_::{name}_",
                "reliability": "BEST_EFFORT" if "best effort" in text else "RELIABLE",
                "durability": "TRANSIENT_LOCAL" if "transient local" in text else "VOLATILE",
                "depth": int(re.search(r"\d+$", text).group()),
            }
    return topics


def capture(peer, file):
    """False when tshark may not capture here. A writer and a reader of every topic, in two processes."""
    first = 7400 + 250 * own_domain()  # of the domain's ports: others talk on lo too
    dumping = subprocess.Popen(["tshark", "-i", "lo", "-f", f"udp dst portrange {first}-{first + 249}", "-w", file, "-a", f"duration:{LONGEST_WAIT_S:.0f}"],
                               stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + LONGEST_WAIT_S / 2
    while not (os.path.exists(file) and os.path.getsize(file) > 0):  # the header of the file: it listens
        if dumping.poll() is not None or time.monotonic() > deadline:
            dumping.kill()
            dumping.wait()
            return False
        time.sleep(0.05)
    peers = [subprocess.Popen([peer, str(own_domain()), what]) for what in ("nothing", "everything")]
    time.sleep(LISTEN_S)
    for process in peers:
        process.kill()
        process.wait()
    dumping.send_signal(signal.SIGINT)
    dumping.wait()
    return True


def submessages(file):
    """The text of every DATA submessage of the capture."""
    text = subprocess.run(["tshark", "-r", file, "-O", "rtps", "-Y", "rtps.sm.id == 0x15"],
                          check=True, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True).stdout
    return [part for part in text.split("    submessageId: ")[1:] if part.startswith("DATA ")]


def parameters(submessage):
    """The parameters of a discovery message: name to text."""
    return {name: text for name, text in re.findall(r"^ {16}(PID_\w+|Unknown)[^\n]*\n((?: {20}[^\n]*\n?)*)", submessage, re.M)}


def value(announced, parameter, key, default=None):
    match = re.search(rf"{key}: (\S+)", announced.get(parameter, ""))
    return match.group(1) if match else default


def endpoints(data):
    """(kind, topic) to what was announced, kind PUBLICATIONS or SUBSCRIPTIONS."""
    found = {}
    for text in data:
        kind = re.search(r"writerEntityId: ENTITYID_(?:SEDP_)?BUILTIN_(PUBLICATIONS|SUBSCRIPTIONS)_WRITER", text)
        announced = parameters(text) if kind else {}
        topic = value(announced, "PID_TOPIC_NAME", "topic")
        if topic:
            found[kind.group(1), topic] = announced
    return found


def qos_of(kind, announced):
    """What is not announced has the default of DDS 1.4, 2.2.3: writers RELIABLE, readers BEST_EFFORT, both VOLATILE."""
    reliability = value(announced, "PID_RELIABILITY", "Kind", "RELIABLE" if kind == "PUBLICATIONS" else "BEST_EFFORT")
    depth = value(announced, "PID_HISTORY", "Depth")
    return {
        "type": value(announced, "PID_TYPE_NAME", "typeName"),
        "reliability": reliability.removesuffix("_RELIABILITY_QOS"),
        "durability": value(announced, "PID_DURABILITY", "Durability", "VOLATILE").removesuffix("_DURABILITY_QOS"),
        "depth": int(depth) if depth else None,
    }


def prevents_match(kind, announced):
    """What a ROS 2 node, which sets none of it, would not match or not read."""
    if value(announced, "PID_OWNERSHIP", "Kind", "SHARED").startswith("EXCLUSIVE"):
        yield "EXCLUSIVE ownership"
    if value(announced, "PID_PARTITION", "Number of partition names", "0") != "0":
        yield "a partition"
    if NO_KEY[kind] not in announced.get("PID_ENDPOINT_GUID", ""):
        yield "a topic with a key"
    if value(announced, "PID_DATA_REPRESENTATION", "Data Representation Kind", "XCDR").strip("()") not in ("XCDR", "XCDR1", "0"):
        yield "another data representation than XCDR1"
    if value(announced, "PID_DEADLINE", "lease_duration", "INFINITE") != "INFINITE":
        yield "a deadline"
    if value(announced, "PID_LIVELINESS", "lease_duration", "INFINITE") != "INFINITE":
        yield "a liveliness lease"


def differences(found, documented):
    for kind in ("PUBLICATIONS", "SUBSCRIPTIONS"):
        announced = {topic: content for (which, topic), content in found.items() if which == kind}
        for topic in sorted(set(announced) ^ set(documented)):
            yield f"{kind} {topic}: {'announced' if topic in announced else 'in idl/README.md'} only"
        for topic in sorted(set(announced) & set(documented)):
            told = qos_of(kind, announced[topic])
            for key, wanted in documented[topic].items():
                if told[key] != wanted and not (key == "depth" and told[key] is None):
                    yield f"{kind} {topic}: {key} {told[key]} announced, {wanted} in idl/README.md"
            yield from (f"{kind} {topic}: {what}" for what in prevents_match(kind, announced[topic]))


def faults_of_data(data, documented):
    """Samples by topic: all there, and in plain little-endian CDR."""
    heard = {}
    for text in data:
        topic = re.search(r"\[topic: (\S+)\]", text)
        encapsulation = re.search(r"encapsulation kind: (\S+)", text)
        if topic and encapsulation:
            heard.setdefault(topic.group(1), set()).add(encapsulation.group(1))
    for topic in documented:
        if heard.get(topic) != {"CDR_LE"}:
            yield f"{topic}: samples in {sorted(heard.get(topic, ['no encapsulation: none was seen']))}, not in CDR_LE"


def user_data(announced):
    """As far as tshark prints it: 36 bytes."""
    match = re.search(r"userData: ([0-9a-f]+)", announced.get("PID_USER_DATA", ""))
    return bytes.fromhex(match.group(1)).decode() if match else ""


def faults_of_participants(data):
    """ROS 2 reads USER_DATA as key=value; with semicolons, and wants an enclave there."""
    notes = {user_data(parameters(text)) for text in data if "PID_PARTICIPANT_LEASE_DURATION" in text} - {""}
    if not notes or not all(re.fullmatch(r"enclave=/;(\w+=\w+;)*", note) for note in notes):
        yield f"USER_DATA of participants: {sorted(notes)}"


def faults_of_hashes(found):
    """What ROS 2 since Iron shows as the type's hash, and Cyclone's layer warns of where it is not there."""
    hashes = type_hash_test.announced()
    for (kind, topic), announced in sorted(found.items()):
        wanted = f"typehash=RIHS01_{hashes.get(value(announced, 'PID_TYPE_NAME', 'typeName'))};"
        size = int(value(announced, "PID_USER_DATA", "sequenceSize", "0"))
        if size != len(wanted) or not wanted.startswith(user_data(announced)):
            yield f"{kind} {topic}: USER_DATA of {size} bytes beginning with {user_data(announced)!r}, not {wanted!r}"


def main(peer, as_table):
    if shutil.which("tshark") is None:
        print("skipped: tshark is not installed (Debian package tshark)")
        return SKIPPED
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "bus.pcapng")
        if not capture(peer, file):
            print("skipped: tshark may not capture on lo here")
            return SKIPPED
        data = submessages(file)
    found = endpoints(data)
    documented = documented_topics()
    if as_table:
        for (kind, topic), announced in sorted(found.items()):
            print(kind.lower(), topic, qos_of(kind, announced), "user data:", user_data(announced))
    faults = [*differences(found, documented), *faults_of_data(data, documented), *faults_of_participants(data), *faults_of_hashes(found)]
    depths = sum(qos_of(kind, announced)["depth"] is not None for (kind, _), announced in found.items())
    print("\n".join(faults) or f"{len(found)} endpoints on {len(documented)} topics announced as in idl/README.md "
          f"(history depth announced by {depths}), with the hashes of their types; samples of all topics in CDR_LE")
    return 1 if faults else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[-1], "--table" in sys.argv))
