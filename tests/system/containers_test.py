#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""What docs/docker.md says, done: the image is built on a base from debootstrap, the services of the compose
file run with the options that they have there, and a drive goes through them.

    containers_test.py files                the compose files: merged, and read by compose where it is there
    containers_test.py drive BUILD [--engine docker|podman|buildah]
                                            the image from the programs of BUILD, which must be for this Debian
    containers_test.py drive BUILD --whole  the image as docker/Dockerfile builds it, compiler and all

Exit code 77: skipped, the reason is the last line.
"""
import argparse
import os
import re
import shutil
import signal
import subprocess
import sys
import tempfile
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
sys.path.insert(0, os.path.join(ROOT, "tests", "system", "containers"))
sys.dont_write_bytecode = True
import compose  # noqa: E402
import engine as engines  # noqa: E402
from engine import run, skip, wait_until  # noqa: E402

PROCESSES = {"gps_odometry": "trigpoint_gps_eskf18", "lio_mapper": "trigpoint_lio_mapper", "fusion_gate": "trigpoint_fusion_gate"}
USER = "1000:1000"
HEALTHY_S = 60  # three programs start on two cores that have other work
RESTARTED_S = 20
LARGEST_RMSE_M = 0.25  # of fused.tum; the main job's test promises as much for this drive
FEWEST_MAP_POINTS = 100_000
DEBIAN = "bookworm"


def check(holds, sentence):
    if not holds:
        raise AssertionError(sentence)


# ---- the files ----------------------------------------------------------------------------------


def check_files():
    alone = compose.services(["compose.yaml"], {})
    lan = compose.services(["compose.yaml", "compose.lan.yaml"], {})
    check(set(alone) == {"session", "clock_watch", *PROCESSES}, f"services are {set(alone)}")
    for name, service in lan.items():
        compose.run_options(service)
        check(service["network_mode"] == "host", f"{name} must be on the host's network")
        check(service["user"] == USER, f"{name} runs as {service['user']}")
    for name in (*PROCESSES, "clock_watch"):
        check("healthcheck" in alone[name], f"{name} has no health check")
        check(alone[name]["restart"].startswith("on-failure:"), f"{name} is restarted without end")
        check(alone[name]["depends_on"] == {"session": {"condition": "service_completed_successfully"}}, f"{name} does not wait for the session")
    check(alone["session"]["restart"] == "no", "a wrong configuration must not be tried again")
    check(all("profiles" not in alone[name] for name in PROCESSES), "one computer runs all three")
    check(lan["session"]["environment"]["TRIGPOINT_PROFILE"] == "lan", "two computers need the profile")
    where = {name: lan[name]["profiles"] for name in (*PROCESSES, "clock_watch")}
    check(where == {"gps_odometry": ["base"], "fusion_gate": ["base"], "lio_mapper": ["robot"], "clock_watch": ["robot", "base"]}, f"{where}")

    readers = [reader for reader in (["docker", "compose"], ["docker-compose"])
               if shutil.which(reader[0]) and run([*reader, "version"], check=False).returncode == 0]
    for reader in readers:
        for files, profile in ((["compose.yaml"], "robot"), (["compose.yaml", "compose.lan.yaml"], "base")):
            command = [*reader] + [word for file in files for word in ("-f", os.path.join(compose.FOLDER, file))]
            text = run([*command, "--profile", profile, "config"]).stdout
            check("trigpoint_fusion_gate" in text, f"{' '.join(reader)} reads {files} as\n{text}")
    print("read by: " + (", ".join(" ".join(reader) for reader in readers) or "this test only; no compose is installed"))


# ---- the image ----------------------------------------------------------------------------------


def make_base(tar):
    """Debian as debootstrap makes it; kept in `tar`, since it takes minutes."""
    if os.path.exists(tar):
        return
    with tempfile.TemporaryDirectory(dir="/var/tmp") as folder:
        result = run(["debootstrap", "--variant=minbase", DEBIAN, folder + "/root"], check=False, timeout=1200)
        if result.returncode != 0:
            skip("debootstrap made no base: " + result.stdout.strip().splitlines()[-1])
        run(["tar", "-C", folder + "/root", "--exclude=./var/cache/apt/archives/*.deb", "-cf", tar + ".part", "."], timeout=300)
    os.rename(tar + ".part", tar)


def dockerfile(base, programs=""):
    """The project's, on our base; with `programs`, an image that has them, in place of its first stage."""
    with open(os.path.join(compose.FOLDER, "Dockerfile"), encoding="utf-8") as file:
        text = file.read()
    build, froms, last = text.partition("\nFROM docker.io/library/debian:bookworm-slim\n")
    check(froms and build.count("FROM ") == 1, "docker/Dockerfile has not the two stages that this test knows")
    if programs:
        build = f"FROM {programs} AS build\n"
    return (build + froms + last).replace("docker.io/library/debian:bookworm-slim", base)


