"""What is installed beside the code: the files of ROS 2's index, of config/, launch/ and ros2_run/. What is compiled:
the modules that have a .pxd file beside them. The rest is in pyproject.toml.
"""

import os
from importlib.util import find_spec
from pathlib import Path

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

NAME = "robot_formation"


def files(folder: str, target: str) -> list[tuple[str, list[str]]]:
    """List a folder's files, sub-folders included, by the place under the prefix where they are installed."""
    found: dict[str, list[str]] = {}
    for path in sorted(Path(folder).rglob("*")):
        if path.is_file() and "__pycache__" not in path.parts:
            place = Path(target) / path.parent.relative_to(folder)
            found.setdefault(place.as_posix(), []).append(path.as_posix())
    return list(found.items())


def hot_loops() -> list[Extension]:
    """The modules to compile. Where that can't be done, Python runs the same files, slower."""
    return [
        Extension(
            ".".join(path.with_suffix("").parts),
            [path.with_suffix(".py").as_posix()],
            # No fused multiplication and addition: compiled or not, results are the same to the last bit.
            extra_compile_args=["-O2", "-g0", "-ffp-contract=off"],
        )
        for path in sorted(Path(NAME).rglob("*.pxd"))
    ]


class CompileHotLoops(build_ext):  # type: ignore[misc]
    """Translates the hot loops to C and compiles them; what that takes may be missing."""

    def finalize_options(self) -> None:
        if self.distribution.ext_modules:
            self.distribution.ext_modules = self._translated()
        super().finalize_options()
        self.parallel = len(os.sched_getaffinity(0))

    def _translated(self) -> list[Extension]:
        from Cython.Build import cythonize
        from Cython.Compiler.Errors import CompileError

        try:
            translated: list[Extension] = cythonize(
                hot_loops(),
                build_dir="build/hot_loops",
                language_level=3,
                # C types stand in the .pxd files alone.
                compiler_directives={"annotation_typing": False},
                quiet=True,
            )
        except CompileError:
            self.warn("hot loops are not compiled: this version of Cython does not translate them")
            return []
        for extension in translated:
            extension.optional = True  # Cython doesn't keep that
        return translated

    def build_extension(self, ext: Extension) -> None:
        try:
            super().build_extension(ext)
        except OSError as error:  # no compiler, which an optional extension does not forgive
            self.warn(f"hot loops are not compiled: {error}")


setup(
    license="Apache-2.0",
    python_requires=">=3.10",
    ext_modules=hot_loops() if find_spec("Cython") else [],
    cmdclass={"build_ext": CompileHotLoops},
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
