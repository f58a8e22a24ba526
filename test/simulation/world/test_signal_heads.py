from contextlib import contextmanager
from pathlib import Path

import libsumo
import numpy as np
import pytest
from world_scenes import TICK_S, blocks, scene

from simbev_ros.foundation.errors import InputError
from simbev_ros.maps.build import load_network
from simbev_ros.maps.network import Signal
from simbev_ros.maps.source import map_spec
from simbev_ros.schema.scene.map_spec import MapSpec
from simbev_ros.schema.scene.state import SignalState
from simbev_ros.simulation.world.simulation import Simulation
from simbev_ros.simulation.world.sumo.signals import SignalHeads, SignalProgram, signal_programs, signal_programs_xml
from simbev_ros.simulation.world.sumo.start import sumo_step_ns

CARLA = Path(__file__).parents[3].parent / "shared" / "maps" / "carla"
_SHOWN = {"G": SignalState.GREEN, "g": SignalState.GREEN, "y": SignalState.YELLOW, "r": SignalState.RED}


def head(program_id, link):
    return Signal(np.zeros(3), 0.0, np.zeros(3), program_id, link, "")


@pytest.fixture(scope="module")
def programs():
    return signal_programs(scene(), blocks().net_path.read_text())


def test_at_30_hz_every_head_shows_sumos_state(tmp_path: Path):
    tick_ns = 33_333_333
    programs = signal_programs(scene(tick_ns=tick_ns), blocks().net_path.read_text())
    with heads_beside_sumo(programs, tick_ns, tmp_path) as table:
        for tick in range(900):
            libsumo.simulationStep()
            assert table.table_at(tick)["state"].tolist() == sumos_states(programs)


@pytest.fixture
def table(programs, tmp_path: Path):
    with heads_beside_sumo(programs, round(TICK_S * 1e9), tmp_path) as heads:
        yield heads


@contextmanager
def heads_beside_sumo(programs, tick_ns, folder):
    """The heads of all links, program by program, while SUMO runs the programs."""
    additional = folder / "signals.add.xml"
    additional.write_text(signal_programs_xml(programs, step_ns := sumo_step_ns(tick_ns)))
    heads = [head(program.id, link) for program in programs for link in range(len(program.states[0]))]
    options = ["--step-length", f"{step_ns / 1e9:.3f}", "--no-step-log", "true", "--xml-validation", "never"]
    libsumo.start(["sumo", "-n", str(blocks().net_path), "-a", str(additional), *options])
    try:
        yield SignalHeads(heads, programs, tick_ns)
    finally:
        libsumo.close()


def sumos_states(programs):
    """What SUMO shows at the links, in the order of the heads."""
    letters = (letter for program in programs for letter in libsumo.trafficlight.getRedYellowGreenState(program.id))
    return [_SHOWN[letter] for letter in letters]


def test_every_head_shows_sumos_state_at_every_tick(programs, table):
    for tick in range(900):
        libsumo.simulationStep()
        assert table.table_at(tick)["state"].tolist() == sumos_states(programs)


def test_green_lasts_as_drawn_then_yellow_3_s_then_all_red_2_s(programs):
    spec = scene()
    for index, program in enumerate(programs):
        green_s = spec.green_time_s[index % len(spec.green_time_s)]
        vehicle_links = [k for k in range(len(program.states[0])) if any(state[k] == "y" for state in program.states)]
        for link in vehicle_links:
            shown = "".join(state[link].lower() * n for state, n in zip(program.states, program.ticks, strict=True))
            start = (shown + shown).index("rg") + 1
            turned = (shown + shown)[start : start + len(shown)]
            assert (turned.count("g"), turned.count("y")) == (round(green_s / TICK_S), round(3.0 / TICK_S))
        all_red = sum(n for state, n in zip(program.states, program.ticks, strict=True) if set(state) == {"r"})
        assert all_red == 2 * round(2.0 / TICK_S)


def test_time_in_state_counts_from_the_change_across_phases_and_cycles():
    program = SignalProgram("J", ("Gr", "gr", "yr", "rG"), (4, 2, 1, 3), offset_ticks=1, green_s=0.6)
    heads = SignalHeads([head("J", 0), head("J", 1)], [program], 100_000_000)
    times = np.array([heads.table_at(tick)["time_in_state"] for tick in range(-1, 13)]) / np.float32(0.1)
    # Link 0: red for 3 ticks before tick 1, green 6, yellow 1, red 3; link 1: green for 3 ticks, red 7.
    assert times[:, 0].round().tolist() == [1, 2, 0, 1, 2, 3, 4, 5, 0, 0, 1, 2, 0, 1]
    assert times[:, 1].round().tolist() == [1, 2, 0, 1, 2, 3, 4, 5, 6, 0, 1, 2, 0, 1]


def test_time_remaining_counts_down_to_the_change_which_may_never_come():
    program = SignalProgram("J", ("Grr", "grr", "yrr", "rGr"), (4, 2, 1, 3), offset_ticks=1, green_s=0.6)
    heads = SignalHeads([head("J", 0), head("J", 1), head("J", 2)], [program], 100_000_000)
    times = np.array([heads.table_at(tick)["time_remaining"] for tick in range(-1, 13)]) / np.float32(0.1)
    assert times[:, 0].round().tolist() == [2, 1, 6, 5, 4, 3, 2, 1, 1, 3, 2, 1, 6, 5]
    assert times[:, 1].round().tolist() == [2, 1, 7, 6, 5, 4, 3, 2, 1, 3, 2, 1, 7, 6]
    assert np.all(np.isinf(times[:, 2]))


