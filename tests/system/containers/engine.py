# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""Container engines: docker with its daemon, podman with whichever runtime works here, or else buildah, which
builds and starts processes but neither restarts them nor asks for their health."""
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time


def run(command, check=True, timeout=120, **more):
    """Its output, standard error included."""
    result = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, timeout=timeout, **more)
    if check and result.returncode != 0:
        raise RuntimeError(f"{' '.join(command)} ended with {result.returncode}:\n{result.stdout[-4000:]}")
    return result


def children(process):
    """Of all its threads, as numbers on the host."""
    found = []
    for thread in os.listdir(f"/proc/{process}/task"):
        with open(f"/proc/{process}/task/{thread}/children", encoding="utf-8") as file:
            found += map(int, file.read().split())
    return found


class Engine:
    """docker or podman: one command line."""

    def __init__(self, command, name):
        self.command, self.name, self.containers, self.images = command, name, [], []
        self.keeps_running = True  # restarts and health checks

    def __call__(self, *arguments, **more):
        return run([*self.command, *arguments], **more)

    def import_base(self, tar, image):
        self.images.append(image)
        self("import", tar, image, timeout=600)

    def build(self, dockerfile, context, image, timeout):
        self.images.append(image)
        # BuildKit needs a plugin that Debian does not have.
        environment = dict(os.environ, DOCKER_BUILDKIT="0")
        return self("build", "--network", "host", "-f", dockerfile, "-t", image, context, timeout=timeout, env=environment)

    def foreground(self, image, options, command):
        """The command line that runs it to its end."""
        return [*self.command, "run", "--rm", *options, image, *command]

    def once(self, image, options, command, **more):
        return run(self.foreground(image, options, command), **more)

    def start(self, name, image, options, command):
        self.containers.append(name)
        self("run", "-d", "--name", name, *options, image, *command)

    def inspect(self, name):
        return json.loads(self("inspect", name).stdout)[0]

    def execute(self, name, *command):
        return self("exec", name, *command, check=False)

    def is_running(self, name):
        return self.inspect(name)["State"]["Status"] == "running"

    def restarts(self, name):
        return self.inspect(name)["RestartCount"]

    def pid(self, name):
        """Of its main process, on the host."""
        return self.inspect(name)["State"]["Pid"]

    def health(self, name):
        return self.inspect(name)["State"]["Health"]["Status"]

    def logs(self, name):
        return self("logs", name).stdout

    def stop(self, name):
        """Its exit code."""
        self("stop", name)
        return self.inspect(name)["State"]["ExitCode"]

    def clean(self):
        for name in self.containers:
            self("rm", "-f", name, check=False)
        for image in reversed(self.images):
            self("rmi", "-f", image, check=False)


class Podman(Engine):
    """In a store of its own below `folder`."""

    def __init__(self, folder, runtime):
        root = ["--root", os.path.join(folder, "store"), "--runroot", os.path.join(folder, "run")]
        super().__init__(["podman", *root, "--cgroup-manager", "cgroupfs", "--runtime", runtime], f"podman with {runtime}")
        # Its own limits are higher than what a root without CAP_SYS_RESOURCE may set.
        settings = os.path.join(folder, "containers.conf")
        with open(settings, "w", encoding="utf-8") as file:
            file.write("[containers]\ndefault_ulimits=[]\n[engine]\nevents_logger=\"file\"\n")
        os.environ["CONTAINERS_CONF"] = settings
        # Without systemd nobody starts the health checks: health() does it.
        self.by_hand = not os.path.isdir("/run/systemd/system")
        if self.by_hand:
            os.environ["DISABLE_HC_SYSTEMD"] = "true"

    def health(self, name):
        if self.by_hand:
            return "healthy" if self("healthcheck", "run", name, check=False).returncode == 0 else "unhealthy"
        return super().health(name)


class Buildah:
    """Processes in the image's files (--isolation chroot), on the host's network and process numbers."""

    def __init__(self, folder):
        self.command = ["buildah", "--root", os.path.join(folder, "store"), "--runroot", os.path.join(folder, "run")]
        self.name, self.keeps_running, self.running, self.working = "buildah with chroot isolation", False, {}, []

    def __call__(self, *arguments, **more):
        return run([*self.command, *arguments], **more)

    def import_base(self, tar, image):
        container = self("from", "scratch").stdout.split()[-1]  # after warnings
        self("add", "-q", container, tar, timeout=600)
        self("commit", "-q", "--rm", container, image, timeout=600)

    def build(self, dockerfile, context, image, timeout):
        return self("build", "--isolation", "chroot", "--pull-never", "-f", dockerfile, "-t", image, context, timeout=timeout)

    def foreground(self, image, options, command):
        """Of the options it has those that chroot isolation knows."""
        container = self("from", "--pull-never", image, timeout=600).stdout.split()[-1]
        self.working.append(container)
        arguments, iterator = [], iter(options)
        for option in iterator:
            if option == "--user":
                arguments += ["--user", next(iterator)]
            elif option in ("-v", "--volume"):
                arguments += ["-v", next(iterator)]
            elif option == "-e":
                arguments += ["--env", next(iterator)]
            elif option == "--mount":
                parts = dict(part.partition("=")[::2] for part in next(iterator).split(","))
                arguments += ["-v", f"{parts['source']}:{parts['target']}:ro"]
            elif option != "--read-only":
                next(iterator)
        return [*self.command, "run", "--isolation", "chroot", *arguments, container, "--", *command]

    def once(self, image, options, command, **more):
        return run(self.foreground(image, options, command), **more)

    def start(self, name, image, options, command):
        log = tempfile.TemporaryFile("w+", encoding="utf-8")
        process = subprocess.Popen(self.foreground(image, options, command), stdout=log, stderr=log, start_new_session=True)
        self.running[name] = (process, log, image, options)

    def execute(self, name, *command):
        _, _, image, options = self.running[name]
        return self.once(image, options, command, check=False)

    def is_running(self, name):
        return self.running[name][0].poll() is None

    def pid(self, name):
        """Of the supervisor below buildah's own processes."""
        below = [self.running[name][0].pid]
        for process in below:  # which grows
            with open(f"/proc/{process}/cmdline", encoding="utf-8") as file:
                if file.read().split("\0")[0] == "trigpoint_supervise":
                    return process
            below += children(process)
        raise RuntimeError(f"{name}: no trigpoint_supervise below {below}")

    def health(self, name):
        return "healthy" if self.execute(name, "trigpoint_service", "healthy").returncode == 0 else "unhealthy"

    def logs(self, name):
        log = self.running[name][1]
        log.seek(0)
        return log.read()

    def stop(self, name):
        os.kill(self.pid(name), signal.SIGTERM)
        return self.running[name][0].wait(60)

    def clean(self):
        for process, log, _, _ in self.running.values():
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
                process.wait()
            log.close()
        for container in self.working:
            self("rm", container, check=False)


