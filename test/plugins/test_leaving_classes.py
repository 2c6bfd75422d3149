"""Classes from outside the package that end the process, as scripts do: an error like any other."""

import sys

import numpy as np
import pytest

from robot_formation.koopman.predictors.outside import OutsideModel
from robot_formation.leader.paths.outside import completed_path
from robot_formation.plugins import PluginError
from robot_formation.surface.outside import completed_surface
from robot_formation.vision.pixy2.parameters import DetectorParameters
from robot_formation.vision.sensors import made_sensor

PICTURE = np.zeros((208, 316, 3), np.uint8)


class Leaving:
    """Ends the process whatever it is asked."""

    def observe(self, displacement: np.ndarray) -> None:
        sys.exit(5)

    def forecast(self) -> list[float]:
        sys.exit(5)

    def motion(self, timestep: int) -> tuple[float, float]:
        sys.exit(5)

    def detect(self, picture: np.ndarray) -> list[tuple[int, float, float, float, float]]:
        sys.exit(5)

    def height(self, x: float, y: float) -> float:
        sys.exit(5)


class Unmade(Leaving):
    """Ends it when it is made."""

    def __init__(self) -> None:
        sys.exit("no licence")


def ask(what: str, kind: type) -> object:
    """Make one of each kind and ask it for something."""
    if what == "path":
        return completed_path("mine", kind)().motion(1)
    if what == "surface":
        return completed_surface("mine", kind)().height(0.0, 0.0)
    if what == "sensor":
        return made_sensor("mine", kind, DetectorParameters()).process(PICTURE, 0)
    return OutsideModel("mine", kind).ahead(1)


@pytest.mark.parametrize("what", ["predictor", "surface", "path", "sensor"])
def test_leaving_is_an_error_that_names_the_class(what: str) -> None:
    with pytest.raises(PluginError, match=rf"^{what} 'mine': .* failed: SystemExit: 5$"):
        ask(what, Leaving)
    with pytest.raises(PluginError, match=rf"^{what} 'mine': making one .* failed: SystemExit: no licence$"):
        ask(what, Unmade)
