"""The wheel and the source archive hold what they have to."""

import tarfile
import zipfile
from importlib.util import find_spec
from pathlib import Path

import pytest

from project_table import installed_files
from source_copy import build_archive, copy_source, source_files

pytestmark = [pytest.mark.long, pytest.mark.xdist_group("archives")]
NAME = "robot_formation-0.1.0"
LEFT_OUT = {".gitattributes", ".gitignore"}  # say something to git only


@pytest.fixture(scope="module")
def archives(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the wheel and the source archive, built by the setuptools of this environment."""
    source, built = copy_source(tmp_path_factory.mktemp("source")), tmp_path_factory.mktemp("built")
    for kind in ("sdist", "wheel"):
        build_archive(kind, source, built)
    return built


@pytest.fixture(scope="module")
def wheel(archives: Path) -> zipfile.ZipFile:
    (file,) = archives.glob("*.whl")
    return zipfile.ZipFile(file)


@pytest.mark.skipif(find_spec("Cython") is not None, reason="with Cython the wheel has compiled modules")
def test_without_cython_the_wheel_is_for_every_python_and_machine(archives: Path) -> None:
    assert {file.name for file in archives.iterdir()} == {f"{NAME}-py3-none-any.whl", f"{NAME}.tar.gz"}


def test_the_wheel_holds_the_code_its_type_marker_and_what_is_installed_beside_it(wheel: zipfile.ZipFile) -> None:
    names = set(wheel.namelist())
    code = {name for name in source_files() if name.startswith("robot_formation/")}
    assert "robot_formation/py.typed" in code
    beside = {f"{NAME}.data/data/{place}" for place in installed_files()}
    assert {name for name in names if ".dist-info/" not in name and not name.endswith(".so")} == code | beside
    for name in ("config/world.yaml", "launch/formation.launch.py"):
        assert f"{NAME}.data/data/share/robot_formation/{name}" in names


def test_executables_stay_so_in_the_wheel(wheel: zipfile.ZipFile) -> None:
    modes = [entry.external_attr >> 16 for entry in wheel.infolist() if "/data/lib/" in entry.filename]
    assert modes
    assert all(mode & 0o111 == 0o111 for mode in modes)


def test_the_source_archive_holds_all_that_git_has(archives: Path) -> None:
    with tarfile.open(archives / f"{NAME}.tar.gz") as archive:
        names = {member.name.partition("/")[2] for member in archive if member.isfile()}
    made = {name for name in names if name in ("PKG-INFO", "setup.cfg") or ".egg-info/" in name}
    assert names - made == set(source_files()) - made - LEFT_OUT
