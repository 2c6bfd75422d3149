"""Recorder and player of bags: what is recorded without a loss, what it costs, and how well a schedule is kept.

A process publishes small messages (UInt32) and noisy pictures (316 x 208) at rising rates while `formation record`
records them. The plain mcap writer is fed the same messages in process, without a middleware, as the
measure of what Python can do. Then a bag of ten seconds with 220 messages/s is played at rate 1.

Run: nice python bench/bags.py [--seconds S] [--json]
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from mcap.writer import CompressionType, Writer

from comparison import Comparison, add_comparisons, as_json
from robot_formation import conversions
from robot_formation.bag.definitions import definition
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.writer import BagWriter
from robot_formation.launching.environment import node_environment
from robot_formation.network.ros_domain import DomainReservation

TICK, IMAGE = "std_msgs/msg/UInt32", "sensor_msgs/msg/Image"
PUBLISHER = """
import sys, time
import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from robot_formation import conversions
path, type_name, rate, seconds = sys.argv[1], sys.argv[2], float(sys.argv[3]), float(sys.argv[4])
data = open(path, "rb").read()
size = int(sys.argv[5])
payloads = [data[place:place + size] for place in range(0, len(data), size)]
rclpy.init()
node = rclpy.create_node("source")
qos = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
publisher = node.create_publisher(conversions.message_class(type_name), "/data", qos)
while not publisher.get_subscription_count():
    time.sleep(0.01)
began, sent, full = time.monotonic(), 0, 0
while (elapsed := time.monotonic() - began) < seconds:
    if sent > elapsed * rate:
        time.sleep(min(0.001, 1.0 / rate))
        continue
    try:
        publisher.publish(payloads[sent % len(payloads)])
        sent += 1
    except RuntimeError:
        full += 1
        time.sleep(0.001)
