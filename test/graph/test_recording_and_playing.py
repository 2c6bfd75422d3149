"""Recorder and player on the live graph: what is recorded, played and recorded again stays the same."""

import json
import os
import pty
import signal
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import String, UInt32
from std_srvs.srv import SetBool, Trigger

from dying_recorder import limit_file_size, ticks_in_finished_chunks, ticks_of
from forked_nodes import ForkedNode
from graph_lab import DEADLINE_S, Lab, open_lab, values_of
from graph_tools import STRICT
from node_server import COMMAND_LINE
from robot_formation import conversions, names
from robot_formation.bag.info import bag_info
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.recover import recover
from robot_formation.bag.writer import BagWriter
from synthetic_bag import STORE, text

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("bags")]

STRING, TICK, IMAGE = "std_msgs/msg/String", "std_msgs/msg/UInt32", "sensor_msgs/msg/Image"
ODOMETRY = "nav_msgs/msg/Odometry"
RELIABLE = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
LATCHED = QoSProfile(
    history=HistoryPolicy.KEEP_ALL,
    reliability=ReliabilityPolicy.RELIABLE,
    durability=DurabilityPolicy.TRANSIENT_LOCAL,
)
BEST_EFFORT = QoSProfile(depth=100, reliability=ReliabilityPolicy.BEST_EFFORT)

MIDDLEWARE = "\x1b[37;1mRTPS_"
"""In lines of Fast DDS, which finds a small disk too small for itself."""


class BagLab(Lab):
    """A lab that also calls the command line in its domain."""

    def formation(self, *arguments: object, **options: Any) -> subprocess.Popen[str]:
        environment = {**self.environment, **STRICT}
        words = list(map(str, arguments))
        if not options:
            self.processes.append(ForkedNode(COMMAND_LINE, words, environment))
        else:
            command = [sys.executable, "-m", "robot_formation.cli", *words]
            pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, **options}
            self.processes.append(subprocess.Popen(command, env=environment, text=True, **pipes))
        return self.processes[-1]

    def record(self, *arguments: object, **options: Any) -> subprocess.Popen[str]:
        """Start recording; returns when the recorder runs."""
        process = self.formation("record", *arguments, "--json", **options)
        assert self.complaint(process).startswith("recording into")
        return process

    def words_on(self, topic: str) -> list[str]:
        """A list that grows by each text said on a topic."""
        said: list[str] = []

        def hear(message: Any) -> None:
            said.append(message.data)

        self.node.create_subscription(String, topic, hear, RELIABLE)
        return said

    def complaint(self, process: subprocess.Popen[str]) -> str:
        """The next line of ours on a process's standard error."""
        assert process.stderr is not None
        while MIDDLEWARE in (line := process.stderr.readline()):
            pass
        return line

    def end(self, process: subprocess.Popen[str], code: int = 0) -> Any:
        process.send_signal(signal.SIGINT)
        return self.result(process, code)

    def result(self, process: subprocess.Popen[str], code: int = 0) -> Any:
        out, error = process.communicate(timeout=DEADLINE_S)
        assert process.returncode == code, error
        assert "Traceback" not in error
        if not code:
            return json.loads(out)
        return "".join(line for line in error.splitlines(keepends=True) if MIDDLEWARE not in line)


@pytest.fixture
def lab(tmp_path: Path) -> Iterator[BagLab]:
    with open_lab(tmp_path, BagLab) as made:
        yield made


def payloads(bag: Path) -> dict[str, list[bytes]]:
    with read_bag(bag) as opened:
        found: dict[str, list[bytes]] = {topic: [] for topic in opened.topics}
        for message in opened.raw_messages(opened.topics):
            found[message.topic].append(message.cdr)
    return found


def padded(message: object, type_name: str) -> bytes:
    cdr = bytes(STORE.serialize_cdr(message, type_name))
    return cdr + bytes(-len(cdr) % 4)