def import_programs(engine, build, folder, image):
    """What the first stage would leave in /opt/trigpoint, from our own build folder."""
    prefix = os.path.join(folder, "programs", "opt", "trigpoint")
    run(["cmake", "--install", build, "--prefix", prefix, "--strip"], timeout=300)
    packages = run([os.path.join(ROOT, "bringup", "install-dependencies"), "--list-run", prefix + "/bin"]).stdout
    with open(prefix + "/packages.txt", "w", encoding="utf-8") as file:
        file.write(packages)
    tar = os.path.join(folder, "programs.tar")
    run(["tar", "-C", os.path.join(folder, "programs"), "-cf", tar, "opt/trigpoint/bin", "opt/trigpoint/share", "opt/trigpoint/packages.txt"])
    engine.import_base(tar, image)


def build_image(engine, build, folder, base, whole):
    tag = base.rpartition("-")[0]
    programs = "" if whole else tag + "-programs"
    if programs:
        import_programs(engine, build, folder, programs)
    file = os.path.join(folder, "Dockerfile")
    with open(file, "w", encoding="utf-8") as output:
        output.write(dockerfile(base, programs))
    begin = time.monotonic()
    engine.build(file, ROOT, tag, timeout=14400 if whole else 1500)
    print(f"image: {'all of docker/Dockerfile' if whole else 'from the programs of the build folder'}, {time.monotonic() - begin:.0f} s")
    return tag


# ---- the services -------------------------------------------------------------------------------


class Services:
    """Those of the compose files on one computer, with the options that they have there."""

    def __init__(self, engine, image, folder, computer="here", files=("compose.yaml",), **environment):
        self.engine, self.image, self.files = engine, image, files
        self.sessions = os.path.join(folder, "sessions-" + computer)
        self.prefix = f"trigpoint-test-{os.getpid()}-{computer}-"
        self.environment = {"TRIGPOINT_SESSIONS": self.sessions, **environment}
        self.network = ""  # in place of the host's
        os.mkdir(self.sessions)
        os.chown(self.sessions, 1000, 1000)

    def name(self, service):
        return self.prefix + service

    def of_files(self, service, without=(), **changes):
        found = compose.services(self.files, {**self.environment, **changes})[service]
        if self.network:
            found["network_mode"] = self.network
        return {key: value for key, value in found.items() if key not in without}

    def session(self, **changes):
        """Its output and exit code."""
        service = self.of_files("session", without=["restart"], **changes)
        return self.engine.once(self.image, compose.run_options(service), service["command"], check=False)

    def start(self, names):
        for name in names:
            service = self.of_files(name)
            self.engine.start(self.name(name), self.image, compose.run_options(service), service["command"])
        for name in names:
            self.wait_until_healthy(name)

    def stop(self, names):
        for name in names:
            code = self.engine.stop(self.name(name))
            check(code == 0, f"{name} ended with {code}:\n{self.engine.logs(self.name(name))[-2000:]}")

    def beside(self):
        """Options of one more container, as somebody would start it by hand."""
        service = self.of_files("session")
        return compose.run_options({key: service[key] for key in ("network_mode", "user", "volumes", "environment")})

    def once(self, *command, **more):
        return self.engine.once(self.image, self.beside(), command, **more)

    def play(self, meanwhile=lambda: None):
        """The short drive, in real time."""
        command = ["trigpoint", "play", "short", "--rate", "1", "--config", "/sessions/current/config.yaml", "--session", "/sessions/current"]
        with tempfile.TemporaryFile("w+") as log:
            player = subprocess.Popen(self.engine.foreground(self.image, self.beside(), command), stdout=log, stderr=log)
            try:
                time.sleep(12.0)
                meanwhile()
                code = player.wait(120)
            finally:
                player.kill()
            log.seek(0)
            check(code == 0, f"the player ended with {code}:\n{log.read()[-2000:]}")

    def wait_until_healthy(self, name):
        wait_until(f"{name} is healthy", HEALTHY_S, lambda: self.engine.health(self.name(name)) == "healthy")


