"""Ports of a compiled step whose numbers have names: a NamedTuple says what is in a vector.

Numbers are computed once in Python and read by name in the equations, where they are symbols.
"""

from typing import Any, TypeVar

import casadi as ca

Record = TypeVar("Record", bound=tuple[Any, ...])


def named_port(kind: type[Record], name: str) -> tuple[Any, Record]:
    """Return a symbol (k,) and its k numbers by name.

    Parameters
    ----------
    kind : a NamedTuple of k fields.
    name : of the port.
    """
    port = ca.SX.sym(name, len(kind._fields))  # type: ignore[attr-defined]
    return port, kind(*ca.vertsplit(port))


def axle_port(kind: type[Record], name: str) -> tuple[Any, Record]:
    """Return a symbol (2, k), rows front and rear, and its k columns (2, 1) by name.

    Parameters
    ----------
    kind : a NamedTuple of k fields.
    name : of the port.
    """
    port = ca.SX.sym(name, 2, len(kind._fields))  # type: ignore[attr-defined]
    return port, kind(*ca.horzsplit(port))
