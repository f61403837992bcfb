"""A payload's torque by casadi's code generator. Runs in the peers' environment, which has only casadi and numpy.

The recursion is written by hand for speed: in the joints' own frames with z along the axis, zeros and ones folded, the
payload's constants in the last frame, common subexpressions shared (`casadi.cse`).

From standard input, as JSON: `placement` (n, 4, 4) of frames whose z is the joint's axis, `gravity` (3,), `mass`,
`moment` (3,), `inertia` (3, 3) of the payload about the origin of the last frame, `real` (double or float), `output`.
Writes `output` and prints as JSON the numbers of multiplications, additions, sines and cosines of the function.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path

import casadi as ca
import numpy as np


def main() -> None:
    """Read the arm, write the code."""
    given = json.load(sys.stdin)
    placement = np.array(given["placement"])
    n = len(placement)
    q, dq, ddq = (ca.SX.sym(name, n) for name in ("q", "dq", "ddq"))
    z = ca.SX([0, 0, 1])
    w, e, a = ca.SX(3, 1), ca.SX(3, 1), exact(-np.array(given["gravity"]))
    turns, levers = [], []
    for i in range(n):
        fixed, lever = exact(placement[i, :3, :3]), exact(placement[i, :3, 3])
        c, s = ca.cos(q[i]), ca.sin(q[i])
        turn = fixed @ ca.vertcat(ca.horzcat(c, -s, 0), ca.horzcat(s, c, 0), ca.horzcat(0, 0, 1))
        a = turn.T @ (a + ca.cross(e, lever) + ca.cross(w, ca.cross(w, lever)))
        w, e = turn.T @ w, turn.T @ e
        e = e + z * ddq[i] + ca.cross(w, z * dq[i])
        w = w + z * dq[i]
        turns.append(turn)
        levers.append(lever)
    moment, inertia = exact(np.array(given["moment"])), exact(np.array(given["inertia"]))
    f = given["mass"] * a + ca.cross(e, moment) + ca.cross(w, ca.cross(w, moment))
    t = inertia @ e + ca.cross(w, inertia @ w) + ca.cross(moment, a)
    torque = [ca.SX(0)] * n
    for i in reversed(range(n)):
        torque[i] = t[2]
        f = turns[i] @ f
        t = turns[i] @ t + ca.cross(levers[i], f)
    function = ca.Function("casadi_torque", [q, dq, ddq], [ca.cse(ca.vertcat(*torque))])
    path = Path(given["output"])
    generator = ca.CodeGenerator(path.name, {"casadi_real": given["real"]})
    generator.add(function)
    generator.generate(f"{path.parent}/")
    print(json.dumps(operations(function)))


def exact(values: np.ndarray) -> ca.SX:
    """Values within 1e-12 of an integer are rounded, so that casadi folds them; zeros are structural."""
    clean = np.where(np.abs(values - np.round(values)) < 1e-12, np.round(values), values)
    return ca.sparsify(ca.SX(clean)) if clean.ndim == 2 else ca.SX(clean)


def operations(function: ca.Function) -> dict[str, int]:
    """Operations of a function; a change of sign is not counted, as in armload's count."""
    kinds = [function.instruction_id(k) for k in range(function.n_instructions())]
    products = (ca.OP_MUL, ca.OP_SQ, ca.OP_TWICE, ca.OP_DIV)
    return {
        "multiplications": sum(kind in products for kind in kinds),
        "additions": sum(kind in (ca.OP_ADD, ca.OP_SUB) for kind in kinds),
        "trigonometric": sum(kind in (ca.OP_SIN, ca.OP_COS) for kind in kinds),
    }


if __name__ == "__main__":
    main()
