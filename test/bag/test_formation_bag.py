"""A formation's run in a bag, wherever its namespace lies."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from cli_tools import complaint
from repository import ROOT
from robot_formation.analysis.from_bag import load_displacements, load_run
from robot_formation.analysis.quantities import analyse
from robot_formation.bag.errors import BagError
from robot_formation.bag.formation_bag import FormationBag, formation_namespaces
from robot_formation.bag.message_recorder import METADATA_NAME
from robot_formation.bag.qos import TopicQos
from robot_formation.bag.reader import read_bag
from robot_formation.bag.writer import BagWriter
from robot_formation.cli.main import main

pytestmark = pytest.mark.xdist_group("formation_bag")

SAMPLE = ROOT / "bags" / "samples" / "track_two_measured"


@pytest.fixture(scope="module")
def moved_to(tmp_path_factory: pytest.TempPathFactory) -> Callable[..., Path]:
    """Copy the sample with its topics below each of the namespaces; /diagnostics stays shared, as it is in a graph."""

    def make(*namespaces: str) -> Path:
        path = tmp_path_factory.mktemp("moved") / "bag"
        with read_bag(SAMPLE) as source, BagWriter(path) as writer:
            writer.write_metadata(METADATA_NAME, source.metadata(METADATA_NAME))
            for topic in source.contents:
                for name in {place(namespace, topic.name) for namespace in namespaces}:
                    writer.add_topic(name, topic.type_name, topic.profiles or TopicQos())
            for message in source.raw_messages(source.topics):
                for name in {place(namespace, message.topic) for namespace in namespaces}:
                    writer.write(name, message.cdr, message.stamp_ns)
        return path

    return make


def place(namespace: str, topic: str) -> str:
    return topic if topic == "/diagnostics" else namespace + topic


def printed(capsys: pytest.CaptureFixture[str], *arguments: object) -> Any:
    assert main([str(argument) for argument in arguments]) == 0
    return json.loads(capsys.readouterr().out)


def test_a_run_below_a_namespace_is_found_and_gives_the_same_figures(
    moved_to: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bag = moved_to("/site_a")
    assert analyse(load_run(bag)).to_json() == analyse(load_run(SAMPLE)).to_json()
    assert load_displacements(bag, "follower_1").displacements_m == pytest.approx(
        load_displacements(SAMPLE, "follower_1").displacements_m, abs=0.0
    )
    ours, theirs = (printed(capsys, "replay", path, "--json")["followers"] for path in (bag, SAMPLE))
    assert ours == theirs
    main(["info", str(bag)])
    assert "Formations in:     /site_a\n" in capsys.readouterr().out


def test_of_several_formations_one_has_to_be_chosen(
    moved_to: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    bag = moved_to("/site_a", "/deep/site_b")
    said = complaint(capsys, "analyze", bag)
    assert said.endswith("holds several formations, in /deep/site_b, /site_a: choose one by --namespace")
    for arguments in (["replay"], ["predict", "--bag"]):
        assert "choose one by --namespace" in complaint(capsys, *arguments, bag)
    chosen = printed(capsys, "analyze", bag, "--namespace", "site_a", "--json")
    assert chosen.pop("bag") == str(bag)
    assert chosen.items() <= printed(capsys, "analyze", SAMPLE, "--json").items()
    assert printed(capsys, "replay", bag, "--namespace", "/deep/site_b", "--json")["followers"]
    assert printed(capsys, "predict", "--bag", bag, "--namespace", "/site_a", "--predictor", "previous", "--json")


def test_a_namespace_that_the_bag_has_not_is_refused_with_the_nearest_one(moved_to: Callable[..., Path]) -> None:
    with read_bag(moved_to("/site_a")) as bag:
        with pytest.raises(BagError, match=r"no formation in the namespace '/site_b'.*did you mean '/site_a'"):
            FormationBag(bag, "site_b")
        with pytest.raises(BagError, match="no formation in the namespace '/'"):
            FormationBag(bag, "/")


def test_the_root_can_be_chosen_too(moved_to: Callable[..., Path]) -> None:
    with read_bag(moved_to("", "/site_a")) as bag:
        assert FormationBag(bag, "/").namespace == ""
        assert "/follower_1/moved" in FormationBag(bag, "/").topics
        assert "/follower_1/moved" in FormationBag(bag, "/site_a/").topics


def test_ground_truth_and_ticks_make_no_formation_of_their_own() -> None:
    topics = ["/ground_truth/follower_1/odom", "/formation/follower_1/done", "/overhead/follower_1/path"]
    assert formation_namespaces(topics) == []
    assert formation_namespaces([*topics, "/a/b/follower_12/moved", "/follower_2/camera/image_raw"]) == ["", "/a/b"]


def test_the_namespace_of_a_log_that_is_no_bag_is_refused(capsys: pytest.CaptureFixture[str], tmp_path: Path) -> None:
    said = complaint(capsys, "predict", tmp_path / "log.csv", "--namespace", "site_a")
    assert "--namespace belongs to --bag" in said
