"""Tables for pandas, which is imported when one is made."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

from robot_formation.errors import FormationError

if TYPE_CHECKING:
    import pandas as pd


def table(rows: Sequence[Mapping[str, Any]], columns: Sequence[str]) -> pd.DataFrame:
    """Make a table of rows; None in a column of numbers is NaN there.

    Args:
        rows: values by column's name.
        columns: names of the columns if there is no row.

    Raises:
        FormationError: pandas is not installed.
    """
    try:
        import pandas
    except ImportError:
        raise FormationError("to_pandas needs pandas, which is not installed; pip install pandas") from None
    found = pandas.DataFrame(list(rows), columns=None if rows else list(columns))
    unknown = [name for name in found.columns if found[name].isna().all()]
    # A column in which nothing is known has no type of its own.
    return found.astype(dict.fromkeys(unknown, "float64"))
