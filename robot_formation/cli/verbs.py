"""The verbs of the command line, in the order of its help: one module each, with `add_parser`."""

from __future__ import annotations

from robot_formation.cli import (
    analyze,
    calibrate,
    detect,
    doctor,
    info,
    list_,
    paper,
    path,
    play,
    predict,
    record,
    recover,
    replay,
    run,
    sweep,
    teach,
    test,
)

VERBS = (
    *(run, sweep, paper, list_, analyze, path, predict, record, play, info, recover, replay),
    *(calibrate, teach, detect, doctor, test),
)