def write_many_kinds(path: Path) -> None:
    """Bursts at one time, a latched topic that keeps one, a history, best effort, and pictures."""
    topics = {
        "/burst": (TICK, TopicQos(history="keep_all", depth=0)),
        "/map": (STRING, TopicQos(durability="transient_local", depth=1)),
        "/history": (STRING, TopicQos(durability="transient_local", history="unknown", depth=0)),
        "/loose": (TICK, TopicQos(reliability="best_effort")),
        "/picture": (IMAGE, TopicQos(history="keep_all", depth=0)),
    }
    picture = np.arange(208 * 316 * 3, dtype=np.uint8).reshape(208, 316, 3)
    with BagWriter(path) as writer:
        for name, (type_name, qos) in topics.items():
            writer.add_topic(name, type_name, qos)
        for step in range(20):
            now = step * 20_000_000
            for number in range(100):
                writer.write("/burst", padded(STORE.types[TICK](100 * step + number), TICK), now)
            writer.write("/map", padded(text(f"map {step}"), STRING), now)
            writer.write("/map", padded(text(f"map {step}, corrected"), STRING), now)
            writer.write("/history", padded(text("x" * step), STRING), now)
            writer.write("/loose", padded(STORE.types[TICK](step), TICK), now)
            image = conversions.image(picture, "", now)
            cdr = conversions.to_cdr(image)
            writer.write("/picture", cdr + bytes(-len(cdr) % 4), now)


# What a busy machine may lose: best effort, and a topic whose publisher keeps one message while two are sent at once.
MAY_BE_LOST = ("/loose", "/map")


def assert_losses_are_told(recorded: list[bytes], sent: list[bytes], lost: int) -> None:
    """What is recorded is in order; what is missing in between is counted. All messages differ."""
    places = [sent.index(message) for message in recorded]
    assert places == sorted(set(places))
    if places:  # nobody can know of messages before the first and after the last
        assert places[-1] + 1 - places[0] <= len(recorded) + lost <= places[-1] + 1


def test_record_play_and_record_again_gives_the_same_messages_in_the_same_order(lab: BagLab, tmp_path: Path) -> None:
    write_many_kinds(tmp_path / "first")
    for source, target in (("first", "second"), ("second", "third")):
        sent = payloads(tmp_path / source)
        recorder = lab.record("--all", "-o", tmp_path / target)
        played = lab.result(lab.formation("play", tmp_path / source, "--wait", "20", "--json"))
        assert played["unheard"] == []
        assert played["messages"] == sum(map(len, sent.values()))
        assert set(played["schedule_error"]) == {"median_ms", "p99_ms", "worst_ms"}
        report = lab.end(recorder)
        recorded = payloads(tmp_path / target)
        assert report["dropped"] == {}
        assert recorded.keys() == sent.keys()
        for topic, messages in sent.items():
            if topic in MAY_BE_LOST:
                assert_losses_are_told(recorded[topic], messages, report["lost"].get(topic, 0))
            else:
                assert recorded[topic] == messages, topic
                assert topic not in report["lost"]
    with read_bag(tmp_path / "third") as bag:
        offered = {topic.name: topic.profiles[0] for topic in bag.contents}
    assert (offered["/loose"].reliability, offered["/map"].durability) == ("best_effort", "transient_local")


def test_topics_are_chosen_discovered_late_and_those_that_never_come_are_told(lab: BagLab, tmp_path: Path) -> None:
    recorder = lab.record(
        "/named", "/never", "--regex", "/match/.*", "-x", ".*/not", "-o", tmp_path / "bag", "--time", "simulated"
    )
    publishers = {
        name: lab.node.create_publisher(String, name, qos)
        for name, qos in {
            "/named": RELIABLE,
            "/match/loose": BEST_EFFORT,
            "/match/late": LATCHED,
            "/match/not": RELIABLE,
            "/other": RELIABLE,
        }.items()
    }
    wanted = ["/named", "/match/loose", "/match/late"]
    publishers["/match/late"].publish(String(data="before anybody listened"))
    lab.until(lambda: all(publishers[name].get_subscription_count() for name in wanted))
    for publisher in publishers.values():
        publisher.publish(String(data=publisher.topic_name))
    file = tmp_path / "bag.partial" / "bag_0.mcap"
    lab.until(lambda: b"parameters of /stranger" in file.read_bytes())
    report = lab.end(recorder)
    assert report["topics"] == {"/named": 1, "/match/loose": 1, "/match/late": 2}
    assert report["unseen"] == ["/never"]
    with read_bag(tmp_path / "bag") as bag:
        said = [(message.topic, message.message.data) for message in bag.messages(["/match/late"])]
        assert said == [("/match/late", "before anybody listened"), ("/match/late", "/match/late")]
        details = bag.metadata("robot_formation")
        assert json.loads(details["parameters of /stranger"])["use_sim_time"] is False
        assert "robot_formation" in json.loads(details["versions"])
        assert bag.contents[0].type_hash == STORE.hash_rihs01(STRING)


