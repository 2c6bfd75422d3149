"""Places in the leader's frame are sums of slots."""

from robot_formation.geometry.se2 import Motion
from robot_formation.geometry.slots import leader_places, slot


def test_a_slot_is_to_the_right_and_ahead() -> None:
    place = slot(0.32, -0.05)
    assert (place.u_m, place.v_m, place.yaw_rad) == (0.32, -0.05, 0.0)
    assert place == Motion(-0.05, -0.32)


def test_places_beside_the_leader_add_up_and_the_leaders_own_is_where_it_stands() -> None:
    found = leader_places([slot(0.32, -0.05), slot(0.4, 0.1), slot(0.3)])
    assert found[0] == Motion()
    assert [(round(place.u_m, 9), round(place.v_m, 9)) for place in found[1:]] == [
        (0.32, -0.05),
        (0.72, 0.05),
        (1.02, 0.05),
    ]


def test_equal_slots_add_up_to_products_to_the_last_bit() -> None:
    assert [place.u_m for place in leader_places([slot(0.32)] * 10)] == [0.32 * number for number in range(11)]