@pytest.mark.parametrize(
    "town",
    [
        "Blocks",
        *(
            pytest.param(town, marks=pytest.mark.slow)
            for town in ("Town10HD", CARLA / "Town01.xodr", CARLA / "Town04.xodr")
        ),
    ],
    ids=lambda town: Path(town).name,
)
def test_time_remaining_is_the_time_until_the_next_change(town: str | Path) -> None:
    if isinstance(town, Path) and not town.is_file():
        pytest.skip("without the shared maps")
    network = load_network(map_spec(str(town)))
    spec = scene(vehicles=1, pedestrians=0, green_time_s=(4.0, 13.3, 27.7))
    programs = signal_programs(spec, network.net_path.read_text())
    heads = SignalHeads(network.signals, programs, spec.tick_ns)
    rows = np.stack([heads.table_at(tick) for tick in range(1600)])
    assert rows.shape[1] >= 16
    changes = rows["state"][1:] != rows["state"][:-1]
    until = np.where(changes, np.arange(1, len(rows))[:, None], len(rows))
    until = np.minimum.accumulate(until[::-1], axis=0)[::-1]
    until_change_s = (until - np.arange(len(rows) - 1)[:, None]) * TICK_S
    has_change = until < len(rows)
    assert rows["time_remaining"][:-1][has_change] == pytest.approx(until_change_s[has_change], abs=1e-4)
    assert np.all(rows["time_remaining"][:-1][~has_change] > until_change_s[~has_change] - 1e-4)
    assert set(np.unique(rows["state"])) == {SignalState.RED, SignalState.YELLOW, SignalState.GREEN}


def test_heads_carry_their_pose_and_green_time():
    program = SignalProgram("J", ("G", "r"), (5, 5), 0, green_s=0.5)
    signal = Signal(np.array([1.0, 2.0, 5.5]), 0.25, np.zeros(3), "J", 0, "")
    row = SignalHeads([signal], [program], 100_000_000).table_at(0)[0]
    assert (row["x"], row["y"], row["z"], row["yaw"], row["green_time"], row["id"]) == (1.0, 2.0, 5.5, 0.25, 0.5, 1)


def test_on_a_map_file_green_phases_keep_their_proportions_and_the_longest_has_the_drawn_time():
    phases = [(30, "GGrr"), (3, "yyrr"), (10, "rrGr"), (3, "rryr"), (1, "rrrG"), (3, "rrry")]
    text = "".join(f'<phase duration="{duration}" state="{state}"/>' for duration, state in phases)
    net = f'<net><tlLogic id="J" type="static" programID="0" offset="0">{text}</tlLogic></net>'
    on_file = MapSpec(name="a", path="/a.net.xml", sha256="0" * 64)
    for place, greens_s in ((on_file, [15.0, 5.0, 4.0]), (MapSpec(name="Blocks"), [15.0, 15.0, 15.0])):
        (program,) = signal_programs(scene(map=place, green_time_s=(15.0,)), net)
        ticks = [ticks for state, ticks in zip(program.states, program.ticks, strict=True) if "G" in state]
        assert ticks == [round(green_s / TICK_S) for green_s in greens_s]


def test_held_programs_show_sumos_state_on_their_way_there_and_back(programs, table):
    car = next(k for k in range(len(programs[0].states[0])) if any(state[k] == "y" for state in programs[0].states))
    seen = []
    for tick in range(900):
        if tick in (100, 400):
            table.hold(car + 1, SignalState.GREEN if tick == 100 else SignalState.RED, tick)
        changes = table.release(0, tick) if tick == 650 else []
        for change in (*changes, *table.advance(tick)):
            libsumo.trafficlight.setPhase(change.program, change.phase)
            libsumo.trafficlight.setPhaseDuration(change.program, change.ticks * TICK_S)
        libsumo.simulationStep()
        seen.append(table.table_at(tick))
        assert seen[-1]["state"].tolist() == sumos_states(programs), tick
    first = np.array([each[car] for each in seen])
    assert (first["state"][250:400] == SignalState.GREEN).all() and np.isinf(first["time_remaining"][250:400]).all()
    assert first["time_in_state"][399] == pytest.approx(first["time_in_state"][350] + 49 * TICK_S, abs=1e-4)
    assert (first["state"][400:480] == SignalState.YELLOW).sum() == 60
    assert (first["state"][520:650] == SignalState.RED).all()
    assert len(np.unique(first["state"][650:])) > 1, "it goes on in its cycle"
    with pytest.raises(InputError, match=rf"^id: is 0; allowed: 1 to {len(seen[0])}, the ids on /world/signals$"):
        table.hold(0, SignalState.RED, 900)


def test_a_signal_is_held_from_the_answered_tick_on_until_it_is_released():
    spec = scene(vehicles=24, pedestrians=0, ticks=40)
    with Simulation(spec, blocks()) as simulation:
        states = [simulation.step() for _ in range(20)]
        shown = simulation.hold_signal(3, SignalState.RED)
        while states[-1].tick < shown + 200:
            states.append(simulation.step())
        assert [state.signals["state"][2] for state in states[-60:]] == [SignalState.RED] * 60
        assert np.isinf(states[-1].signals["time_remaining"][2])
        simulation.hold_signal(0, None)
        states = [simulation.step() for _ in range(700)]
        assert SignalState.GREEN in [state.signals["state"][2] for state in states]
