"""What package.xml, pyproject.toml, setup.py and the tree say about each other."""

import configparser
import importlib
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from importlib.machinery import SourceFileLoader
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import pytest

import robot_formation
from project_table import installed_files, project, setup_arguments
from repository import ROOT
from robot_formation import paths
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.nodes.__main__ import NAMES


@pytest.fixture(scope="module")
def package_xml() -> Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


def test_the_version_is_the_same_everywhere(package_xml: Element) -> None:
    (cited,) = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    (printed,) = re.findall(r"^  version = \{(\S+)\},$", (ROOT / "README.md").read_text(), re.MULTILINE)
    versions = {package_xml.findtext("version"), project()["version"], robot_formation.__version__, cited, printed}
    assert len(versions) == 1


def test_package_xml_is_an_ament_python_package_of_format_3(package_xml: Element) -> None:
    assert package_xml.get("format") == "3"
    assert package_xml.findtext("name") == project()["name"] == "robot_formation"
    assert package_xml.findtext("license") == setup_arguments()["license"] == "Apache-2.0"
    assert package_xml.findtext("export/build_type") == "ament_python"
    maintainer = package_xml.find("maintainer")
    assert maintainer is not None
    assert {"name": maintainer.text, **maintainer.attrib} == project()["authors"][0]


def test_package_xml_names_each_dependency_once_by_a_rosdep_like_key(package_xml: Element) -> None:
    keys = [element.text or "" for element in package_xml if element.tag.endswith("depend")]
    assert len(keys) == len(set(keys))
    assert all(re.fullmatch(r"[a-z][a-z0-9_-]*", key) for key in keys)


def test_package_xml_names_every_ros_package_that_is_imported(package_xml: Element) -> None:
    keys = {element.text for element in package_xml if element.tag in ("depend", "exec_depend")}
    imported = set()
    for file in [
        *(ROOT / "robot_formation" / "nodes").rglob("*.py"),
        *(ROOT / "robot_formation" / "conversions").glob("*.py"),
        *(ROOT / "launch").glob("*.py"),
    ]:
        imported.update(
            re.findall(
                r"^\s*(?:from|import) (\w+_msgs|\w+_srvs|\w+_interfaces|rclpy|launch\w*)",
                file.read_text(),
                re.MULTILINE,
            )
        )
    assert imported <= keys


def requirements(*extras: str) -> list[str]:
    """What the package needs, and what some of its extras bring."""
    return [
        *project()["dependencies"],
        *(name for extra in extras for name in project()["optional-dependencies"][extra]),
    ]


def test_every_requirement_has_a_rosdep_key_that_brings_it(package_xml: Element) -> None:
    brings = {
        "mcap-ros2-support": {"mcap", "lz4", "zstandard"},
        "python3-opencv": {"opencv-python-headless"},
        "python3-pil": {"pillow"},
        "python3-yaml": {"PyYAML"},
        **{
            f"python3-{name}": {name}
            for name in ("argcomplete", "joblib", "matplotlib", "numpy", "scipy", "setproctitle")
        },
        **{f"python3-{name}-pip": {name} for name in ("pybullet", "rosbags")},
    }
    keys = {element.text or "" for element in package_xml.iter("exec_depend")}
    required = {requirement.partition(">=")[0] for requirement in requirements("sim")}
    assert set().union(*(brings.get(key, set()) for key in keys)) == required


def test_no_requirement_has_an_upper_cap() -> None:
    assert not [text for text in requirements(*project()["optional-dependencies"]) if re.search(r"<|==|~=", text)]


def test_the_lowest_versions_that_are_tested_are_the_lower_bounds() -> None:
    bounds = dict(text.split(">=") for text in requirements("sim", "test") if ">=" in text)
    lines = (ROOT / ".ci" / "lowest.txt").read_text().partition("# Not ours")[0].splitlines()
    assert dict(line.split("==") for line in lines if not line.startswith("#")) == bounds
    assert [text for text in requirements("sim") if ">=" not in text] == []


