"""What package.xml, setup.py and the tree say about each other."""

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
import setuptools

import robot_formation
from repository import ROOT
from robot_formation import paths
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.nodes.__main__ import NAMES


@pytest.fixture(scope="module")
def package_xml() -> Element:
    return ElementTree.parse(ROOT / "package.xml").getroot()


@pytest.fixture(scope="module")
def setup_arguments() -> dict[str, Any]:
    """The keyword arguments that setup.py hands to setuptools."""
    found = {}
    before, old = setuptools.setup, Path.cwd()
    setuptools.setup = lambda **arguments: found.update(arguments)
    os.chdir(ROOT)
    try:
        exec(compile((ROOT / "setup.py").read_text(), "setup.py", "exec"), {"__name__": "__main__"})
    finally:
        setuptools.setup = before
        os.chdir(old)
    return found


def test_the_version_is_the_same_everywhere(package_xml: Element, setup_arguments: dict[str, Any]) -> None:
    (cited,) = re.findall(r"^version: (\S+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    versions = {package_xml.findtext("version"), setup_arguments["version"], robot_formation.__version__, cited}
    assert len(versions) == 1


def test_package_xml_is_an_ament_python_package_of_format_3(
    package_xml: Element, setup_arguments: dict[str, Any]
) -> None:
    assert package_xml.get("format") == "3"
    assert package_xml.findtext("name") == setup_arguments["name"] == "robot_formation"
    assert package_xml.findtext("license") == setup_arguments["license"] == "Apache-2.0"
    assert package_xml.findtext("export/build_type") == "ament_python"
    maintainer = package_xml.find("maintainer")
    assert maintainer is not None
    assert maintainer.get("email")


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


def test_every_requirement_has_a_rosdep_key_that_brings_it(
    package_xml: Element, setup_arguments: dict[str, Any]
) -> None:
    brings = {
        "mcap-ros2-support": {"mcap", "lz4", "zstandard"},
        "python3-opencv": {"opencv-python-headless"},
        "python3-pil": {"pillow"},
        "python3-yaml": {"PyYAML"},
        **{f"python3-{name}": {name} for name in ("joblib", "matplotlib", "numpy", "scipy", "setproctitle")},
        **{f"python3-{name}-pip": {name} for name in ("pybullet", "rosbags")},
    }
    keys = {element.text or "" for element in package_xml.iter("exec_depend")}
    required = {requirement.partition(">=")[0] for requirement in setup_arguments["install_requires"]}
    assert set().union(*(brings.get(key, set()) for key in keys)) == required


def test_no_requirement_has_an_upper_cap(setup_arguments: dict[str, Any]) -> None:
    requirements = list(setup_arguments["install_requires"])
    for extra in setup_arguments["extras_require"].values():
        requirements += extra
    assert not [requirement for requirement in requirements if re.search(r"<|==|~=", requirement)]


def test_the_lowest_versions_that_are_tested_are_the_lower_bounds(setup_arguments: dict[str, Any]) -> None:
    requirements = [*setup_arguments["install_requires"], *setup_arguments["extras_require"]["test"]]
    bounds = dict(requirement.split(">=") for requirement in requirements if ">=" in requirement)
    lines = (ROOT / ".ci" / "lowest.txt").read_text().partition("# Not ours")[0].splitlines()
    assert dict(line.split("==") for line in lines if not line.startswith("#")) == bounds
    assert [requirement for requirement in setup_arguments["install_requires"] if ">=" not in requirement] == []


def test_each_executable_starts_a_function_that_exists(setup_arguments: dict[str, Any]) -> None:
    for script in setup_arguments["entry_points"]["console_scripts"]:
        module, function = script.split(" = ")[1].split(":")
        assert callable(getattr(importlib.import_module(module), function)), script


def test_each_node_is_an_executable_of_its_name(setup_arguments: dict[str, Any]) -> None:
    scripts = setup_arguments["entry_points"]["console_scripts"]
    nodes = [*KINDS, "recorder", "player", "progress", "viewer"]
    assert sorted(NAMES) == sorted(nodes)
    assert {f"{node} = robot_formation.nodes.executables:{node}" for node in nodes} == set(scripts) - {
        "formation = robot_formation.cli.__main__:main"
    }


def test_no_executable_loads_ros_before_it_takes_signals(setup_arguments: dict[str, Any]) -> None:
    targets = [script.split(" = ")[1].split(":")[0] for script in setup_arguments["entry_points"]["console_scripts"]]
    code = f"import sys, {', '.join(targets)}; sys.exit('rclpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)


def test_every_file_of_config_and_launch_is_installed_to_its_place(setup_arguments: dict[str, Any]) -> None:
    installed = {f"{place}/{Path(file).name}": file for place, files in setup_arguments["data_files"] for file in files}
    for folder in ("config", "launch"):
        files = [path for path in (ROOT / folder).rglob("*") if path.is_file() and path.suffix != ".pyc"]
        for path in files:
            inside = path.relative_to(ROOT).as_posix()
            assert installed[f"share/robot_formation/{inside}"] == inside


def test_every_package_folder_is_installed(setup_arguments: dict[str, Any]) -> None:
    folders = {path.parent.relative_to(ROOT) for path in (ROOT / "robot_formation").rglob("*.py")}
    assert {".".join(folder.parts) for folder in folders} == set(setup_arguments["packages"])


def test_the_resource_marker_has_the_packages_name(setup_arguments: dict[str, Any]) -> None:
    place = "share/ament_index/resource_index/packages"
    assert (place, ["resource/robot_formation"]) in setup_arguments["data_files"]
    assert (ROOT / "resource" / "robot_formation").is_file()


def test_executables_go_where_ros2_run_looks() -> None:
    config = configparser.ConfigParser()
    config.read(ROOT / "setup.cfg")
    assert config["develop"]["script_dir"] == config["install"]["install_scripts"] == "$base/lib/robot_formation"


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
    for name in ("formation", "setup.py", "setup.cfg"):
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
