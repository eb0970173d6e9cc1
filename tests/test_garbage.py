"""Work without collection of cycles leaves the collection as it was."""

import gc

import pytest

from assembly._garbage import uncollected


def test_collection_goes_on_afterwards() -> None:
    with uncollected():
        assert not gc.isenabled()
    assert gc.isenabled()


def test_collection_goes_on_after_an_error() -> None:
    with pytest.raises(KeyError), uncollected():
        raise KeyError
    assert gc.isenabled()


def test_nested_work_and_collection_that_is_off() -> None:
    with uncollected():
        with uncollected():
            assert not gc.isenabled()
        assert not gc.isenabled()
    gc.disable()
    try:
        with uncollected():
            pass
        assert not gc.isenabled()
    finally:
        gc.enable()


def test_ctrl_c_as_soon_as_collection_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    off = gc.disable

    def interrupted() -> None:
        off()
        raise KeyboardInterrupt

    monkeypatch.setattr(gc, "disable", interrupted)
    with pytest.raises(KeyboardInterrupt), uncollected():
        pass
    assert gc.isenabled()
