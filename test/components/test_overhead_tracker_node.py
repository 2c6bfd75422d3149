"""The overhead tracker's parameters while it runs."""

import pytest

from component_helpers import wired
from robot_formation.components.catalogue import KINDS
from robot_formation.errors import FormationError
from robot_formation.parameters import from_mapping


def test_parameters_are_taken_while_it_runs_and_a_surface_that_cannot_be_is_refused() -> None:
    component = wired("overhead_tracker").component
    kind = KINDS["overhead_tracker"].parameter_class()
    component.set_parameters(from_mapping(kind, {"surface": "plane", "gate_m": 0.1}, where="test"))
    with pytest.raises(FormationError, match="did you mean 'bowl'"):
        component.set_parameters(from_mapping(kind, {"surface": "bowel"}, where="test"))
    assert list(component.fixed) == ["robots"]
