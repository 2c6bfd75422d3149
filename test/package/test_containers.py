"""Dockerfile, development container and pre-commit do what the installation's page and the tests do."""

import json
import re
import shlex
from pathlib import Path

import pytest
import test_linters
import yaml

from repository import ROOT

PAGE = (ROOT / "docs" / "how-to" / "installation.md").read_text()
LINES = re.sub(r"\\\n\s*", "", (ROOT / "Dockerfile").read_text()).splitlines()
INSTRUCTIONS = [tuple(line.split(" ", 1)) for line in LINES if line and not line.startswith("#")]


def of(instruction: str) -> list[str]:
    return [words for name, words in INSTRUCTIONS if name == instruction]


def commands() -> set[str]:
    """Each command of a RUN, without what makes images small or answers questions."""
    found: set[str] = set()
    for line in of("RUN"):
        parts = [part.strip() for part in line.split("&&")]
        found.update(re.sub(r" (-y|--no-cache-dir|--no-install-recommends)\b", "", part) for part in parts)
    return found


def test_every_source_that_is_copied_exists_and_gets_into_the_image() -> None:
    ignored = (ROOT / ".dockerignore").read_text().splitlines()
    sources = [source for line in of("COPY") for source in shlex.split(line)[:-1]]
    assert sources == ["package.xml", "."]
    assert all((ROOT / source).exists() for source in sources)
    assert not {"package.xml", "setup.py", "pyproject.toml", "README.md", "config", "robot_formation"} & set(ignored)


def test_the_image_is_built_by_the_commands_of_the_page() -> None:
    (section,) = re.findall(r"## In a ROS 2 workspace\n.*?```\n(.*?)```", PAGE, re.DOTALL)
    said = {re.sub(r"^sudo (-E )?", "", line) for line in section.replace("\\\n", "").splitlines()}
    for command in commands():
        if command.split()[0] in ("rm", ".") or command in ("apt-get update", "rosdep update --rosdistro jazzy"):
            continue
        assert command.replace("apt-get", "apt") in said
    for variable in of("ENV"):
        assert f"export {variable}" in said


def test_the_image_is_of_the_distribution_that_the_wheels_are() -> None:
    assert of("FROM") == ["ros:jazzy AS dependencies", "dependencies"]
    assert "/opt/ros/jazzy/setup.sh" in (ROOT / "Dockerfile").read_text()


def test_an_entry_point_passes_its_words_on() -> None:
    (words,) = of("ENTRYPOINT")
    *shell, script, name = json.loads(words)
    assert shell == ["/bin/bash", "-c"]
    assert script == 'source /workspace/install/setup.bash && exec "$@"'
    assert name == "--"


def test_the_development_container_is_the_image_without_the_package() -> None:
    described = json.loads((ROOT / ".devcontainer" / "devcontainer.json").read_text())
    build = described["build"]
    folder = ROOT / ".devcontainer"
    assert (folder / build["dockerfile"]).resolve() == ROOT / "Dockerfile"
    assert (folder / build["context"]).resolve() == ROOT
    assert f"ros:jazzy AS {build['target']}" in of("FROM")
    (workspace,) = of("WORKDIR")
    assert described["workspaceFolder"] == f"{workspace}/src/robot_formation"
    assert f"target={described['workspaceFolder']}," in described["workspaceMount"]
    assert f"cd {workspace} && colcon build --symlink-install" in described["postCreateCommand"]


def test_pre_commit_runs_the_linters_of_the_tests() -> None:
    (repo,) = yaml.safe_load((ROOT / ".pre-commit-config.yaml").read_text())["repos"]
    assert repo["repo"] == "local"
    (marker,) = (mark for mark in test_linters.test_linter_finds_nothing.pytestmark if mark.name == "parametrize")  # type: ignore[attr-defined]
    tested = [" ".join(word for word in command if word != "--check") for command in marker.args[1]]
    assert [hook["entry"] for hook in repo["hooks"]] == [f".venv/bin/python -m {command}" for command in tested]
    assert all(hook["language"] == "system" for hook in repo["hooks"]), "others are fetched from the network"


@pytest.mark.parametrize("name", ["Dockerfile", ".devcontainer/devcontainer.json"])
def test_the_page_names_them(name: str) -> None:
    assert f"`{Path(name).parts[0]}" in PAGE