def check_faults(services, folder):
    """What a user gets wrong is said, with exit code 2, before anything begins."""
    def refused(sentence, **changes):
        result = services.session(**changes)
        check(result.returncode != 0 and sentence in result.stdout, f"{changes}: {result.returncode}, {result.stdout}")

    of_root = os.path.join(folder, "of_root")
    os.mkdir(of_root)
    refused("belongs to user 0:0 and cannot be written by 1000:1000: on the host, chown", TRIGPOINT_SESSIONS=of_root)
    wrong = os.path.join(folder, "wrong.yaml")
    with open(wrong, "w", encoding="utf-8") as file:
        file.write("bus: {leas_s: 3}\n")
    refused("bus.leas_s is not a known key; did you mean 'lease_s'?", TRIGPOINT_CONFIG=wrong)
    refused("is a folder: there was no such file on the host", TRIGPOINT_CONFIG=of_root)
    check(not os.path.lexists(services.sessions + "/current"), "a drive has begun in spite of a wrong configuration")
    first = services.once("trigpoint_service", "run", check=False)
    check(first.returncode == 2 and "the service 'session' comes first" in first.stdout, first.stdout)


def check_confinement(services):
    for name in PROCESSES:
        container = services.name(name)
        who = services.engine.execute(container, "id", "-u").stdout.split()[-1]
        check(who == "1000", f"{name} runs as user {who}")
        builders = services.engine.execute(container, "sh", "-c", "command -v g++ cmake java")
        check(builders.returncode != 0, f"the image has what only building needs: {builders.stdout}")
        if not services.engine.keeps_running:
            continue
        with open(f"/proc/{services.engine.pid(container)}/status", encoding="utf-8") as file:
            status = file.read()
        check(re.search(r"CapEff:\s0+\n", status), f"{name} has capabilities: {status}")
        check(re.search(r"NoNewPrivs:\s1", status), f"{name} may gain privileges")
        check(services.engine.execute(container, "touch", "/opt/trigpoint/bin/x").returncode != 0, f"{name} may write into the image")


def check_seen_from_host(build, domain):
    """Between a root process of the host and those of the containers: sockets only."""
    seen = run([build + "/bin/trigpoint", "doctor", "--seconds", "4"], check=False, env=dict(os.environ, ROS_DOMAIN_ID=domain)).stdout
    for topic in ("gps/odometry", "lio/odometry", "fusion/odometry"):
        check(re.search(rf"^{topic} .* 1 writer ", seen, re.M), f"the host does not see {topic}:\n{seen}")


def program_in(engine, container):
    """The process below the supervisor, on the host; None between two lives."""
    return next(iter(engines.children(engine.pid(container))), None)


def kill_some(services):
    """In the middle of the drive: the mapper's program, and the whole container of the gate."""
    engine = services.engine
    mapper = services.name("lio_mapper")
    killed = program_in(engine, mapper)
    os.kill(killed, signal.SIGKILL)
    wait_until("the mapper's program is there again", RESTARTED_S, lambda: program_in(engine, mapper) not in (killed, None))
    if not engine.keeps_running:
        return
    check(engine.restarts(mapper) == 0, "the mapper's container was restarted, not its program")
    gate = services.name("fusion_gate")
    os.kill(engine.pid(gate), signal.SIGKILL)
    wait_until("the gate's container is there again", RESTARTED_S, lambda: engine.restarts(gate) == 1 and engine.is_running(gate))
    services.wait_until_healthy("fusion_gate")


