"""Every node as a citizen of a ROS graph: names, remappings, quality of service, parameters, Ctrl-C."""

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import rclpy
import yaml
from rclpy.parameter import Parameter, parameter_value_to_python
from rclpy.parameter_client import AsyncParameterClient
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

from graph_lab import Lab, open_lab
from robot_formation import names
from robot_formation.bag.writer import BagWriter
from robot_formation.components.base import Component, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.names import Qos, absolute
from robot_formation.parameters import from_mapping
from synthetic_bag import SyntheticRun

pytestmark = [pytest.mark.graph, pytest.mark.xdist_group("citizenship")]

# A site of its own: whoever hard-codes a name gets out of it.
SITE = "/site"
TICKS = f"{SITE}/ticks"
ROBOTS = {"leader": "leader", "": ""}
NAMESPACES = {
    **{kind: f"{SITE}/{ROBOTS.get(entry.robots, 'follower_1')}".rstrip("/") for kind, entry in KINDS.items()},
    "recorder": SITE,
    "player": SITE,
}
# By convention of ROS the same for all.
OF_ROS = {"/diagnostics", "/parameter_events", "/rosout"}
NEVER = 3600.0


def full_name(node: str) -> str:
    return f"{NAMESPACES[node]}/{node}"


def options_of(node: str, folder: Path) -> list[str]:
    """What a node is started with: the ticks' namespace, and what it can't start without."""
    own = {
        "leader": ["followers:=[follower_9]"],  # nobody: the run never begins
        "recorder": [f"path:={folder / 'bag'}", "topics:=[follower_1/alignment]"],
        "player": [f"bag:={folder / 'source'}", "paused:=true", "loop:=true", f"wait_s:={NEVER}"],
    }.get(node, [])
    common = [] if node == "player" else [f"formation_namespace:={TICKS}", f"wait_for_listeners_s:={NEVER}"]
    return [word for parameter in [*common, *own] for word in ("-p", parameter)]


class Site(Lab):
    """All nodes under a namespace of their own, the drive and the player with remappings."""

    def __init__(self, domain: int, folder: Path) -> None:
        super().__init__(domain, folder)
        self.folder = folder
        self.running: dict[str, subprocess.Popen[str]] = {}
        self.clients: dict[str, AsyncParameterClient] = {}
        with BagWriter(folder / "source") as writer:
            SyntheticRun(writer)

    def start_all(self, options: Callable[[str], list[str]]) -> None:
        remaps = {"drive": "moved:=displaced", "player": "/follower_1/moved:=played/moved"}
        for node, namespace in NAMESPACES.items():
            remap = ["-r", remaps[node]] if node in remaps else []
            self.running[node] = self.start(node, *options(node), *remap, namespace=namespace)
        wanted = set(NAMESPACES.items())
        self.until(lambda: wanted <= set(self.node.get_node_names_and_namespaces()))

    def interrupt_all(self) -> dict[str, int]:
        """Ctrl-C in the terminal of each node: the signal goes to its whole process group, and launch repeats it."""
        for process in self.running.values():
            os.killpg(process.pid, signal.SIGINT)
            os.killpg(process.pid, signal.SIGINT)
        ended = {}
        for node, process in self.running.items():
            _, errors = process.communicate(timeout=30)
            ended[node] = process.returncode
            assert "Traceback" not in errors, f"{node}: {errors}"
        self.rejoin()
        self.clients.clear()
        return ended

    def endpoint(self, find: Callable[[str], list[Any]], topic: str, node: str) -> Any:
        """The one publisher or subscription that a node has on a topic, when it has been discovered."""

        def found() -> list[Any]:
            return [info for info in find(topic) if info.node_name == node]

        self.until(found)
        (info,) = found()
        return info

    def client(self, node: str) -> AsyncParameterClient:
        if node not in self.clients:
            self.clients[node] = AsyncParameterClient(self.node, full_name(node))
            self.until(self.clients[node].services_are_ready)
        return self.clients[node]

    def answer(self, future: Any) -> Any:
        self.until(future.done)
        return future.result()

    def parameters(self, node: str) -> dict[str, Any]:
        """All of a node's parameters, as `ros2 param dump` gets them."""
        client = self.client(node)
        listed = self.answer(client.list_parameters()).result.names
        values = self.answer(client.get_parameters(listed)).values
        plain = [parameter_value_to_python(value) for value in values]
        return {n: v.tolist() if hasattr(v, "tolist") else v for n, v in zip(listed, plain, strict=True)}

    def set(self, node: str, name: str, value: Any) -> Any:
        """What `ros2 param set` does."""
        (result,) = self.answer(self.client(node).set_parameters([as_typed(name, value)])).results
        return result


