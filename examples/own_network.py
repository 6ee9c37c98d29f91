"""A tire network of one's own, an ONNX file, as a method beside the others of `tireid compare`.

It reads slip angles [α_f, α_r] (n, 2) [rad] and returns axle forces [N]. A package of yours names
`OwnNetwork` by an entry point, as docs/architecture.md says. It takes onnx and CasADi 3.8.2.
"""

import casadi as ca
import numpy as np
import onnx

import tireid as ti
from codegen import Scan
from identifier.method import Method, require_fresh
from identifier.setup import Setup
from identifier.tire_model import TireModel
from models.bicycle import slip_angles

EXPECTED_BELOW = 0.15
FILE = "tire.onnx"
GRAPH = """<ir_version: 7, opset_import: ["": 13]> tire (double[n, 2] slip) => (double[n, 2] F) {
hidden = MatMul(slip, A)  active = Tanh(hidden)  F = MatMul(active, B) }"""


class OwnNetwork(Method):
    dt, min_speed, estimates = 0.01, 1.0, "forces by a network that does not learn"

    def __init__(self, vehicle: ti.Vehicle, seed: int) -> None: ...

    def setup(self, vehicle: ti.Vehicle, start: TireModel | None = None) -> Setup:
        require_fresh(start)
        graph = ca.GraphBuilder(FILE, {})
        graph.bind_shape("slip", [1, 2])
        network = graph.create("network", {"symbolic": True})
        x, u, v_x = ca.MX.sym("x", 2), ca.MX.sym("u", 2), ca.MX.sym("v_x")
        slip = slip_angles(vehicle.l_f, vehicle.l_r, ca.fmax(v_x, self.min_speed), x, u)
        force = ca.if_else(v_x >= self.min_speed, network(slip.T).T, 0.0)
        over = ("x", "u", "v_x")
        step = ca.Function("own_network", [x, u, v_x], [force], over, ["axle_force"])
        return Setup(Scan(step, carry=(), over=over), carry={}, constants={})


def main() -> float:
    """Return the error of a network on another drive than it was fitted to, over the force [-]."""
    car = ti.sedan()
    log, drive = ti.sample_recording(car), ti.sample_recording(car, seed=1)
    A = np.kron(np.eye(2), 1.0 / np.geomspace(0.02, 0.3, 7))  # units of each axle [1/rad]
    hidden = np.tanh(log.alpha(car.l_f, car.l_r) @ A)
    B = np.linalg.lstsq(hidden, np.array(log.axle_force), rcond=1e-6)[0]
    model = onnx.parser.parse_model(GRAPH)
    model.graph.initializer.extend(map(onnx.numpy_helper.from_array, (A, B), "AB"))
    onnx.save(model, FILE)
    force = ti.identify(drive, car, OwnNetwork(car, 0)).force
    truth = np.array(drive.axle_force)
    error = float(np.sqrt(np.mean((force - truth) ** 2) / np.mean(truth**2)))
    print(f"network on {drive.name}: {100.0 * error:.1f} % of the force")
    return error


if __name__ == "__main__":
    main()