def check_hang(services):
    """With its supervisor stopped too, a program that hangs is told from one that lives."""
    for name in PROCESSES:
        container = services.name(name)
        stopped = [services.engine.pid(container), program_in(services.engine, container)]
        for process in stopped:
            os.kill(process, signal.SIGSTOP)
        said = services.engine.execute(container, "trigpoint_service", "healthy")
        for process in reversed(stopped):
            os.kill(process, signal.SIGCONT)
        check(said.returncode != 0 and "runs, but said nothing" in said.stdout, f"health of {name}, which hangs: {said.returncode}, {said.stdout}")
    for name in PROCESSES:
        services.wait_until_healthy(name)


def check_session(session, more):
    wanted = {"config.yaml", "datum.yaml", "fused.tum", "gps.tum", "lio.tum", "keyframes.sqlite", "map.pcd", "report.html", "trajectories.png", *more}
    check(wanted <= set(os.listdir(session)), f"the session lacks {wanted - set(os.listdir(session))}")
    with open(session + "/report.md", encoding="utf-8") as file:
        text = file.read()
    rmse = float(re.search(r"^\| fused\.tum +\| +none \| +([0-9.]+)", text, re.M)[1])
    points = int(re.search(r"map\.pcd\): (\d+) points", text)[1])
    missed = re.search(r"^Scans missed: \d+", text, re.M)
    print(f"fused.tum: {rmse} m off; map.pcd: {points} points; {missed[0] if missed else 'no scans missed'}", flush=True)
    check(rmse < LARGEST_RMSE_M, "the fused trajectory is wrong")
    check(points > FEWEST_MAP_POINTS, "the map is too small")


def check_restart_is_told(session):
    owners = {os.stat(os.path.join(session, name)).st_uid for name in os.listdir(session)}
    check(owners == {1000}, f"files of the session belong to {owners}")
    with open(session + "/report.md", encoding="utf-8") as file:
        check(re.search(r"## Restarts.*trigpoint_lio_mapper", file.read(), re.S), "the report does not list the mapper's restart")


def robot_yaml(build, folder):
    """Only what differs from the defaults on the robot of the short drive, as docs/docker.md wants it."""
    import yaml
    default, short = (yaml.safe_load(run([build + "/bin/trigpoint", "config", *more]).stdout) for more in ((), ("--for", "short")))
    differs = {section: {key: value for key, value in keys.items() if value != default[section][key]} for section, keys in short.items()}
    file = os.path.join(folder, "robot.yaml")
    with open(file, "w", encoding="utf-8") as output:
        yaml.safe_dump({section: keys for section, keys in differs.items() if keys}, output)
    return file


def one_computer(engine, image, build, folder, config, domain):
    services = Services(engine, image, folder, ROS_DOMAIN_ID=domain, TRIGPOINT_CONFIG=config)
    check_faults(services, folder)
    begun = services.session()
    check(begun.returncode == 0, begun.stdout)
    services.start(PROCESSES)
    check_confinement(services)
    check_seen_from_host(build, domain)
    joined = services.session()
    check(joined.returncode == 0 and "is going on" in joined.stdout, f"a second drive began beside the first: {joined.stdout}")
    print("one computer: healthy, not root, seen from the host", flush=True)
    services.play(meanwhile=lambda: kill_some(services))
    check_hang(services)
    services.stop(PROCESSES)
    report = services.once("trigpoint", "report", "/sessions/current", timeout=300, check=False)
    check(report.returncode == 0, f"trigpoint report ended with {report.returncode}:\n{report.stdout[-3000:]}")
    check_session(os.path.realpath(services.sessions + "/current"), ["restarts.csv"])
    check_restart_is_told(os.path.realpath(services.sessions + "/current"))


# ---- two computers ------------------------------------------------------------------------------