def as_typed(name: str, value: Any) -> Parameter:
    """A value with the type that ROS's command line sees in it: an empty list is one of bool."""
    return Parameter(name, Parameter.Type.BOOL_ARRAY, []) if value == [] else Parameter(name, value=value)


def dump(node: str, parameters: dict[str, Any]) -> str:
    """The text that `ros2 param dump` prints: the full name as key, dotted names as nested mappings."""
    nested: dict[str, Any] = {}
    for name, value in sorted(parameters.items()):
        *groups, last = name.split(".")
        inner = nested
        for group in groups:
            inner = inner.setdefault(group, {})
            assert isinstance(inner, dict), f"'{name}' is in a group that is a parameter too"
        inner[last] = value
    return yaml.dump({full_name(node): {"ros__parameters": nested}}, default_flow_style=False)


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    with open_lab(tmp_path_factory.mktemp("site"), Site) as made:
        made.start_all(lambda node: options_of(node, made.folder))
        yield made


def component(kind: str) -> Component:
    entry = KINDS[kind]
    robot = NAMESPACES[kind].rpartition("/")[2] if entry.robots else ""
    values = {"followers": ["follower_9"]} if kind == "leader" else {}
    parameters = from_mapping(entry.parameter_class(), values, where=kind)
    made: Component = entry.component_class()(parameters, Place(robot, TICKS))
    return made


def topics_of(site: Site, node: str) -> set[str]:
    """Names of what a node publishes, subscribes to and serves."""
    inside = (node, NAMESPACES[node])
    return {
        name
        for found in (
            site.node.get_publisher_names_and_types_by_node(*inside),
            site.node.get_subscriber_names_and_types_by_node(*inside),
            site.node.get_service_names_and_types_by_node(*inside),
            site.node.get_client_names_and_types_by_node(*inside),
        )
        for name, _ in found
    }


def expected_names(node: str) -> set[str]:
    """What a node must be seen with, as far as it is known before: then the rest is there too."""
    if node == "recorder":
        return {f"{SITE}/follower_1/alignment"}
    built = component(node)
    topics = [*built.outputs(), *(entry.topic for entry in built.inputs())]
    found = {absolute(NAMESPACES[node], name) for name in [*(t.name for t in topics), *built.services()]}
    return {name.replace("moved", "displaced") if node == "drive" else name for name in found}


@pytest.mark.parametrize("node", [*KINDS, "recorder"])
def test_a_nodes_names_lie_in_its_namespace_and_that_of_the_ticks(site: Site, node: str) -> None:
    site.until(lambda: expected_names(node) <= topics_of(site, node))
    found = topics_of(site, node) - OF_ROS
    assert {name for name in found if not name.startswith((f"{NAMESPACES[node]}/", f"{TICKS}/"))} == set()


def test_users_remappings_count(site: Site) -> None:
    moved = f"{SITE}/follower_1/moved"
    site.until(lambda: moved.replace("moved", "displaced") in topics_of(site, "drive"))
    assert moved not in topics_of(site, "drive")
    site.until(lambda: f"{SITE}/played/moved" in topics_of(site, "player"))
    assert "/follower_1/moved" not in topics_of(site, "player")


def qos_of(info: Any) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    profile = info.qos_profile
    return (profile.reliability, profile.durability)


def expected(qos: Qos, durability: str | None = None) -> tuple[ReliabilityPolicy, DurabilityPolicy]:
    return (
        ReliabilityPolicy[qos.reliability.upper()],
        DurabilityPolicy[(durability or qos.durability).upper()],
    )


@pytest.mark.parametrize("kind", KINDS)
def test_topics_have_the_type_and_the_quality_of_service_of_the_nodes_page(site: Site, kind: str) -> None:
    built = component(kind)
    outputs = {absolute(NAMESPACES[kind], topic.name): topic for topic in [*built.outputs(), names.DIAGNOSTICS]}
    for name, topic in outputs.items():
        name = name.replace("moved", "displaced") if kind == "drive" else name
        info = site.endpoint(site.node.get_publishers_info_by_topic, name, kind)
        assert (info.topic_type, qos_of(info)) == (topic.type, expected(topic.qos)), name
        assert info.qos_profile.lifespan == info.qos_profile.deadline == rclpy.duration.Infinite
    for entry in built.inputs():
        name = absolute(NAMESPACES[kind], entry.topic.name)
        info = site.endpoint(site.node.get_subscriptions_info_by_topic, name, kind)
        assert (info.topic_type, qos_of(info)) == (entry.topic.type, expected(entry.topic.qos, "volatile")), name


