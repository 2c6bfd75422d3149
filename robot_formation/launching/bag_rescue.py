"""Looks after a run's bag when its recorder has ended: rescues one that was cut off, and says what is missing."""

from __future__ import annotations

import shutil
from collections import Counter
from pathlib import Path

from robot_formation.bag.bag_path import CUT_OFF_SUFFIX, PARTIAL_SUFFIX
from robot_formation.bag.errors import BagError
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.run_details import counts

_MOST_TOPICS = 5


def rescue(bag: Path) -> tuple[Path | None, str]:
    """Finish a bag that its recorder could not finish.

    Returns:
        The bag, None if there is none; and what went wrong, if anything did.
    """
    if bag.exists():
        return bag, ""
    partial = bag.with_name(bag.name + PARTIAL_SUFFIX)
    if not partial.exists():
        return None, ""
    cut_off = bag.with_name(bag.name + CUT_OFF_SUFFIX)
    try:
        partial.rename(cut_off)  # the whole bag is written under the partial one's name first
        try:
            report = recover(cut_off, bag)
        except (BagError, OSError):
            cut_off.rename(partial)  # where the recorder said it is, for a later try
            raise
    except OSError as error:
        return None, f"{partial} can't be completed: {error.strerror or error}"
    except BagError as error:
        return None, str(error).replace(str(cut_off), str(partial))
    if report.damaged_chunks == 0:  # what else is missing had not been written: nothing more to get out of it
        try:
            shutil.rmtree(cut_off)
        except OSError as error:
            why = error.strerror or error
            return bag, f"{cut_off} can't be removed: {why}; {bag} holds all of it, so it can be deleted"
    return bag, ""


def missing_messages(bag: Path) -> str:
    """Describe in a line which messages the bag's recorder knows it didn't get; nothing if there are none.

    Raises:
        BagError: the bag can't be read.
    """
    with read_bag(bag, allow_empty=True) as opened:
        details = opened.metadata(METADATA_NAME)
    missing: Counter[str] = Counter()
    for key in ("dropped", "lost"):
        missing.update(counts(details, key))
    if not missing:
        return ""
    topics = [f"{topic} ({count})" for topic, count in missing.most_common(_MOST_TOPICS)]
    more = f" and {len(missing) - _MOST_TOPICS} more topics" if len(missing) > _MOST_TOPICS else ""
    return f"the bag lacks {missing.total()} messages that were lost on the way: {', '.join(topics)}{more}"
