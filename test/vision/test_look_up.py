import numpy as np
import pytest

from robot_formation.vision import look_up as module
from robot_formation.vision.look_up import look_up

TABLE = np.sqrt(np.arange(65536)).astype(np.float32)
PICTURE = np.random.default_rng(1).integers(0, 65536, (20, 30, 3)).astype(np.uint16)


@pytest.mark.parametrize("wide", [module.OPENCV_HAS_WIDE_TABLES, False])
def test_entries_are_exact(wide: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "OPENCV_HAS_WIDE_TABLES", wide)
    out = np.empty(PICTURE.shape, np.float32)
    assert np.array_equal(look_up(TABLE, PICTURE, out=out), TABLE[PICTURE])
    assert np.array_equal(out, TABLE[PICTURE])
    assert np.array_equal(look_up(TABLE, PICTURE[:, :, 0].copy()), TABLE[PICTURE[:, :, 0]])
    bytes_ = TABLE.astype(np.uint8)
    assert np.array_equal(look_up(bytes_, PICTURE), bytes_[PICTURE])
