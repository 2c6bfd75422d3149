"""Dictionaries of the displacement (u, v) from the words of a parameter."""

from __future__ import annotations

import numpy as np

from robot_formation.koopman.dictionaries import (
    Concatenation,
    Constant,
    DelayEmbedding,
    Dictionary,
    Identity,
    Monomials,
)
from robot_formation.koopman.radial_basis import RadialBasis
from robot_formation.parameters import ParameterError, suggestion

WORDS = ("constant", "identity", "monomials", "rbf", "delay")
_LARGEST = {"monomials": 8, "rbf": 10, "delay": 50}
# Grid of the radial basis functions: twice the length that displacements are divided by, either way.
_REACH = 2.0


def dictionary_from_text(text: str) -> Dictionary:
    """Make the dictionary that words describe, in their order.

    Words: constant; identity; monomials:D, all from degree 1 to D; rbf:N, N x N Gaussians on a grid; delay:D, the last
    D displacements beside the newest.

    Raises:
        ParameterError: on an unknown word, a wrong number, or a dictionary from which the displacement can't be read.
    """
    parts = [_part(word) for word in text.replace(",", " ").split()]
    if not parts:
        raise ParameterError(f"the dictionary is empty; give words like 'constant identity': {', '.join(WORDS)}")
    dictionary = parts[0] if len(parts) == 1 else Concatenation(*parts)
    if None in dictionary.state_rows:
        raise ParameterError(f"the dictionary '{text}' doesn't contain the displacement: add 'identity'")
    return dictionary


def _part(word: str) -> Dictionary:
    name, colon, number = word.partition(":")
    if name not in WORDS:
        raise ParameterError(f"no dictionary '{name}'{suggestion(name, WORDS)}")
    if name in ("constant", "identity"):
        if colon:
            raise ParameterError(f"the dictionary '{name}' takes no number")
        return Constant(2) if name == "constant" else Identity(2, ("u", "v"))
    if not number.isdecimal() or not 1 <= int(number) <= _LARGEST[name]:
        raise ParameterError(f"the dictionary '{name}' takes a number from 1 to {_LARGEST[name]}, like '{name}:2'")
    count = int(number)
    if name == "monomials":
        return Monomials.to_degree(2, count, variables=("u", "v"))
    if name == "delay":
        return DelayEmbedding(2, count, variables=("u", "v"))
    axis = np.linspace(-_REACH, _REACH, count) if count > 1 else np.zeros(1)
    u, v = np.meshgrid(axis, axis, indexing="ij")
    return RadialBasis(np.stack([u.ravel(), v.ravel()]), width=2.0 * _REACH / max(count - 1, 1))
