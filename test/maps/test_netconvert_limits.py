"""netconvert may use a limited time of the processor, and the message says so."""

from pathlib import Path

import pytest

from simbev_ros.foundation.errors import SimulationError
from simbev_ros.maps.sumo import netconvert


@pytest.mark.slow
def test_a_netconvert_that_never_ends_is_stopped(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    program = tmp_path / "bin" / "netconvert"
    program.parent.mkdir()
    program.write_text("#!/bin/sh\nwhile :; do :; done\n")
    program.chmod(0o755)
    monkeypatch.setattr(netconvert, "sumo_home", lambda: tmp_path)
    monkeypatch.setattr(netconvert, "_MAX_CPU_S", 1)
    with pytest.raises(SimulationError, match=r"^netconvert was not ready after 1 s of computing time$"):
        netconvert.run_netconvert([], tmp_path / "map.net.xml", tmp_path / "map.xodr")