publisher.wait_for_all_acked()
print(sent, full, elapsed)
"""


def payloads(folder: Path) -> dict[str, list[bytes]]:
    """Some messages of both kinds: counters and noisy pictures, each kind of one size."""
    noise = np.random.default_rng(0)
    pictures = [noise.integers(0, 256, (208, 316, 3), dtype=np.uint8) for _ in range(16)]
    found = {
        TICK: [conversions.to_cdr(conversions.uint32(number)) for number in range(1000)],
        IMAGE: [conversions.to_cdr(conversions.image(picture, "", 0)) for picture in pictures],
    }
    for type_name, messages in found.items():
        (folder / type_name.replace("/", "_")).write_bytes(b"".join(messages))
    return found


def formation(environment: dict[str, str], *arguments: Path | str) -> subprocess.Popen[str]:
    command = [sys.executable, "-m", "robot_formation.cli", *map(str, arguments)]
    return subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


def record(
    folder: Path, environment: dict[str, str], type_name: str, size: int, rate: float, seconds: float, compression: str
) -> dict[str, float]:
    """Record a publisher; returns what came of it and the recorder's processor time while it recorded."""
    bag = folder / f"bag_{time.monotonic_ns()}"
    options = ["--compression", compression, "--json"]
    recorder = formation(environment, "record", "/data", "-o", bag, *options)
    assert recorder.stderr is not None
    recorder.stderr.readline()
    before = processor_s(recorder.pid)
    file = folder / type_name.replace("/", "_")
    source = subprocess.run(
        [sys.executable, "-c", PUBLISHER, str(file), type_name, str(rate), str(seconds), str(size)],
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    sent, full, elapsed = source.stdout.split()
    recorder.send_signal(signal.SIGINT)
    cpu_s = -before
    while recorder.poll() is None:
        cpu_s = max(cpu_s, processor_s(recorder.pid) - before)
        time.sleep(0.01)
    report = json.loads(recorder.communicate()[0])
    count = report["messages"]
    return {
        "asked_per_s": rate,
        "sent": int(sent),
        "recorded": count,
        "dropped": sum(report["dropped"].values()),
        "lost": sum(report["lost"].values()),
        "publisher_had_to_wait": int(full),
        "messages_per_s": count / float(elapsed),
        "mb_per_s": count * size / float(elapsed) / 1e6,
        "cpu_ms_per_mb": 1e3 * cpu_s / (count * size / 1e6),
        "cpu_us_per_message": 1e6 * cpu_s / count,
    }


def processor_s(pid: int) -> float:
    """Processor time of a process and its threads, seconds."""
    try:
        fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    except OSError:
        return 0.0
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def plain(folder: Path, type_name: str, messages: Sequence[bytes], count: int, compression: str) -> dict[str, float]:
    """The mcap library's writer alone, fed in process."""
    kind = {"zstd": CompressionType.ZSTD, "none": CompressionType.NONE}[compression]
    began_s, began = used_s(), time.perf_counter()
    with (folder / f"plain_{time.monotonic_ns()}.mcap").open("wb") as stream:
        writer = Writer(stream, compression=kind)
        writer.start(profile="ros2")
        schema = writer.register_schema(type_name, "ros2msg", definition(type_name).text.encode())
        channel = writer.register_channel("/data", "cdr", schema)
        for number in range(count):
            writer.add_message(channel, number, messages[number % len(messages)], number, number)
        writer.finish()
    elapsed, cpu_s = time.perf_counter() - began, used_s() - began_s
    return {
        "messages_per_s": count / elapsed,
        "mb_per_s": count * len(messages[0]) / elapsed / 1e6,
        "cpu_ms_per_mb": 1e3 * cpu_s / (count * len(messages[0]) / 1e6),
        "cpu_us_per_message": 1e6 * cpu_s / count,
    }


def used_s() -> float:
    usage = resource.getrusage(resource.RUSAGE_SELF)
    return usage.ru_utime + usage.ru_stime


def write_schedule(path: Path, seconds: float) -> None:
    """A bag of 200 small messages per second on two topics, and 20 pictures per second."""
    tick, picture = (
        conversions.to_cdr(conversions.uint32(1)),
        conversions.to_cdr(conversions.image(np.zeros((208, 316, 3), np.uint8), "", 0)),
    )
    with BagWriter(path) as writer:
        writer.add_topic("/a", TICK, TopicQos())
        writer.add_topic("/b", TICK, TopicQos())
        writer.add_topic("/picture", IMAGE, TopicQos())
        for number in range(int(seconds * 100)):
            writer.write("/a", tick, number * 10_000_000)
            writer.write("/b", tick, number * 10_000_000 + 3_000_000)
            if number % 5 == 0:
                writer.write("/picture", picture, number * 10_000_000 + 6_000_000)


def play(folder: Path, environment: dict[str, str], seconds: float, *, recorded: bool) -> dict[str, float]:
    """Play a bag at rate 1, with nobody listening or with a recorder."""
    source = folder / "schedule"
    if not source.exists():
        write_schedule(source, seconds)
    target = folder / f"again_{recorded}"
    recorder = formation(environment, "record", "--all", "-o", target, "--json") if recorded else None
    if recorder:
        assert recorder.stderr is not None
        recorder.stderr.readline()
    player = formation(environment, "play", source, "--wait", "20" if recorded else "0", "--json")
    report = json.loads(player.communicate()[0])
    if recorder:
        recorder.send_signal(signal.SIGINT)
        recorder.communicate()
        with read_bag(target) as bag:
            assert bag.message_count == report["messages"]
    errors: dict[str, float] = report["schedule_error"]
    return errors


def row(name: str, found: dict[str, float]) -> None:
    loss = (
        f"{found['dropped']} dropped, {found['lost']} lost, {found['sent'] - found['recorded']} missing"
        if "sent" in found
        else "-"
    )
    print(
        f"| {name} | {found['messages_per_s']:.0f} | {found['mb_per_s']:.1f} | {found['cpu_us_per_message']:.0f} | "
        f"{found['cpu_ms_per_mb']:.1f} | {loss} |"
    )


def comparisons(results: Mapping[str, Mapping[str, float]]) -> Iterator[Comparison]:
    """Yield the recorder's processor time beside the plain writer's, and what was recorded beside what was sent."""
    for name, found in results.items():
        if "sent" not in found:
            continue
        peer = results[f"mcap writer in process: {name.partition(': ')[2]}"]
        used, beside = found["cpu_us_per_message"], peer["cpu_us_per_message"]
        yield Comparison(
            f"{name}: processor time per message", used, beside, "us", "mcap's writer without a middleware"
        )
        yield Comparison(
            f"{name}: recorded", found["recorded"], found["sent"], "messages", "sent", larger_is_better=True
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seconds", type=float, default=5.0, help="of publishing per case")
    parser.add_argument("--small-rates", type=float, nargs="+", default=[2000.0, 8000.0, 16000.0], help="messages/s")
    parser.add_argument("--image-rates", type=float, nargs="+", default=[60.0, 300.0, 600.0], help="pictures/s")
    parser.add_argument("--json", action="store_true")
    add_comparisons(parser)
    args = parser.parse_args()
    results: dict[str, dict[str, float]] = {}
    with tempfile.TemporaryDirectory() as name, DomainReservation() as domain:
        folder = Path(name)
        environment = node_environment(domain, folder)
        kinds = payloads(folder)
        for type_name, rates in ((TICK, args.small_rates), (IMAGE, args.image_rates)):
            messages = kinds[type_name]
            for compression in ("zstd", "none"):
                kind = f"{'small' if type_name == TICK else 'picture'}, {compression}"
                count = round(max(rates) * args.seconds)
                results[f"mcap writer in process: {kind}"] = plain(folder, type_name, messages, count, compression)
                for rate in rates:
                    results[f"formation record, {rate:g}/s: {kind}"] = record(
                        folder, environment, type_name, len(messages[0]), rate, args.seconds, compression
                    )
        played = {
            "alone": play(folder, environment, 10.0, recorded=False),
            "with a recorder": play(folder, environment, 10.0, recorded=True),
        }
    if args.comparisons:
        print(as_json(comparisons(results)))
        return
    if args.json:
        print(json.dumps({**results, "play": played}, indent=2))
        return
    print("| what | messages/s | MB/s | processor us/message | processor ms/MB | loss |\n|---|---|---|---|---|---|")
    for name, found in results.items():
        row(name, found)
    for name, found in played.items():
        print(f"play {name}: schedule error " + ", ".join(f"{key} {value:.3f}" for key, value in found.items()))


if __name__ == "__main__":
    main()