def connect(engine, image):
    """Two networks with a cable between them, each held by a container that does nothing; their names."""
    names = [f"trigpoint-test-{os.getpid()}-network-{number}" for number in (1, 2)]
    for name in names:
        engine.start(name, image, ["--network", "none"], ["sleep", "infinity"])
    pids = [str(engine.pid(name)) for name in names]
    ends = [f"tp{os.getpid()}a", f"tp{os.getpid()}b"]
    run(["ip", "link", "add", ends[0], "type", "veth", "peer", "name", ends[1]])
    for number, (pid, end) in enumerate(zip(pids, ends), start=1):
        run(["ip", "link", "set", end, "netns", pid])
        inside = ["nsenter", "-t", pid, "-n", "ip"]
        run([*inside, "addr", "add", f"10.78.0.{number}/24", "dev", end])
        run([*inside, "link", "set", end, "up"])
        run([*inside, "link", "set", "lo", "up"])
    return names


def two_computers(engine, image, build, folder, config):
    """compose.lan.yaml: all as in the files, but the networks in place of the host's."""
    roles = {"robot": ["lio_mapper", "clock_watch"], "base": ["gps_odometry", "fusion_gate", "clock_watch"]}
    computers = {}
    for (name, started), network in zip(roles.items(), connect(engine, image)):
        services = Services(engine, image, folder, name, ("compose.yaml", "compose.lan.yaml"), TRIGPOINT_CONFIG=config, TRIGPOINT_HOST=name)
        services.network = "container:" + network
        begun = services.session()
        check(begun.returncode == 0 and begun.stdout.rstrip().endswith("-" + name), begun.stdout)
        with open(services.sessions + "/current/config.yaml", encoding="utf-8") as file:
            check("datagram_bytes: 1472" in file.read(), "the profile for two computers was not used")
        services.start(started)
        computers[name] = services
    print("two computers: healthy", flush=True)
    computers["robot"].play()
    for name, services in computers.items():
        services.stop(roles[name])
    whole = os.path.join(folder, "whole")
    parts = [os.path.realpath(services.sessions + "/current") for services in computers.values()]
    run([os.path.join(ROOT, "bringup", "collect"), whole, *parts], timeout=300, env=dict(os.environ, TRIGPOINT_BIN=build + "/bin"))
    clocks = [f"clock.{os.path.basename(part)}.csv" for part in parts]
    check_session(whole, clocks)


def drive(engine, image, build, folder):
    config = robot_yaml(build, folder)
    one_computer(engine, image, build, folder, config, domain=str(60 + os.getpid() % 40))
    if engine.keeps_running:
        two_computers(engine, image, build, folder, config)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=["files", "drive"])
    parser.add_argument("build", nargs="?", default="")
    parser.add_argument("--engine", choices=["", "docker", "podman", "buildah"], default="")
    parser.add_argument("--whole", action="store_true")
    arguments = parser.parse_args()
    try:
        import yaml  # noqa: F401
    except ImportError:
        skip("this python has no yaml (Debian package python3-yaml)")
    if arguments.what == "files":
        return check_files()
    build = os.path.abspath(arguments.build)
    if not any(map(shutil.which, ("docker", "podman", "buildah"))):
        skip("there is no docker, podman or buildah")
    if os.geteuid() != 0 or not shutil.which("debootstrap"):
        skip("a base is made with debootstrap, by root")
    with open("/etc/os-release", encoding="utf-8") as file:
        if f"VERSION_CODENAME={DEBIAN}" not in file.read() and not arguments.whole:
            skip(f"the programs of this build are not for Debian {DEBIAN}")
    make_base(build + "/debian-base.tar")
    base = f"localhost/trigpoint-test-{os.getpid()}-base"
    with tempfile.TemporaryDirectory(dir="/var/tmp", prefix="trigpoint-containers-", ignore_cleanup_errors=True) as folder:
        os.chmod(folder, 0o755)
        engine = engines.find(folder, build + "/debian-base.tar", base, arguments.engine)
        if engine is None:
            engines.unmount_below(folder)
            skip("no container engine can start a process here")
        print(f"engine: {engine.name}" + ("" if engine.keeps_running else "; restarts of containers, capabilities and two computers are not tested"), flush=True)
        try:
            drive(engine, build_image(engine, build, folder, base, arguments.whole), build, folder)
        finally:
            engine.clean()
            engines.unmount_below(folder)


if __name__ == "__main__":
    main()
