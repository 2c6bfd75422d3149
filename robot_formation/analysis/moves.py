"""What a follower's moves were for, and how often and how long it had lost its beacon neighbour from view.

moves by axis
    of the moves after a timestep's prediction move, how many had a leg along u, a leg along v and a turn by their
    command (more than 0.1 mm, or 0.1 mrad); a move of several legs counts for each of them.
movements
    those moves, each counted as often as it has legs: a move along v and one along u are two, in one command or two.
moves by kind
    the same moves by what the fine-tuner said of them: `correct: REASON` or `search: REASON`.
loss
    from the end of the first look that didn't show the neighbour (`hold` or `search`) to the end of the look that
    showed it again (`reacquired`), or to where the follower gave up (`lost`). A blackout is none.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import lru_cache
from statistics import median

from robot_formation.analysis.run_record import FollowerRecord
from robot_formation.follower.alignment_state import AlignmentState
from robot_formation.geometry.se2 import Motion

AXES = ("u", "v", "turn")
UNKNOWN = "unknown"
"""Kind of a move of which the fine-tuner said nothing."""
_LEAST = 1e-4
_NOT_SEEN = (AlignmentState.HOLD, AlignmentState.SEARCH)
_SEEN_OR_LOST = (AlignmentState.REACQUIRED, AlignmentState.LOST)


@dataclass(frozen=True)
class Moves:
    """Numbers of moves by axis, None where no commands are known, and by kind."""

    axes: Mapping[str, int] | None
    kinds: Mapping[str, int]


@dataclass(frozen=True)
class Loss:
    """One loss of the neighbour in timestep t: looks in vain, moves of the search, simulated seconds (None: unknown)
    until it was seen again, or until the follower gave up or the record ends, and whether it was seen again.
    """

    t: int
    looks: int
    moves: int
    seconds: float | None
    reacquired: bool


def moves_of(follower: FollowerRecord, indices: Sequence[int], t: int) -> Moves:
    """Count a timestep's moves.

    Args:
        follower: whose moves.
        indices: of the timestep's moves in `follower.moved`; the first one is the prediction move and isn't counted.
        t: the timestep.
    """
    corrections = indices[1:]
    kinds = [text for text in _texts(follower, t) if (state := AlignmentState.parse(text)) and state.corrects]
    kinds += [UNKNOWN] * (len(corrections) - len(kinds))
    return Moves(_axes(follower, corrections), dict(Counter(kinds[: len(corrections)])))


def summed(moves: Sequence[Moves]) -> Moves:
    """Add up the moves of several timesteps."""
    kinds: Counter[str] = Counter()
    for entry in moves:
        kinds.update(entry.kinds)
    known = [entry.axes for entry in moves if entry.axes is not None]
    axes = {axis: sum(entry[axis] for entry in known) for axis in AXES} if len(known) == len(moves) else None
    return Moves(axes, dict(kinds))


def losses(follower: FollowerRecord) -> tuple[Loss, ...]:
    """List a follower's losses in order, in all timesteps from 0 on."""
    found: list[Loss] = []
    begun: int | None = None
    looks = moves = 0
    blind = False
    for number, (t, text) in enumerate(_with_timestep(follower.states)):
        state = AlignmentState.parse(text)
        if state in _NOT_SEEN:
            begun = number if begun is None else begun
            looks, moves = looks + 1, moves + (state is AlignmentState.SEARCH)
        elif state is AlignmentState.BLIND:
            blind = True
        elif state is AlignmentState.REACQUIRED and blind and begun is None:
            blind = False  # seen at the first look after a blackout
        elif state in _SEEN_OR_LOST:
            blind = False
            first = number if begun is None else begun
            found.append(Loss(t, looks, moves, _seconds(follower, first, number), state is AlignmentState.REACQUIRED))
            begun, looks, moves = None, 0, 0
    if begun is not None:
        last = len(follower.states) - 1
        t = list(_with_timestep(follower.states))[last][0]
        found.append(Loss(t, looks, moves, _seconds(follower, begun, last), False))
    return tuple(found)


def move_totals(timesteps: Sequence[Moves], movements: Sequence[int], follower: FollowerRecord) -> dict[str, object]:
    """Sum up a follower's moves and losses as the command line's JSON has them.

    Args:
        timesteps: the moves of each finished timestep.
        movements: how many there were in each.
        follower: whose losses.
    """
    moves, lost = summed(timesteps), losses(follower)
    seconds = [loss.seconds for loss in lost if loss.reacquired and loss.seconds is not None]
    return {
        "moves_by_axis": moves.axes,
        "moves_by_kind": moves.kinds,
        "movements_median": median(movements) if movements else None,
        "movements_max": max(movements, default=None),
        "losses": [asdict(loss) for loss in lost],
        "reacquired": sum(loss.reacquired for loss in lost),
        "reacquisition_median_s": median(seconds) if seconds else None,
        "reacquisition_max_s": max(seconds, default=None),
    }


def is_blind(follower: FollowerRecord, t: int) -> bool:
    """Return whether the follower drove timestep t without its camera."""
    return any(AlignmentState.parse(text) is AlignmentState.BLIND for text in _texts(follower, t))


def _with_timestep(states: Sequence[str]) -> Iterator[tuple[int, str]]:
    """Pair each state with its timestep: a prediction move opens the next one."""
    t = 0
    for text in states:
        state = AlignmentState.parse(text)
        t += state is not None and state.opens_timestep
        yield t, text


def _texts(follower: FollowerRecord, t: int) -> list[str]:
    return _by_timestep(follower.states).get(t, [])


@lru_cache(maxsize=16)
def _by_timestep(states: tuple[str, ...]) -> dict[int, list[str]]:
    """Sort a run's states by timestep, once for all of its timesteps."""
    found: dict[int, list[str]] = {}
    for timestep, text in _with_timestep(states):
        found.setdefault(timestep, []).append(text)
    return found


def movements_of(follower: FollowerRecord, indices: Sequence[int]) -> int:
    """Count a timestep's movements after its prediction move: a move of several legs counts as that many.

    Args:
        follower: whose moves.
        indices: of the timestep's moves in `follower.moved`; the first one is the prediction move and isn't counted.
    """
    return sum(max(1, len(legs or ())) for legs in _legs(follower, indices[1:]))


def _axes(follower: FollowerRecord, indices: Sequence[int]) -> dict[str, int] | None:
    counts = dict.fromkeys(AXES, 0)
    for legs in _legs(follower, indices):
        if legs is None:
            return None
        for axis in legs:
            counts[axis] += 1
    return counts


def _legs(follower: FollowerRecord, indices: Sequence[int]) -> Iterator[tuple[str, ...] | None]:
    """Yield the axes of each move's command, None where no commands are known.

    Every command is answered by one measured move, so they pair by their order.
    """
    known = 0 <= len(follower.commands) - len(follower.moved) <= 1
    for index in indices:
        if not known:
            yield None
            continue
        sizes = _sizes(follower.commands[index])
        yield tuple(axis for axis, size in zip(AXES, sizes, strict=True) if size > _LEAST)


def _sizes(motion: Motion) -> tuple[float, float, float]:
    """Lengths of a move's legs along u and v and of its turn; the drive turns first."""
    turn, forward, left = motion.legs
    return abs(left), abs(forward), abs(turn)


def _seconds(follower: FollowerRecord, first: int, last: int) -> float | None:
    stamps = follower.state_stamps_ns
    return (stamps[last] - stamps[first]) / 1e9 if len(stamps) == len(follower.states) else None
