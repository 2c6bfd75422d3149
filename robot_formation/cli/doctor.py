"""formation doctor: what a bug report needs, and whether the essentials are there.

What takes long to import is imported where it is needed: each start of the command line reads every verb's file.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import robot_formation
from robot_formation import paths
from robot_formation.network.shared_memory_space import SHARED_MEMORY, SharedMemoryError, require_space
from robot_formation.system.git_commit import git_commit
from robot_formation.system.standard_error import silent_stderr

# Module to import, and the distributions (of pip) that may bring it.
_MODULES = {
    "numpy": ("numpy",),
    "pybullet": ("pybullet",),
    "cv2": ("opencv-python-headless", "opencv-python"),
    "mcap": ("mcap",),
    "rosbags": ("rosbags",),
    "matplotlib": ("matplotlib",),
    "yaml": ("PyYAML",),
}
_MESSAGES = ("sensor_msgs.msg", "geometry_msgs.msg", "nav_msgs.msg", "std_srvs.srv")
_VARIABLES = ("ROS_DISTRO", "AMENT_PREFIX_PATH", "RMW_IMPLEMENTATION", "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE")

Report = dict[str, dict[str, object]]


def add_parser(subparsers: argparse._SubParsersAction[argparse.ArgumentParser]) -> None:
    """Add the verb to the command line."""
    parser = subparsers.add_parser(
        "doctor",
        help="tell what is installed and whether a run can start",
        description="Prints what a bug report needs. Exit code 0 if the essentials are there, 2 otherwise.",
    )
    parser.add_argument("--json", action="store_true", help="machine-readable, on standard output")
    parser.set_defaults(run=run)


def run(args: argparse.Namespace) -> int:
    """Print the report; 0 if a run can start, else 2 and one line on standard error that names what is missing."""
    missing: list[str] = []
    report = collect(missing)
    if args.json:
        import json

        print(json.dumps({**report, "missing": missing}, indent=2))
    else:
        for section, values in report.items():
            print(section)
            for name, value in values.items():
                print(f"  {name:<24} {'-' if value is None else value}")
    if missing:
        installs = any("installed" in text or "imported" in text for text in missing)
        hint = " (to install: pip install 'robot_formation[sim,ros]', or ./formation in a checkout)" if installs else ""
        print(f"formation doctor: a run cannot start: {'; '.join(missing)}{hint}", file=sys.stderr)
        return 2
    return 0


def collect(missing: list[str]) -> Report:
    """Gather the report, by section; what a run needs and is not there is appended to `missing`."""
    sections: dict[str, Callable[[list[str]], dict[str, object]]] = {
        "project": _project,
        "system": _system,
        "ros": _ros,
        "modules": _modules,
        "hot_loops": _hot_loops,
        "domain": _domain,
        "shared_memory": _shared_memory,
    }
    report: Report = {}
    for name, section in sections.items():
        with silent_stderr():  # pybullet greets on standard error
            report[name] = section(missing)
    return report


def _project(missing: list[str]) -> dict[str, object]:
    try:
        config: str | None = str(paths.config_dir())
    except ValueError as error:
        config = None
        missing.append(str(error))
    return {
        "version": robot_formation.__version__,
        "commit": git_commit(12) or None,
        "code": str(Path(robot_formation.__file__).parent),
        "config": config,
        "bags": str(paths.default_bags_dir()),
    }


def _system(missing: list[str]) -> dict[str, object]:
    import platform

    try:
        name = platform.freedesktop_os_release().get("PRETTY_NAME")
    except OSError:
        name = None
    return {
        "system": name,
        "kernel": f"{platform.system()} {platform.release()} {platform.machine()}",
        "cores": len(os.sched_getaffinity(0)),
        "python": platform.python_version(),
        "executable": sys.executable,
    }


def _ros(missing: list[str]) -> dict[str, object]:
    from importlib import metadata

    wheels = sorted(
        f"{distribution.name} {distribution.version}"
        for distribution in metadata.distributions()
        if distribution.name.startswith("ros-jazzy-")
    )
    report: dict[str, object] = {"wheels": ", ".join(wheels) or None}
    report.update({name: os.environ.get(name) for name in _VARIABLES})
    report["rclpy"] = report["rmw"] = None
    try:
        require_space()  # loading ROS would end this process
    except SharedMemoryError as error:
        missing.append(str(error))
        return report
    rclpy = _import("rclpy", missing)
    report["rclpy"] = getattr(rclpy, "__file__", None)
    if rclpy is not None:
        try:
            report["rmw"] = importlib.import_module("rclpy.utilities").get_rmw_implementation_identifier()
        except Exception as error:
            missing.append(f"no ROS middleware can be loaded ({_one_line(error)})")
        for name in _MESSAGES:
            _import(name, missing)
    return report


def _modules(missing: list[str]) -> dict[str, object]:
    report: dict[str, object] = {}
    for name, distributions in _MODULES.items():
        module = _import(name, missing)
        report[name] = None if module is None else _version(module, distributions)
        if name == "pybullet":
            report["pybullet_numpy"] = None if module is None else bool(module.isNumpyEnabled())
    return report


def _hot_loops(missing: list[str]) -> dict[str, object]:
    """Which modules a C compiler has sped up; without one a run takes longer and is the same."""
    from robot_formation.hot_loops import COMPILED, INTERPRETED, OUT_OF_DATE, hot_loops

    found = hot_loops()
    return {
        state: ", ".join(name.partition(".")[2] for name in found if found[name] == state) or None
        for state in (COMPILED, INTERPRETED, OUT_OF_DATE)
    }


def _domain(missing: list[str]) -> dict[str, object]:
    from robot_formation.network.ros_domain import DomainError, free_domain

    try:
        return {"next_free": free_domain()}
    except DomainError as error:
        missing.append(str(error))
        return {"next_free": None}


def _shared_memory(missing: list[str]) -> dict[str, object]:
    from robot_formation.network.shared_memory import fast_dds_files, find_orphans

    try:
        state = os.statvfs(SHARED_MEMORY)
    except OSError as error:
        missing.append(f"{SHARED_MEMORY} cannot be used ({_one_line(error)})")
        return {"folder": None}
    if not os.access(SHARED_MEMORY, os.W_OK):
        missing.append(f"{SHARED_MEMORY} cannot be written to")
    return {
        "folder": str(SHARED_MEMORY),
        "size_mb": state.f_blocks * state.f_frsize // 10**6,
        "free_mb": state.f_bavail * state.f_frsize // 10**6,
        "fast_dds_files": sum(map(len, fast_dds_files().values())),
        "of_dead_processes": sum(map(len, find_orphans().values())),
    }


def _import(name: str, missing: list[str]) -> Any:
    """Import a module by name; None, and an entry in `missing`, if it can't be imported for whatever reason."""
    try:
        return importlib.import_module(name)
    except Exception as error:  # a broken install raises anything, not ImportError only
        absent = isinstance(error, ModuleNotFoundError) and error.name == name.partition(".")[0]
        missing.append(f"{name} is not installed" if absent else f"{name} cannot be imported ({_one_line(error)})")
        return None


def _version(module: object, distributions: tuple[str, ...]) -> str:
    from importlib import metadata

    for distribution in distributions:
        with contextlib.suppress(metadata.PackageNotFoundError):
            return metadata.version(distribution)
    return str(getattr(module, "__version__", "present"))


def _one_line(error: BaseException) -> str:
    return " ".join(str(error).split()) or type(error).__name__
