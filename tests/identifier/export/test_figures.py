"""What a package says that it costs is what was measured, each number in its own place."""

import json

from codegen.processor import Cost, Replay, with_figures

REPLAY = Replay(
    hash="ab", steps=900, faults=2, state=1000, params=200, work=0, stack=30, instructions=77777,
    most_instructions=88888,
)  # fmt: skip
COST = Cost("Cortex-M4", "gcc 12", single=True, flash=5432, replay=REPLAY, static_ram=4)


def test_ram_is_static_data_state_and_parameters():
    assert COST.ram == 1204


def test_the_manifest_gets_the_same_numbers_and_keeps_the_rest():
    told = json.loads(with_figures('{"name": "tire"}', [COST, COST._replace(single=False)]))
    assert told["name"] == "tire"
    assert [entry["precision"] for entry in told["figures"]] == ["float", "double"]
    first = told["figures"][0]
    del first["precision"]
    assert first == {
        "processor": "Cortex-M4", "compiler": "gcc 12", "flash_B": 5432, "ram_B": 1204,
        "static_ram_B": 4, "state_B": 1000, "params_B": 200, "stack_B": 30,
        "instructions_mean": 77777, "instructions_largest": 88888,
    }  # fmt: skip