@pytest.mark.parametrize(
    ("node", "name", "value", "says"),
    [
        ("world", "real_time_factor", 2, None),
        ("world", "surface", "bowel", "did you mean 'bowl'"),
        ("world", "robots", ["leader"], "it decides on topics"),
        ("overhead_tracker", "gate_m", 0.3, None),
        ("overhead_tracker", "robots", ["leader"], "it decides on topics"),
        ("drive", "wheel_speed_rad_s", 3, None),
        ("drive", "max_v_m", 20.0, "max_v_m"),
        ("drive", "calibration.v", [0, 33], None),
        ("drive", "calibration_file", "missing.yaml", "missing.yaml"),
        ("block_detector", "block_filtering", 20, None),
        ("predictor", "name", "previous", "a run's results rest on it"),
        ("fine_tuner", "first_step_m", 0.04, "a run's results rest on it"),
        ("leader", "timesteps", 7, "a run's results rest on it"),
        ("leader", "recorder", "other", "used while the node starts"),
        ("leader", "timestep", 7, "did you mean 'timesteps'"),
        ("recorder", "images", True, "record another one"),
        ("player", "rate", 2, None),
        ("player", "bag", "other", "the playback was prepared with it"),
    ],
)
def test_parameters_are_set_or_refused_with_a_reason(
    site: Site, node: str, name: str, value: Any, says: str | None
) -> None:
    # The follower aligns itself at its start: on a busy machine its drive may still be moving.
    site.until(lambda: "a move is under way" not in site.set(node, name, value).reason)
    result = site.set(node, name, value)
    assert result.successful == (says is None), result.reason
    assert (says or "") in result.reason
    if says is None:
        assert site.parameters(node)[name] == value


def test_a_parameter_is_set_by_its_former_name_too(site: Site) -> None:
    today = site.parameters("predictor")["formation.initial_loss"]
    assert site.set("predictor", "formation.handicap", today).successful
    pair = [Parameter(f"formation.{name}", value=today) for name in ("handicap", "initial_loss")]
    (result,) = {
        (answer.successful, answer.reason)
        for answer in [site.answer(site.client("predictor").set_parameters_atomically(pair)).result]
    }
    assert result == (
        False,
        "predictor: 'formation.initial_loss' is given twice, also by a former name; keep one of them",
    )


@pytest.mark.parametrize("node", NAMESPACES)
def test_param_load_takes_what_param_dump_gave(site: Site, node: str) -> None:
    parameters = [as_typed(name, value) for name, value in site.parameters(node).items()]
    results = site.answer(site.client(node).set_parameters(parameters)).results
    assert [result.reason for result in results if not result.successful] == []


def test_ctrl_c_ends_every_node_cleanly_and_its_dumped_parameters_start_it_again_as_it_was(site: Site) -> None:
    before = {node: site.parameters(node) for node in NAMESPACES}
    for node, parameters in before.items():
        (site.folder / f"{node}.yaml").write_text(dump(node, parameters))
    assert site.interrupt_all() == dict.fromkeys(NAMESPACES, 0)
    (site.folder / "bag").rename(site.folder / "first_bag")
    site.start_all(lambda node: ["--params-file", str(site.folder / f"{node}.yaml")])
    assert {node: site.parameters(node) for node in NAMESPACES} == before
    assert site.interrupt_all() == dict.fromkeys(NAMESPACES, 0)


def test_a_parameter_by_its_old_name_is_refused_with_the_new_one(lab: Lab) -> None:
    for node in ("predictor", "drive"):
        process = lab.start(node, "-p", "formation:=/site/formation", namespace="/follower_1")
        _, errors = process.communicate(timeout=60)
        assert process.returncode == 2
        assert "no parameter 'formation'; it is called 'formation_namespace' now" in errors


def test_a_parameter_by_its_former_name_too_is_refused(lab: Lab) -> None:
    both = ["-p", "formation.handicap:=2.0", "-p", "formation.initial_loss:=1.0"]
    process = lab.start("predictor", *both, namespace="/follower_1")
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "'formation.initial_loss' is given twice" in errors


def test_a_best_effort_camera_is_heard_where_its_user_says_so(lab: Lab) -> None:
    policy = "qos_overrides./follower_1/camera/image_raw.subscription.reliability"
    lab.start("block_detector", "-p", f"{policy}:=best_effort", namespace="/follower_1")
    topic = names.camera_image()
    lab.until(lambda: lab.node.get_subscriptions_info_by_topic(f"/follower_1/{topic.name}"))
    (info,) = lab.node.get_subscriptions_info_by_topic(f"/follower_1/{topic.name}")
    assert info.qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("qos_overrides./follower_1/camera/image_raw.subscription.reliability", "sometimes"),
        ("qos_overrides./follower_1/image_raw.subscription.reliability", "best_effort"),
    ],
)
def test_a_quality_of_service_that_is_none_or_has_no_subscription_is_refused(lab: Lab, name: str, value: Any) -> None:
    process = lab.start("block_detector", "-p", f"{name}:={value}", namespace="/follower_1")
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 2
    assert "Traceback" not in errors
    assert (value if value == "sometimes" else name) in errors
