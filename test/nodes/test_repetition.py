"""What a log is told of things that go wrong again and again."""

from robot_formation.nodes.host.repetition import Repetitions


def test_the_first_few_of_a_kind_are_said_then_powers_of_ten() -> None:
    repetitions = Repetitions()
    said = [n for n in range(1, 12_001) if repetitions.line(f"leader: stamp {n * 0.37} s is -1e-3 s late") is not None]
    assert said == [1, 2, 3, 4, 5, 10, 100, 1000, 10_000]
    assert [repetitions.line("something else") for _ in range(6)] == ["something else"] * 5 + [None]


def test_a_count_is_said_with_the_latest_text() -> None:
    repetitions = Repetitions()
    lines = [repetitions.line(f"no topic '{name}'") for name in "abcdefghij"]
    assert lines[4:6] == ["no topic 'e'", None]
    assert lines[9] == "no topic 'j' (10 times so far)"


def test_any_number_of_kinds_takes_a_bounded_number_of_lines() -> None:
    repetitions = Repetitions()
    lines = [repetitions.line("x" * n) for n in range(3000)]
    assert sum(line is not None for line in lines) < 250
    assert max(len(line) for line in lines if line) < 1100
