"""What tests of live samples share."""

import json
import socket

import pytest


@pytest.fixture
def zenoh_peer(tmp_path, monkeypatch):
    """What opens a session of zenoh with what is opened here, past the network's other peers."""
    zenoh = pytest.importorskip("zenoh")
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        ends = {"endpoints": [f"tcp/127.0.0.1:{free.getsockname()[1]}"]}
    config = {"mode": "peer", "scouting": {"multicast": {"enabled": False}}}
    (tmp_path / "zenoh.json5").write_text(json.dumps(config | {"listen": ends}), encoding="utf-8")
    monkeypatch.setenv("ZENOH_CONFIG", str(tmp_path / "zenoh.json5"))
    there = json.dumps(config | {"connect": ends})
    return lambda: zenoh.open(zenoh.Config.from_json5(there))
