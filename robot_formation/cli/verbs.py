"""The verbs of the command line, in the order of its help: one module each, with `add_parser`."""

from __future__ import annotations

from robot_formation.cli import (
    analyze,
    animate,
    calibrate,
    compare,
    completion,
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
    report,
    run,
    score,
    sweep,
    teach,
    test,
    view,
)

VERBS = (
    *(run, sweep, score, paper, list_, analyze, compare, report, view, animate),
    *(path, predict, record, play, info, recover, replay),
    *(calibrate, teach, detect, doctor, completion, test),
)
