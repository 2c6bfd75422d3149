"""README and docs agree with the code: topics, parameters, graph, verbs, links."""

import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

import make_parameter_tables
from repository import PACKAGE, ROOT
from robot_formation import names
from robot_formation.cli.verbs import VERBS
from robot_formation.components.base import Component, Place
from robot_formation.components.catalogue import KINDS
from robot_formation.experiment.scenario import load_track
from robot_formation.launching.arguments import ARGUMENTS
from robot_formation.names import Qos, Topic
from robot_formation.parameters import specs

NODE_PAGES = ROOT / "docs" / "reference" / "nodes"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", ROOT / "bags" / "README.md", *(ROOT / "docs").rglob("*.md")]
NODES = [*KINDS, "recorder", "player", "progress", "viewer"]
QOS = {
    "event": names.EVENT,
    "history": names.HISTORY,
    "latched": names.LATCHED,
    "growing": names.GROWING,
    "clock": names.CLOCK,
    "status": names.STATUS,
}
TOPIC_ROW = re.compile(r"\| (reads|writes) \| `([^`]+)` \| (\S+) \| (\w+) \|")
EDGE = re.compile(r'^  (\w+) -- "([^"]+)" --> (\w+)$', re.MULTILINE)
# The boxes of the README's graph: executable and robot.
BOXES = {
    "world": ("world", ""),
    "overhead_tracker": ("overhead_tracker", ""),
    "leader": ("leader", "leader"),
    "leader_drive": ("drive", "leader"),
    **{kind: (kind, "follower_1") for kind in ("drive", "block_detector", "fine_tuner", "predictor")},
}


def component(kind: str, robot: str) -> Component:
    entry = KINDS[kind]
    return entry.component_class()(load_track("two").of_robot(entry, robot), Place(robot))


def as_documented(topic: Topic, kind: str, robot: str) -> str:
    """A topic's name as the page of its node writes it, whichever robot the node belongs to."""
    name = topic.name
    if kind == "fine_tuner":
        name = name.replace("/formation/leader/", "/formation/<beacon neighbour>/")
        name = name.replace(f"/formation/{robot}/", "/formation/<robot>/")
    if kind == "leader":
        name = re.sub(r"/formation/follower_\d+/", "/formation/<follower>/", name)
    if kind in ("world", "overhead_tracker"):
        name = re.sub(r"(^|/)(leader|follower_\d+)/", r"\1<robot>/", name)
    return name


def qos_name(qos: Qos) -> str:
    return next(name for name, known in QOS.items() if known == qos)


@pytest.mark.parametrize("kind", KINDS)
def test_a_nodes_page_lists_exactly_its_topics_with_type_and_qos(kind: str) -> None:
    robot = KINDS[kind].robots_of(1)[0]
    built = component(kind, robot)
    listened = [replace(i.topic, qos=replace(i.topic.qos, durability="volatile")) for i in built.inputs()]
    expected = {
        (direction, as_documented(topic, kind, robot), topic.type, qos_name(topic.qos))
        for direction, topics in (("writes", built.outputs()), ("reads", listened))
        for topic in topics
    }
    assert set(TOPIC_ROW.findall((NODE_PAGES / f"{kind}.md").read_text())) == expected


@pytest.mark.parametrize("kind", KINDS)
def test_a_nodes_page_names_its_services_and_diagnostics(kind: str) -> None:
    built = component(kind, KINDS[kind].robots_of(1)[0])
    page = (NODE_PAGES / f"{kind}.md").read_text()
    for name in [*built.services(), *built.details()]:
        assert f"`{name}`" in page


@pytest.mark.parametrize(
    ("node", "modules"), [("recorder", ("recorder_node", "recorder_health")), ("player", ("player_node",))]
)
def test_the_pages_of_recorder_and_player_name_what_these_make_beside_a_bags_topics(
    node: str, modules: tuple[str, ...]
) -> None:
    code = "".join((PACKAGE / "nodes" / node / f"{module}.py").read_text() for module in modules)
    page = (NODE_PAGES / f"{node}.md").read_text()
    for kind, name in re.findall(r'create_service\((\w+), "([^"]+)"', code):
        assert f"| `{name}` | std_srvs/srv/{kind} |" in page
    own = [getattr(names, name) for name in re.findall(r"= names\.([A-Z]\w+)$", code, re.MULTILINE)]
    assert len(own) == code.count("create_publisher(")
    for topic in own:
        assert f"`{topic.name}` ({topic.type}, {qos_name(topic.qos)})" in page


@pytest.mark.parametrize("name", NODES)
def test_node_pages_have_one_shape(name: str) -> None:
    page = (NODE_PAGES / f"{name}.md").read_text()
    title, *sections = re.findall(r"^##? (.+)$", re.sub(r"```.*?```", "", page, flags=re.DOTALL), re.MULTILINE)
    assert title == name
    assert sections == ["Usage", "Topics", "Services", "Diagnostics", "Exit codes", "Parameters"]
    assert page.split("## Usage")[0].strip().count("\n") > 1, "what it is for comes first"
    assert f"ros2 run robot_formation {name} --ros-args" in page