def test_the_recorder_tells_how_it_goes_and_keeps_that_out_of_its_bag(lab: BagLab, tmp_path: Path) -> None:
    heard = lab.collect(names.DIAGNOSTICS)
    recorder = lab.record("--all", "-o", tmp_path / "bag")
    publisher = lab.node.create_publisher(UInt32, "/tick", RELIABLE)
    lab.until(publisher.get_subscription_count)
    publisher.publish(UInt32(data=1))

    def told(key: str) -> list[str]:
        return [value.value for value in values_of(heard, "recorder") if value.key == key]

    lab.until(lambda: told("messages")[-1:] == ["1"])
    assert told("topics")[-1] == "1"
    assert set(told("dropped")) == set(told("lost")) == {"0"}
    assert all(array.status[0].level == b"\x00" for array in heard)
    # Other nodes' reports on the same topic are recorded, those of the recorder among them are not.
    stranger = lab.publisher(names.DIAGNOSTICS)
    lab.until(lambda: stranger.get_subscription_count() == 2)
    report = conversions.diagnostics("stranger", 0, "well", {}, 5)
    stranger.publish(report)
    before = len(heard)
    lab.until(lambda: len(heard) > before + 2)
    assert lab.end(recorder)["topics"] == {"/tick": 1, "/diagnostics": 1}
    with read_bag(tmp_path / "bag") as bag:
        (message,) = bag.messages(["/diagnostics"])
    assert message.message.status[0].name == "stranger"


def flood(lab: BagLab, publisher: Any, enough: Callable[[], bool]) -> None:
    """Publish numbers until a condition holds."""
    sent = 0
    while not enough():
        for _ in range(50):
            try:
                publisher.publish(UInt32(data=sent))
            except RuntimeError:  # rclpy's: it keeps all, and the recorder is behind
                lab.executor.spin_once(0.01)
            else:
                sent += 1
        lab.executor.spin_once(0.01)


FLOOD = """
import sys
import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from std_msgs.msg import UInt32

rclpy.init()
node = rclpy.create_node("flood")
qos = QoSProfile(depth=10, history=HistoryPolicy.KEEP_LAST, reliability=ReliabilityPolicy.RELIABLE)
publisher = node.create_publisher(UInt32, "/tick", qos)
while not publisher.get_subscription_count():
    pass
for number in range(int(sys.argv[1])):
    publisher.publish(UInt32(data=number))
publisher.wait_for_all_acked()
print("sent", flush=True)
sys.stdin.read()
"""


def test_messages_lost_in_a_flood_are_told_and_the_bag_is_whole(lab: BagLab, tmp_path: Path) -> None:
    sent = 60_000
    recorder = lab.record("/tick", "-o", tmp_path / "bag")
    source = subprocess.Popen(
        [sys.executable, "-c", FLOOD, str(sent)],
        env=lab.environment,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    )
    lab.processes.append(source)
    assert source.stdout is not None
    assert source.stdout.readline() == "sent\n"
    report = lab.end(recorder)
    found = ticks_of(tmp_path / "bag")
    assert found == sorted(set(found))
    assert found[-1] == sent - 1
    # What was sent before the first message that arrived was no loss: nobody had subscribed.
    assert report["messages"] == len(found)
    assert report["lost"].get("/tick", 0) == sent - found[0] - len(found)
    assert bag_info(tmp_path / "bag").to_mapping()["metadata"].get("lost", {}) == report["lost"]


