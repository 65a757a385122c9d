"""The identifier of this computer, which the directory of the simulated Nao has from libqi."""

from __future__ import annotations

import uuid
from pathlib import Path

import pytest

from urbihw_nao_fakes.device import Nao
from urbihw_nao_fakes.endpoint import NaoEndpoint
from urbihw_nao_fakes.machine import find_machine_id

FILE = Path(".config/qimessaging/machine_id")


def test_that_of_libqi_is_taken(tmp_path: Path) -> None:
    (tmp_path / FILE).parent.mkdir(parents=True)
    (tmp_path / FILE).write_text("432cfc7b-e502-4d2c-b766-f967cfff0f4a\n")
    assert find_machine_id(tmp_path) == "432cfc7b-e502-4d2c-b766-f967cfff0f4a"


def test_one_is_made_where_there_is_none(tmp_path: Path) -> None:
    made = find_machine_id(tmp_path)
    assert uuid.UUID(made) and (tmp_path / FILE).read_text() == made == find_machine_id(tmp_path)


def test_a_home_that_cannot_be_written(tmp_path: Path) -> None:
    home = tmp_path / "file"
    home.write_text("")
    assert find_machine_id(home) == find_machine_id(home)


def test_the_directory_tells_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    with NaoEndpoint(Nao()) as end:
        told = {info.machine for info in end.device.directory.get_services()}
    assert told == {find_machine_id(tmp_path)}
