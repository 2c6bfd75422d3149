"""What only some uses of the package need: each is an extra of pip, and one that is missing is told in one line."""

from __future__ import annotations

from importlib.util import find_spec

from robot_formation.errors import FormationError

# What an extra brings, and the module that shows whether it is there.
_EXTRAS = {
    "sim": ("PyBullet", "pybullet"),
    "ros": ("ROS 2", "rclpy"),
    "view": ("viser", "viser"),
    "dask": ("Dask", "distributed"),
}


class MissingExtraError(FormationError):
    """Something that an extra of pip brings isn't installed."""


def require(*extras: str) -> None:
    """Refuse to go on without what some extras bring.

    Args:
        extras: their names: sim, ros, view, dask.

    Raises:
        MissingExtraError: it names all that is missing, and how to install it.
    """
    missing = [extra for extra in extras if find_spec(_EXTRAS[extra][1]) is None]
    if missing:
        what = " and ".join(_EXTRAS[extra][0] for extra in missing)
        raise MissingExtraError(f"this needs {what}: pip install 'robot_formation[{','.join(missing)}]'")