def test_a_type_that_is_not_that_of_a_topic_made_by_the_recorder_is_told(lab: BagLab, tmp_path: Path) -> None:
    recorder = lab.record("/tf", "/words", "-o", tmp_path / "bag")
    publishers = [lab.node.create_publisher(String, name, RELIABLE) for name in ("/tf", "/words")]
    assert "/tf is not recorded: its type is std_msgs/msg/String" in "".join(
        lab.complaint(recorder) for _ in publishers
    )
    lab.until(publishers[1].get_subscription_count)
    assert lab.end(recorder)["topics"] == {"/words": 0}


def test_topics_called_tf_elsewhere_are_recorded_with_any_type_unless_a_formation_is_there(
    lab: BagLab, tmp_path: Path
) -> None:
    odometry = conversions.message_class(ODOMETRY)
    odom = lab.node.create_publisher(odometry, "/site/ground_truth/leader/odom", RELIABLE)
    recorder = lab.record("/camera/tf", "/site/ground_truth/leader/odom", "/site/tf", "-o", tmp_path / "bag")
    lab.until(odom.get_subscription_count)
    others = [lab.node.create_publisher(String, name, RELIABLE) for name in ("/camera/tf", "/site/tf")]
    lab.until(others[0].get_subscription_count)
    lines = [lab.complaint(recorder) for _ in range(3)]
    assert any("/site/tf is not recorded: its type is std_msgs/msg/String" in line for line in lines), lines
    others[0].publish(String(data="hello"))
    odom.publish(odometry())
    assert lab.end(recorder)["topics"]["/camera/tf"] == 1


def test_diagnostics_that_cannot_be_decoded_do_not_end_a_recorder_in_a_namespace(lab: BagLab, tmp_path: Path) -> None:
    options = [f"path:={tmp_path / 'bag'}", "own_namespace:=true"]
    recorder = lab.start("recorder", *(word for option in options for word in ("-p", option)), namespace="/site")
    kind = conversions.message_class(names.DIAGNOSTICS.type)
    diagnostics = lab.node.create_publisher(kind, "/diagnostics", RELIABLE)
    words = lab.node.create_publisher(String, "/site/words", RELIABLE)
    lab.until(lambda: diagnostics.get_subscription_count() and words.get_subscription_count())
    diagnostics.publish(b"\x00\x01\x00\x00" + b"\xff" * 40)
    words.publish(String(data="hello"))
    diagnostics.wait_for_all_acked()
    words.wait_for_all_acked()
    recorder.terminate()
    _, errors = recorder.communicate(timeout=60)
    assert recorder.returncode == 0, errors
    found = payloads(tmp_path / "bag")
    assert len(found["/site/words"]) == 1
    assert not found.get("/diagnostics")


@pytest.mark.parametrize("size", [3000, 20_000])
def test_a_recorder_that_is_killed_leaves_every_finished_chunk(lab: BagLab, tmp_path: Path, size: int) -> None:
    recorder = lab.record("/tick", "-o", tmp_path / "bag", "--chunk-size", "0.005")
    publisher = lab.node.create_publisher(UInt32, "/tick", RELIABLE)
    lab.until(publisher.get_subscription_count)
    file = tmp_path / "bag.partial" / "bag_0.mcap"
    flood(lab, publisher, lambda: file.stat().st_size > size)
    recorder.kill()
    recorder.communicate()
    finished = ticks_in_finished_chunks(file)
    assert finished
    assert recover(tmp_path / "bag.partial", tmp_path / "saved").messages == len(finished)
    assert ticks_of(tmp_path / "saved") == finished == list(range(len(finished)))


