# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Two computers with a cable that can be bad, from Python: impaired_link.cpp says what it can do."""
import os
import subprocess
import sys

HOSTS = ("10.77.0.1", "10.77.0.2")  # both on a device named lan0
SKIPPED = 77  # exit code of a test that this machine cannot run


class Link:
    """The cable, and the way into both namespaces."""

    def __init__(self, build):
        self.process = subprocess.Popen([os.path.join(build, "bin", "impaired_link")], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
        words = self.process.stdout.readline().split()
        if not words or words[0] != "ready":
            print(" ".join(words) or "impaired_link does not start")
            sys.exit(SKIPPED if self.process.wait() == SKIPPED else 1)
        self.networks = words[1:]

    def order(self, lines):
        self.process.stdin.write(lines)
        self.process.stdin.flush()

    def count(self):
        """Frames, bytes, lost and dropped from the first computer; the same from the second."""
        self.order("count\n")
        return [int(word) for word in self.process.stdout.readline().split()]

    def kernel_count(self, host, protocol, name):
        """A counter of /proc/net/snmp on the first (0) or second (1) computer."""
        command = ["nsenter", f"--net={self.networks[host]}", "cat", "/proc/net/snmp"]
        lines = subprocess.run(command, stdout=subprocess.PIPE, check=True, text=True).stdout.splitlines()
        names, values = (line.split() for line in lines if line.startswith(protocol + ":"))
        return int(values[names.index(name)])

    def pieces(self):
        """Pieces of datagrams larger than a frame that came to either computer."""
        return sum(self.kernel_count(host, "Ip", "ReasmReqds") for host in range(len(self.networks)))

    def udp_received(self, host):
        """Datagrams that processes on that computer have received."""
        return self.kernel_count(host, "Udp", "InDatagrams")

    def start(self, host, command, log, environment=None):
        """A process on the first (0) or second (1) computer; its environment is ours when none is given."""
        return subprocess.Popen(["nsenter", f"--net={self.networks[host]}"] + command, stdout=log, stderr=subprocess.STDOUT, env=environment)

    def close(self):
        self.process.stdin.close()
        self.process.wait()


def as_root():
    """Network namespaces are root's; a user namespace makes one of everybody, where it is allowed."""
    if os.geteuid() != 0:
        if subprocess.run(["unshare", "-Ur", "true"], stderr=subprocess.DEVNULL, check=False).returncode != 0:
            print("no impaired link here: not root, and no user namespaces")
            sys.exit(SKIPPED)
        os.execvp("unshare", ["unshare", "-Ur", sys.executable] + sys.argv)
