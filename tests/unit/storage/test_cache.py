"""Where the cache lives; the base-directory rules are those of the XDG specification 0.8."""

from __future__ import annotations

import shutil

import pytest

from lightfield.errors import OutputError
from lightfield.storage import cache
from lightfield.storage.cache import cache_dir


@pytest.fixture(autouse=True)
def linux_user(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    for variable in ("LIGHTFIELD_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(variable, raising=False)


def test_default_is_the_users_cache_folder(tmp_path):
    assert cache_dir() == tmp_path / "home" / ".cache" / "lightfield"
    assert cache_dir().is_dir()


def test_xdg_is_honoured_when_absolute(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_dir() == tmp_path / "xdg" / "lightfield"
    monkeypatch.setenv("XDG_CACHE_HOME", "relative")
    assert cache_dir() == tmp_path / "home" / ".cache" / "lightfield"


def test_macos_place(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.platform", "darwin")
    assert cache_dir() == tmp_path / "home" / "Library" / "Caches" / "lightfield"


def test_named_folder_with_spaces(tmp_path, monkeypatch):
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path / "a b"))
    assert cache_dir() == tmp_path / "a b"


def test_named_folder_that_cannot_be_made_is_an_error(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LIGHTFIELD_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.raises(OutputError, match="LIGHTFIELD_CACHE"):
        cache_dir()


def test_default_that_cannot_be_made_gives_a_temporary_folder(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HOME", str(tmp_path / "file"))
    assert cache_dir().is_dir()
    assert cache_dir() == cache_dir()
    assert tmp_path not in cache_dir().parents


def test_a_full_disk_has_a_folder_for_this_process_alone(monkeypatch, tmp_path):
    """A full cache costs what would be kept, and stops nothing."""
    assert cache.with_room(tmp_path / "kernels") == tmp_path / "kernels"
    full = shutil.disk_usage(tmp_path)._replace(free=cache.LEAST_ROOM_BYTES - 1)
    monkeypatch.setattr(cache.shutil, "disk_usage", lambda folder: full)
    instead = cache.with_room(tmp_path / "kernels")
    assert tmp_path not in instead.parents and instead.is_dir()
