"""Which robots the world waits for before it lets time go on, where several of them act at the same time.

In `turns` one robot acts at a time, and time stands still while its nodes compute, since nothing is owed. In the other
schedules another robot's motion may be under way then: without waiting, the next command would begin at a time that
depends on the machine's load. So time goes on only once every robot that has something to do has ordered it
(conservative synchronisation: Chandy and Misra, IEEE Transactions on Software Engineering 5, 1979). The world hears
bare ticks for it, as the robots do; nothing goes from it to them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from robot_formation.schedule.schedules import Schedule, begin_s, may_begin_in_wave


@dataclass
class _Robot:
    """A robot's part.

    Attributes:
        begun: latest timestep for which it has ordered something.
        allowed: latest timestep that it may begin, as far as the world knows.
        active: whether it has not finished the timestep begun.
        moving: whether a motion that it has ordered is under way.
        looking: whether frames that it has asked for are outstanding.
        lost: whether it has lost its neighbour, and orders nothing any more.
    """

    begun: int = -1
    allowed: int = -1
    active: bool = False
    moving: bool = False
    looking: bool = False
    lost: bool = False

    @property
    def busy(self) -> bool:
        """Whether something that it has ordered is under way."""
        return self.moving or self.looking

    @property
    def awaited(self) -> bool:
        """Whether its nodes have to order something, or to say that they are done."""
        return not (self.busy or self.lost) and (self.active or self.allowed > self.begun)


class AwaitedRobots:
    """Keeps who has to order something next; nobody in `turns`. Messages of several topics may come in any order."""

    def __init__(self, schedule: Schedule, robots: Sequence[str], timesteps: int, period_s: float) -> None:
        """Begin before the first alignment.

        Args:
            schedule: who waits for whom.
            robots: names, the leader first, then along the chain.
            timesteps: of the run.
            period_s: of `timer`.
        """
        self._schedule = schedule
        self._names = list(robots)
        self._robots = {name: _Robot() for name in robots}
        self._leader = self._names[0]
        self._timesteps = timesteps
        self._period_s = period_s
        self._period = 0
        self._finished = {0: 0}
        self._robots[self._leader].begun = 0  # it has nothing to do in the first alignment
        if schedule.at_once:
            self._allow(self._names, 0)
        elif schedule is not Schedule.TURNS:
            self._allow(self._names[1:2], 0)

    @property
    def any(self) -> bool:
        """Whether time has to stand still."""
        return self._schedule is not Schedule.TURNS and any(robot.awaited for robot in self._robots.values())

    def names(self) -> list[str]:
        """List who is waited for."""
        return [name for name, robot in self._robots.items() if robot.awaited] if self.any else []

    def ordered(self, name: str, *, frames: bool = False) -> None:
        """A robot has ordered a motion, or frames."""
        robot = self._robots[name]
        robot.looking = robot.looking or frames
        robot.moving = robot.moving or not frames
        if not robot.active:
            robot.active = True
            robot.begun += 1
            if self._schedule is Schedule.TOGETHER:
                self._allow(self._names, robot.begun)  # its tick may come later than its order

    def rests(self, name: str) -> None:
        """A robot's motion has ended; the next leg of its move may follow."""
        self._robots[name].moving = False

    def looked(self, name: str) -> None:
        """A robot has got the frames that it has asked for."""
        self._robots[name].looking = False

    def idle(self, name: str) -> None:
        """A robot has nothing more to do in its timestep (the leader: its move has ended).

        An order that is under way is of the next one then.
        """
        robot = self._robots[name]
        robot.active = robot.busy
        robot.begun += robot.busy

    def give_up(self, name: str) -> None:
        """A robot has lost its neighbour and stands from now on."""
        self._robots[name].lost = True

    @property
    def stuck(self) -> bool:
        """Whether nobody has anything to order any more because a robot is lost; by the clock time goes on."""
        waiting = self._schedule in (Schedule.WAVE, Schedule.TOGETHER) and not self.any
        return waiting and any(robot.lost for robot in self._robots.values())

    def finished(self, name: str, timestep: int) -> None:
        """A robot's tick: in `wave` it lets its neighbours begin the next timestep."""
        if self._schedule is not Schedule.WAVE or timestep > self._timesteps:
            return
        number = self._names.index(name)
        if number or timestep:
            self.idle(name)
        self._finished[number] = max(timestep, self._finished.get(number, -1))
        for other in range(max(number - 1, 0), min(number + 2, len(self._names))):
            following = self._finished.get(other, -1) + 1
            if may_begin_in_wave(other, len(self._names), following, self._finished):
                self._allow(self._names[other : other + 1], following)

    def begun(self, name: str, timestep: int) -> None:
        """A robot's tick in `together`: it has begun a timestep, and lets the robot on its right begin it too."""
        number = self._names.index(name)
        if timestep == 0:
            self._allow(self._names[number + 1 : number + 2], 0)
        elif number == 0:
            self._allow(self._names, timestep)  # the ticks of the others follow in the same instant

    def _allow(self, names: Sequence[str], timestep: int) -> None:
        for name in names if timestep <= self._timesteps else ():
            self._robots[name].allowed = max(timestep, self._robots[name].allowed)

    # --- timer ------------------------------------------------------------------------------------------------------

    @property
    def period_end_ns(self) -> int | None:
        """Simulated time up to which time goes on by itself; None after the last timestep's period, and in
        other schedules.
        """
        if self._schedule is not Schedule.TIMER or self._period > self._timesteps:
            return None
        return round(1e9 * begin_s(self._period + 1, self._period_s))

    def period_ended(self) -> None:
        """The next timestep begins by the clock; whoever is busy is late and begins it later."""
        self._period += 1
        self._allow(self._names, self._period)
