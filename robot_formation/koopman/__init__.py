"""Koopman operators from data: dictionaries, EDMD, online DMD, and the predictors built on them."""

from robot_formation.koopman.dictionaries import (
    Concatenation,
    Constant,
    DelayEmbedding,
    Dictionary,
    Identity,
    Inputs,
    Monomials,
    Observables,
    Product,
    Rows,
)
from robot_formation.koopman.edmd import EDMD, Errors
from robot_formation.koopman.linear_algebra import KoopmanError, Regularization
from robot_formation.koopman.online_dmd import OnlineDMD
from robot_formation.koopman.quality import EigenvalueQuality, consistency_index, eigenvalue_qualities
from robot_formation.koopman.radial_basis import RadialBasis
from robot_formation.koopman.regressor import KoopmanRegressor, NotFittedError
from robot_formation.koopman.samples import shift_episodes
from robot_formation.koopman.spectrum import Spectrum, spectrum
from robot_formation.koopman.windowed_dmd import WindowedDMD

__all__ = [
    "EDMD",
    "Concatenation",
    "Constant",
    "DelayEmbedding",
    "Dictionary",
    "EigenvalueQuality",
    "Errors",
    "Identity",
    "Inputs",
    "KoopmanError",
    "KoopmanRegressor",
    "Monomials",
    "NotFittedError",
    "Observables",
    "OnlineDMD",
    "Product",
    "RadialBasis",
    "Regularization",
    "Rows",
    "Spectrum",
    "WindowedDMD",
    "consistency_index",
    "eigenvalue_qualities",
    "shift_episodes",
    "spectrum",
]