def test_a_recorder_whose_disk_is_full_ends_with_a_clear_error(lab: BagLab, tmp_path: Path) -> None:
    options = {"preexec_fn": limit_file_size}
    recorder = lab.record("/tick", "-o", tmp_path / "bag", "--compression", "none", "--chunk-size", "0.005", **options)
    publisher = lab.node.create_publisher(UInt32, "/tick", RELIABLE)
    lab.until(publisher.get_subscription_count)
    flood(lab, publisher, lambda: recorder.poll() is not None)
    begin, error = lab.result(recorder, code=2).strip().splitlines()
    assert begin == "recording /tick (std_msgs/msg/UInt32)"
    assert error.startswith("formation record: ")
    assert "File too large" in error
    assert f"formation recover {tmp_path / 'bag.partial'}" in error
    saved = recover(tmp_path / "bag.partial", tmp_path / "saved").messages
    assert ticks_of(tmp_path / "saved") == list(range(saved))
    assert saved > 100


def write_words(path: Path, count: int = 5) -> None:
    with BagWriter(path) as writer:
        writer.add_topic("/words", STRING, TopicQos(history="keep_all", depth=0))
        for number in range(count):
            writer.write("/words", padded(text(f"{number}"), STRING), (10 + number) * 10**8)


def test_the_player_steps_by_key_and_service_and_gives_the_time(lab: BagLab, tmp_path: Path) -> None:
    write_words(tmp_path / "bag")
    keys, terminal = pty.openpty()
    said, clock = lab.words_on("/renamed"), lab.collect(names.CLOCK_TOPIC)
    options = ["--pause", "--wait", "20", "--clock", "50", "--remap", "/words:=/renamed", "--json"]
    player = lab.formation(
        "play", tmp_path / "bag", *options, stdin=terminal, preexec_fn=lambda: own_terminal(terminal)
    )
    os.close(terminal)
    lab.until(lambda: clock)
    assert said == []
    os.write(keys, b"s")
    lab.until(lambda: said == ["0"])
    os.write(keys, b"\x1b[C")
    lab.until(lambda: said == ["0", "1"])
    step = lab.node.create_client(Trigger, "/player/step")
    lab.until(step.service_is_ready)
    answer = step.call_async(Trigger.Request())
    lab.until(lambda: answer.done() and said == ["0", "1", "2"])
    assert answer.result().success
    lab.until(lambda: clock[-1].clock.sec == 1 and clock[-1].clock.nanosec == 200_000_000)
    pause = lab.node.create_client(SetBool, "/player/pause")
    lab.until(pause.service_is_ready)
    pause.call_async(SetBool.Request(data=False))
    lab.until(lambda: len(said) == 5)
    report = lab.result(player)
    os.close(keys)
    assert (report["messages"], report["rounds"], report["interrupted"]) == (5, 1, False)
    stamps = [conversions.to_ns(message.clock) for message in clock]
    assert stamps == sorted(stamps)


def own_terminal(terminal: int) -> None:
    """Make a terminal the controlling one of this process's own session, as a shell does."""
    import fcntl
    import termios

    os.setsid()
    fcntl.ioctl(terminal, termios.TIOCSCTTY, 0)


def test_a_player_node_repeats_its_bag_until_a_signal(lab: BagLab, tmp_path: Path) -> None:
    write_words(tmp_path / "bag", count=2)
    said = lab.words_on("/words")
    player = lab.start("player", "-p", f"bag:={tmp_path / 'bag'}", "-p", "loop:=true", "-p", "wait_s:=20.0")
    lab.until(lambda: len(said) >= 5)
    assert said[:5] == ["0", "1", "0", "1", "0"]
    player.send_signal(signal.SIGTERM)
    _, error = player.communicate(timeout=DEADLINE_S)
    assert player.returncode == 0, error


def test_ctrl_c_ends_a_play_with_130(lab: BagLab, tmp_path: Path) -> None:
    write_words(tmp_path / "bag", count=1000)
    heard = lab.words_on("/words")
    player = lab.formation("play", tmp_path / "bag", "--wait", "20")
    lab.until(lambda: heard)
    player.send_signal(signal.SIGINT)
    out, error = player.communicate(timeout=DEADLINE_S)
    assert player.returncode == 130
    assert "schedule error: median" in out
    assert error.strip().splitlines()[-1] == "formation play: interrupted"
