"""Types of JSON values, which come from files and bags and go out to them."""

from __future__ import annotations

from typing import Any, TypeAlias

Json: TypeAlias = Any
"""A JSON value: a number, a text, a boolean, None, or a list or object of such values."""

JsonObject: TypeAlias = dict[str, Json]