def test_the_base_needs_neither_simulation_nor_ros_and_pip_brings_both() -> None:
    extras = project()["optional-dependencies"]
    assert not [text for text in requirements() if re.match("pybullet|ros-|viser|dask", text)]
    assert extras["pip"] == ["robot_formation[sim,ros]"]
    assert extras["all"] == ["robot_formation[sim,ros,view,dask]"]
    assert set(re.findall(r"'\.\[(.+?)\]'", (ROOT / "formation").read_text())) == {"pip,test,view"}


def test_each_executable_starts_a_function_that_exists() -> None:
    for target in project()["scripts"].values():
        module, function = target.split(":")
        assert callable(getattr(importlib.import_module(module), function)), target


def test_each_node_is_a_command_with_a_prefix_and_an_executable_by_its_short_name() -> None:
    nodes = {*KINDS, "recorder", "player", "progress", "viewer"}
    assert set(NAMES) == nodes
    commands = {f"formation-{node.replace('_', '-')}": f"robot_formation.nodes.executables:{node}" for node in nodes}
    assert project()["scripts"] == {"formation": "robot_formation.cli.__main__:main", **commands}
    executables = {place for place in installed_files() if place.startswith("lib/")}
    assert executables == {f"lib/robot_formation/{name}" for name in {*nodes, "formation"}}


def test_executables_by_short_names_can_be_started_by_any_python_that_is_active() -> None:
    for path in (ROOT / "ros2_run").iterdir():
        assert os.access(path, os.X_OK), path
        assert path.read_text().startswith("#!/usr/bin/env python3\n"), path
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    assert config["build_scripts"]["executable"] == "/usr/bin/env python3"


def test_no_file_is_a_link_which_archives_and_some_systems_lose() -> None:
    listed = subprocess.run(["git", "ls-files", "--stage"], cwd=ROOT, capture_output=True, text=True, check=False)
    assert not [line for line in listed.stdout.splitlines() if line.startswith("120000")]


def test_an_executable_is_the_node_that_its_file_is_named_after() -> None:
    for path in (ROOT / "ros2_run").iterdir():
        if path.name != "formation":
            assert f"from robot_formation.nodes.executables import {path.name}\n" in path.read_text()
            assert path.read_text().endswith(f"sys.exit({path.name}())\n")
    command = [sys.executable, str(ROOT / "ros2_run" / "fine_tuner"), "--help"]
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert "fine_tuner" in done.stdout + done.stderr


def test_no_executable_loads_ros_before_it_takes_signals() -> None:
    targets = {target.split(":")[0] for target in project()["scripts"].values()}
    code = f"import sys, {', '.join(targets)}; sys.exit('rclpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_every_file_of_config_and_launch_is_installed_to_its_place() -> None:
    installed = installed_files()
    for folder in ("config", "launch"):
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix != ".pyc"]
        for path in files:
            inside = path.relative_to(ROOT).as_posix()
            assert installed[f"share/robot_formation/{inside}"] == inside


def test_what_the_package_is_named_by_is_there_when_colcon_builds_with_links() -> None:
    assert {"pyproject.toml", project()["readme"]} <= set(installed_files().values())


def test_every_folder_of_code_is_a_package() -> None:
    folders = {path.parent for path in (ROOT / "robot_formation").rglob("*.py")}
    assert not [folder for folder in folders if not (folder / "__init__.py").is_file()]


def test_the_resource_marker_has_the_packages_name() -> None:
    place = "share/ament_index/resource_index/packages/robot_formation"
    assert installed_files()[place] == "resource/robot_formation"
    assert (ROOT / "resource" / "robot_formation").is_file()


