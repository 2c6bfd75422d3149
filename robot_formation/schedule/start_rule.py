"""When one follower may begin its next timestep, by what it hears."""

from __future__ import annotations

from robot_formation.schedule.schedules import COLLECTION_TIMESTEPS, Schedule, Spacing, begin_s


class StartRule:
    """Keeps what a follower has heard.

    Attributes:
        schedule: who waits for whom.
        delayed: whether the place is where it was one timestep earlier.
        left: latest tick of the neighbour on the left: it has finished, or in `together` begun, that timestep.
        right: latest tick of the robot on the right, which has finished that timestep.
        now_ns: simulated time, for `timer`.
    """

    def __init__(
        self,
        schedule: Schedule = Schedule.TURNS,
        spacing: Spacing = Spacing.RIGID,
        *,
        first: bool = True,
        last: bool = True,
        period_s: float = 0.0,
        timesteps: int = 0,
    ) -> None:
        """Begin without having heard anything.

        Args:
            schedule: who waits for whom.
            spacing: what the place is.
            first: whether the robot on the left is the leader, which corrects nothing.
            last: whether no robot stands on the right.
            period_s: of `timer`.
            timesteps: of the run, for schedules in which nobody says that it has ended.
        """
        self.schedule = schedule
        self.delayed = spacing is Spacing.DELAYED
        self.left = self.right = -1
        self.now_ns = 0
        self._first = first
        self._last = last
        self._period_s = period_s
        self._timesteps = timesteps

    def may_begin(self, timestep: int) -> bool:
        """Whether a timestep may begin now."""
        match self.schedule:
            case Schedule.TIMER:
                due = self.now_ns >= round(1e9 * begin_s(timestep, self._period_s))
                return due and timestep <= self._timesteps
            case Schedule.WAVE:
                return (
                    timestep <= self._timesteps
                    and self.left >= timestep
                    and (self._last or timestep == 0 or self.right >= timestep - 1)
                )
        return self.left >= timestep

    def neighbour_corrects(self, timestep: int) -> bool:
        """Whether the robot on the left may correct its place at the same time as this one."""
        return self.schedule.at_once and timestep > 0 and not self._first and self.corrects(timestep)

    def corrects(self, timestep: int) -> bool:
        """Whether corrections follow the look; else what is left goes into the next timestep's move."""
        if timestep == 0:
            return True
        if self.delayed:
            return False
        return self.schedule is not Schedule.TIMER or timestep <= COLLECTION_TIMESTEPS
