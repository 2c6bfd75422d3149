"""Two runs on one machine never share a ROS domain."""

import contextlib
import os
import socket
from pathlib import Path

import pytest

from robot_formation.network import ros_domain
from robot_formation.network.ros_domain import DOMAINS, DomainError, DomainReservation, domain_ports, free_domain
from robot_formation.system.reservation import reserve

# Ids that no run takes. Ports and reservations belong to the whole machine, so that two of these tests at a time would
# take each other's domains: they run on one core, and their reservations have this process's id in their names.
UNUSED = range(228, 232)

pytestmark = pytest.mark.xdist_group("ros_domain")


@pytest.fixture(autouse=True)
def _own_domains(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ros_domain, "DOMAINS", UNUSED)
    monkeypatch.setattr(ros_domain, "reserve", lambda name: reserve(f"{os.getpid()}_{name}"))


def test_reservations_that_start_at_one_place_get_different_domains() -> None:
    with DomainReservation(5) as first, DomainReservation(5) as second, DomainReservation(5) as third:
        assert len({first, second, third}) == 3
        assert {first, second, third} <= set(UNUSED)


def test_a_domain_is_free_again_after_its_reservation() -> None:
    with DomainReservation(5) as before:
        pass
    with DomainReservation(5) as after:
        assert after == before


def test_when_every_domain_is_taken_one_clear_line_says_so() -> None:
    with contextlib.ExitStack() as taken:
        assert {taken.enter_context(DomainReservation(7)) for _ in UNUSED} == set(UNUSED)
        with pytest.raises(DomainError, match="no ROS domain from 228 to 231 is free"):
            free_domain()
    assert free_domain() in UNUSED


def test_a_domain_whose_ports_are_used_is_passed_over() -> None:
    wanted = free_domain()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as foreign:
        foreign.bind(("127.0.0.1", domain_ports(wanted)[10]))
        assert free_domain() != wanted


def test_ports_of_neighbouring_domains_do_not_overlap() -> None:
    assert domain_ports(0)[0] == 7400
    assert all(domain_ports(n)[-1] + 1 == domain_ports(n + 1)[0] for n in DOMAINS)
    assert domain_ports(DOMAINS[-1])[0] < 32768  # below the ports that Linux hands out


def test_unreadable_tables_of_ports_do_not_stop_a_run(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_arguments: object, **_keywords: object) -> None:
        raise PermissionError

    monkeypatch.setattr(Path, "read_text", refuse)
    assert free_domain() in UNUSED