def differences(one: dict[str, Any], other: dict[str, Any], tolerance: float) -> list[str]:
    """What .ci/same_runs says of two results."""
    loader = SourceFileLoader("same_runs", str(ROOT / ".ci" / "same_runs"))
    spec = importlib.util.spec_from_loader("same_runs", loader)
    assert spec is not None
    module = importlib.util.module_from_spec(spec)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "dont_write_bytecode", True)
        loader.exec_module(module)
    found: list[str] = module.differences(one, other, tolerance)
    return found


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"a": [1.0, None], "b": "done"}, []),
        ({"a": [1.0 + 1e-12, None], "b": "done"}, []),
        ({"a": [1.0 + 1e-6, None], "b": "done"}, ["run.a[0]: 1.0, 1.000001"]),
        ({"a": [None, None], "b": "done"}, ["run.a[0]: 1.0, None"]),
        ({"a": [1.0, None], "b": "lost"}, ["run.b: 'done', 'lost'"]),
        ({"a": [1.0], "b": "done"}, ["run.a: [1.0, None], [1.0]"]),
        ({"b": "done"}, ["run: {'a': [1.0, None], 'b': 'done'}, {'b': 'done'}"]),
    ],
)
def test_runs_of_two_environments_are_told_apart_beyond_the_tolerance(other: dict[str, Any], said: list[str]) -> None:
    one = {"a": [1.0, None], "b": "done"}
    assert differences(one, other, 1e-9) == said
    assert bool(differences(one, other, 0.0)) == (one != other)


@pytest.mark.parametrize("script", ["formation", ".ci/run", ".ci/lowest"])
def test_the_shell_scripts_are_executable_and_parse(script: str) -> None:
    assert os.access(ROOT / script, os.X_OK)
    shell = (ROOT / script).read_text().splitlines()[0].split("/")[-1].split()[-1]
    subprocess.run([shell, "-n", str(ROOT / script)], check=True)


PYTHON = """\
#!/bin/sh
case $1 in
    -c) echo 3.11 ;;
    *) { pwd; printf '%s\\n' "$@"; } >>"${0%/*}/calls" ;;
esac
"""


def test_relative_paths_of_the_installation_are_those_of_the_users_folder(tmp_path: Path) -> None:
    checkout, user = tmp_path / "checkout", tmp_path / "user"
    binaries = user / "environment" / "bin"
    checkout.mkdir()
    binaries.mkdir(parents=True)
    for name in ("formation", "setup.py", "pyproject.toml"):
        shutil.copy(ROOT / name, checkout / name)
    (user / "constraints.txt").write_text("")
    (binaries / "python").write_text(PYTHON)
    (binaries / "python").chmod(0o755)
    environment = {**os.environ, "FORMATION_VENV": "environment", "FORMATION_CONSTRAINTS": "constraints.txt"}
    command = [str(checkout / "formation"), "list"]
    completed = subprocess.run(command, cwd=user, env=environment, capture_output=True, text=True, check=False)
    assert completed.returncode == 0, completed.stderr
    calls = (binaries / "calls").read_text().splitlines()
    assert calls[0] == str(checkout)
    assert calls[calls.index("-c") + 1] == str(user / "constraints.txt")
    assert calls[-3:] == [str(user), str(binaries / "formation"), "list"]


def test_the_checkout_is_found_and_its_config_comes_first() -> None:
    assert paths.project_root() == ROOT.resolve()
    assert paths.config_dir() == ROOT.resolve() / "config"
    assert paths.default_bags_dir() == ROOT.resolve() / "bags"


def test_an_installed_package_finds_config_under_its_prefix(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    code = tmp_path / "prefix" / "lib" / "python3" / "site-packages" / "robot_formation"
    share = tmp_path / "prefix" / "share" / "robot_formation"
    (share / "config").mkdir(parents=True)
    monkeypatch.setattr(paths, "_PACKAGE", code)
    monkeypatch.chdir(tmp_path)
    assert paths.project_root() is None
    assert paths.config_dir() == share / "config"
    assert paths.default_bags_dir() == tmp_path / "bags"


def test_an_installed_package_finds_config_under_the_ament_prefixes(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    share = tmp_path / "overlay" / "share" / "robot_formation"
    (share / "config").mkdir(parents=True)
    monkeypatch.setattr(paths, "_PACKAGE", tmp_path / "elsewhere" / "robot_formation")
    monkeypatch.setenv("AMENT_PREFIX_PATH", os.pathsep.join([str(tmp_path / "other"), str(tmp_path / "overlay")]))
    assert paths.share_dir() == share


def test_a_missing_config_is_one_clear_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(paths, "_PACKAGE", tmp_path / "robot_formation")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    monkeypatch.delenv("AMENT_PREFIX_PATH", raising=False)
    with pytest.raises(FormationError, match="install robot_formation again") as caught:
        paths.config_dir()
    assert "\n" not in str(caught.value)
