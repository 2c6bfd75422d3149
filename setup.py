"""The package as colcon (ament_python) and pip install it; pyproject.toml holds the tools' settings only."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = "robot_formation"
NODES = (
    "world",
    "drive",
    "leader",
    "block_detector",
    "predictor",
    "fine_tuner",
    "overhead_tracker",
    "recorder",
    "player",
    "progress",
    "viewer",
)


def shared(folder: str) -> list[tuple[str, list[str]]]:
    """List a folder's files, sub-folders included, by the place under the prefix where they are installed."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            found.setdefault(f"share/{NAME}/{path.parent.as_posix()}", []).append(path.as_posix())
    return list(found.items())


setup(
    name=NAME,
    version="0.1.0",
    description="Robot formation control on an unknown curved surface by Koopman prediction and a camera (ROS 2)",
    license="Apache-2.0",
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={NAME: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml", "CITATION.cff"]),
        *shared("config"),
        *shared("launch"),
    ],
    python_requires=">=3.10",
    # Lower bounds are what .ci/lowest installs and tests (.ci/lowest.txt): mostly what Ubuntu 24.04 has.
    install_requires=[
        "PyYAML>=6.0.1",
        "joblib>=1.3.2",
        "lz4>=4.1.0",
        "matplotlib>=3.6.3",
        "mcap>=1.5.0",
        "numpy>=1.26.4",
        "opencv-python-headless>=4.6.0.66",
        "pillow>=10.2.0",
        "pybullet>=3.2.6",
        "rosbags>=0.11.6",
        "scipy>=1.11.4",
        "setproctitle>=1.3.3",
        "zstandard>=0.22.0",
    ],
    extras_require={
        # ROS 2 Jazzy where none is installed. Not among the requirements: a ROS install brings its own.
        "pip": ["ros-jazzy-rclpy", "ros-jazzy-common-interfaces", "ros-jazzy-rmw-fastrtps-cpp"],
        # Runs in three dimensions in a browser. From 1.1 on lines have a width in metres.
        "view": ["viser>=1.1.0"],
        # Sweeps on many machines.
        "dask": ["dask[distributed]"],
        "test": [
            "colcon-common-extensions",
            "dask[distributed]",
            "hypothesis>=6.98.15",
            "jsonschema",
            "mypy",
            "odmd",
            "pykoop",
            "pytest>=7.4.4",
            "pytest-rerunfailures",
            "pytest-xdist",
            "ruff",
            "scipy-stubs",
            "types-PyYAML",
            "types-jsonschema",
            # Builds the package of examples/ where setuptools is too old to do so itself.
            "wheel",
        ],
    },
    entry_points={
        "console_scripts": [
            "formation = robot_formation.cli.__main__:main",
            *(f"{node} = {NAME}.nodes.executables:{node}" for node in NODES),
        ]
    },
    zip_safe=False,
)
