# SPDX-License-Identifier: Apache-2.0
# Copyright the Trigpoint developers
"""What a compose file says, as options of `docker run` and `podman run`. A key that is not known here is an
error, so nothing in the file goes untested."""
import os
import re

FOLDER = os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "..", "..", "docker")
# What compose itself does with a service; the tests do it by hand.
OF_COMPOSE = {"image", "build", "depends_on", "profiles", "container_name", "command"}


def interpolated(tree, environment):
    """As compose does it in every text, once the file is parsed: ${NAME} and ${NAME:-default}."""
    if isinstance(tree, dict):
        return {key: interpolated(value, environment) for key, value in tree.items()}
    if isinstance(tree, list):
        return [interpolated(value, environment) for value in tree]
    if not isinstance(tree, str):
        return tree
    return re.sub(r"\$\{(\w+)(?::-([^}]*))?\}", lambda match: environment.get(match[1]) or match[2] or "", tree)


def merged(base, over):
    """As compose lays one file over another: maps key by key, all else replaced."""
    if isinstance(base, dict) and isinstance(over, dict):
        return {key: merged(base[key], over[key]) if key in base and key in over else over.get(key, base.get(key))
                for key in {**base, **over}}
    return over


def services(names, environment):
    """Those of the files in docker/, the later over the earlier."""
    import yaml  # Debian package python3-yaml; who calls this has looked for it
    whole = {}
    for name in names:
        with open(os.path.join(FOLDER, name), encoding="utf-8") as file:
            whole = merged(whole, interpolated(yaml.safe_load(file), environment))
    return whole["services"]


def of_mount(mount):
    if isinstance(mount, str):
        return ["-v", mount]
    known = {"type", "source", "target", "read_only"}
    if set(mount) - known:
        raise ValueError(f"mount: unknown {set(mount) - known}")
    source = os.path.normpath(os.path.join(FOLDER, mount["source"]))
    return ["--mount", f"type={mount['type']},source={source},target={mount['target']}" + (",readonly" if mount.get("read_only") else "")]


def of_healthcheck(check):
    if check["test"][0] != "CMD":
        raise ValueError("healthcheck.test: only CMD is known")
    options = ["--health-cmd", " ".join(check["test"][1:])]
    for key in set(check) - {"test"}:
        if key not in ("interval", "timeout", "retries", "start_period"):
            raise ValueError(f"healthcheck: unknown {key}")
        options += ["--health-" + key.replace("_", "-"), str(check[key])]
    return options


def each(option, values):
    return [word for value in values for word in (option, value)]


OPTIONS = {
    "network_mode": lambda value: ["--network", value],
    "user": lambda value: ["--user", value],
    "volumes": lambda value: [word for mount in value for word in of_mount(mount)],
    "read_only": lambda value: ["--read-only"] if value else [],
    "tmpfs": lambda value: each("--tmpfs", value),
    "cap_drop": lambda value: each("--cap-drop", value),
    "security_opt": lambda value: each("--security-opt", value),
    "restart": lambda value: ["--restart", value],
    "stop_grace_period": lambda value: ["--stop-timeout", value.removesuffix("s")],
    "environment": lambda value: each("-e", [f"{key}={text}" for key, text in value.items()]),
    "healthcheck": of_healthcheck,
}


def run_options(service):
    unknown = set(service) - set(OPTIONS) - OF_COMPOSE
    if unknown:
        raise ValueError(f"the tests do not know these keys of the compose file: {unknown}")
    return [word for key, value in service.items() if key in OPTIONS for word in OPTIONS[key](value)]
