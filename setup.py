"""What is installed beside the code: the files of ROS 2's index, of config/, launch/ and ros2_run/. The rest is in
pyproject.toml.
"""

from pathlib import Path

from setuptools import setup

NAME = "robot_formation"


def files(folder: str, target: str) -> list[tuple[str, list[str]]]:
    """List a folder's files, sub-folders included, by the place under the prefix where they are installed."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            place = Path(target) / path.parent.relative_to(folder)
            found.setdefault(place.as_posix(), []).append(path.as_posix())
    return list(found.items())


setup(
    license="Apache-2.0",
    python_requires=">=3.10",
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        # `colcon build --symlink-install` builds in a folder that has the packages and what is listed here, and nothing
        # else: without pyproject.toml, and README.md that it names, the package would have no name there.
        (f"share/{NAME}", ["package.xml", "CITATION.cff", "pyproject.toml", "README.md"]),
        *files("config", f"share/{NAME}/config"),
        *files("launch", f"share/{NAME}/launch"),
        *files("ros2_run", f"lib/{NAME}"),
    ],
)