def unmount_below(folder):
    """What podman and buildah leave mounted on their stores, which are to be removed."""
    with open("/proc/mounts", encoding="utf-8") as file:
        mounts = [line.split()[1] for line in file]
    for mount in sorted((mount for mount in mounts if mount.startswith(folder + "/")), reverse=True):
        run(["umount", mount], check=False)


def works(engine, image):
    try:
        return engine.once(image, ["--network", "host", "--user", "1000"], ["id", "-u"]).stdout.split()[-1:] == ["1000"]
    except (RuntimeError, subprocess.TimeoutExpired) as error:
        print(f"{engine.name} does not work here: {str(error).splitlines()[-1]}")
        return False


def find(folder, tar, image, only=""):
    """The first engine that can start a process of the image that is in `tar`, or None."""
    candidates = []
    if shutil.which("docker") and run(["docker", "info"], check=False).returncode == 0:
        candidates.append(("docker", lambda: Engine(["docker"], "docker")))
    if shutil.which("podman"):
        candidates += [("podman", lambda runtime=runtime: Podman(folder, runtime)) for runtime in ("crun", "runc") if shutil.which(runtime)]
    if shutil.which("buildah"):
        candidates.append(("buildah", lambda: Buildah(folder)))
    for name, make in candidates:
        if only in ("", name):
            engine = make()
            try:
                engine.import_base(tar, image)
            except RuntimeError as error:
                print(f"{engine.name} does not work here: {str(error).splitlines()[-1]}")
                continue
            if works(engine, image):
                return engine
            engine.clean()
    return None


def wait_until(what, limit_s, happened):
    end = time.monotonic() + limit_s
    while not happened():
        if time.monotonic() > end:
            raise AssertionError(f"not within {limit_s} s: {what}")
        time.sleep(0.5)


def skip(reason):
    print(f"SKIPPED, nothing was tested: {reason}")
    sys.exit(77)