@pytest.mark.parametrize("kind", KINDS)
def test_topics_of_poses_pictures_and_blocks_name_their_frame(kind: str) -> None:
    stamped = r"(geometry|nav|sensor)_msgs/msg/(?!JointState)"
    rows = re.findall(
        rf"^\| (?:reads|writes) \| `([^`]+)` \| {stamped}\w+ \| \w+ \| (.*?) \|",
        (NODE_PAGES / f"{kind}.md").read_text(),
        re.MULTILINE,
    )
    assert [topic for topic, _, frame in rows if not frame.strip()] == []


@pytest.mark.parametrize("name", [*NODES, "common"])
def test_a_pages_parameter_table_is_up_to_date(name: str) -> None:
    before, after = make_parameter_tables.updated(name, make_parameter_tables.parameter_classes()[name])
    assert before == after, "run python docs/make_parameter_tables.py"


@pytest.mark.parametrize("name", NODES)
def test_every_parameter_of_a_node_is_on_its_page(name: str) -> None:
    parameters = make_parameter_tables.parameter_classes()[name]
    page = (NODE_PAGES / f"{name}.md").read_text()
    assert [parameter for parameter in specs(parameters) if f"\n| `{parameter}` |" not in page] == []


def test_the_qos_table_says_what_the_profiles_are() -> None:
    page = (NODE_PAGES / "common.md").read_text()
    for name, qos in QOS.items():
        assert len(fields(qos)) == 4
        history = qos.history.replace("_", " ") + (f" {qos.depth}" if qos.depth else "")
        assert f"| {name} | {qos.reliability} | {qos.durability.replace('_', ' ')} | {history} |" in page


def test_the_readmes_graph_is_the_real_one() -> None:
    def absolute(robot: str, topic: Topic) -> str:
        name = topic.name
        return name if name.startswith("/") else names.under(f"/{robot}" if robot else "", name)

    built = {box: component(kind, robot) for box, (kind, robot) in BOXES.items()}
    writers, readers = {}, {}
    for box, (_, robot) in BOXES.items():
        for topic in built[box].outputs():
            writers[absolute(robot, topic).lstrip("/")] = box
        for entry in built[box].inputs():
            readers[absolute(robot, entry.topic).lstrip("/")] = box
    expected = {(writers[name], name, reader) for name, reader in readers.items()}
    drawn = set()
    for source, labels, target in EDGE.findall((ROOT / "README.md").read_text()):
        robot = BOXES[source][1] or BOXES[target][1]
        for label in labels.split(", "):
            drawn.add((source, label.lstrip("/") if label.startswith("/") else f"{robot}/{label}", target))
    assert drawn == expected


def test_the_readme_links_to_every_node_and_names_every_verb() -> None:
    readme = (ROOT / "README.md").read_text()
    for node in NODES:
        assert f"](docs/reference/nodes/{node}.md)" in readme
    for verb in VERBS:
        name = verb.__name__.rpartition(".")[2].rstrip("_")
        assert re.search(rf"^\|[^|]*`{name}\b", readme, re.MULTILINE)


def test_the_pages_scenario_can_be_loaded(tmp_path: Path) -> None:
    from robot_formation.experiment.scenario import load

    text = re.findall(r"```yaml\n(.*?)```", (ROOT / "docs" / "how-to" / "scenarios.md").read_text(), re.DOTALL)[0]
    (tmp_path / "scenario.yaml").write_text(text)
    load(tmp_path / "scenario.yaml").check()


def test_the_installations_launch_arguments_are_those_of_the_launch_file() -> None:
    command = re.findall(r"ros2 launch .*\\\n.*", (ROOT / "docs" / "how-to" / "installation.md").read_text())[0]
    used = re.findall(r"(\w+):=", command)
    assert used
    assert set(used) <= set(ARGUMENTS)


def test_the_readmes_python_example_runs(capsys: pytest.CaptureFixture[str]) -> None:
    text = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), re.DOTALL)[0]
    exec(compile(text, "README.md", "exec"), {})
    *timesteps, last = capsys.readouterr().out.splitlines()
    assert len(timesteps) == 4
    outcome, correction_m = last.split()
    assert outcome == "done"
    assert 0.0 <= float(correction_m) < 0.1


def anchors(page: Path) -> set[str]:
    """Anchors that GitHub makes of a page's headings."""
    headings = re.findall(r"^#+ (.+)$", re.sub(r"```.*?```", "", page.read_text(), flags=re.DOTALL), re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_relative_links_lead_somewhere(page: Path) -> None:
    broken = []
    for link in re.findall(r"\]\(([^)\s]+)\)", page.read_text()):
        if re.match(r"[a-z]+:", link):
            continue
        path, _, anchor = link.partition("#")
        target = (page.parent / path).resolve() if path else page
        if not target.exists() or (anchor and anchor not in anchors(target)):
            broken.append(link)
    assert broken == []
