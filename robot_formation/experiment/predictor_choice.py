"""Parameters of predictors that are chosen by name for displacements without a scenario."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

from robot_formation.errors import FormationError
from robot_formation.experiment.scenario import Scenario, build, override
from robot_formation.experiment.scenario_setup import Setup
from robot_formation.koopman.predictors import NAMES, PredictorParameters, check_predictor_name
from robot_formation.parameters import ParameterError


def defaults() -> Scenario:
    """Return the scenario of which the predictors have their defaults."""
    return build(Setup(), {})


def predictors_of_texts(chosen: Sequence[str], settings: Sequence[str]) -> list[PredictorParameters]:
    """Return each predictor's parameters as the command line gives them: settings are KEY=VALUE each.

    Raises:
        FormationError: naming what is misspelt, out of range or of another node.
    """
    scenario = override(defaults(), settings)
    return chosen_predictors(chosen or NAMES, scenario, settings, named="--predictors", source="--set")


def chosen_predictors(
    chosen: Iterable[str], scenario: Scenario, settings: Iterable[str], *, named: str, source: str
) -> list[PredictorParameters]:
    """Return each predictor's parameters: the scenario's, under its own name.

    Args:
        chosen: names; each counts once.
        scenario: the defaults with the settings.
        settings: what was set, each beginning with the parameter's name.
        named: what the user calls the names, for messages.
        source: what the user calls the settings.

    Raises:
        FormationError: naming what is misspelt or of another node.
    """
    names = list(dict.fromkeys(chosen))
    for name in names:
        try:
            check_predictor_name(name)
        except ParameterError as error:
            raise FormationError(f"{named}: {error}") from None
    for setting in settings:
        if not setting.startswith("predictor."):
            raise FormationError(f"{source} {setting}: a log has no scenario; set parameters like predictor.forgetting")
    if "name" in scenario.settings.get("predictor", {}):
        raise FormationError(f"{source} predictor.name: name predictors by {named}")
    return [replace(scenario.predictor, name=name) for name in names]
