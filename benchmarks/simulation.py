# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0


"""Speed of the simulation: without ROS, compared with other engines, and in lock-step."""

from collections.abc import Callable, Mapping
import importlib
import time
from typing import Any, NamedTuple, Protocol

from benchmarks import lock_step
import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.joints.actuator import make_actuators
from robot_dynamics.joints.friction import make_friction
from robot_dynamics.model.arm import ArmModel, load_arm
from robot_dynamics.model.arm_dynamics import ArmDynamics
from robot_dynamics.planar.urdf import planar_arm_urdf
from robot_dynamics.simulation.arm_simulation import ArmSimulation

JOINTS = 7
PERIOD = 2e-3
"""[s] between two efforts, and the longest step."""
SECONDS = 4.0
ROUNDS = 3
NATURAL_FREQUENCY, AMPLITUDE = 10.0, 0.3
LARGEST_ERROR = 0.1
"""[rad] that a simulated arm may be off its path: what flies about is not compared."""
RIGID, ALL = 'rigid bodies', 'and backlash'

_LENGTHS = [0.25] * JOINTS
_MASSES = [5.0 * 0.7**i for i in range(JOINTS)]
_STRENGTHS = [0.6**i for i in range(JOINTS)]
URDF = planar_arm_urdf(
    _MASSES, _LENGTHS, [0.5 * length for length in _LENGTHS],
    [mass * length**2 / 12.0 for mass, length in zip(_MASSES, _LENGTHS)])
FRICTION = {
    'viscous': [2.0 * strength for strength in _STRENGTHS],
    'coulomb': [3.0 * strength for strength in _STRENGTHS],
    'static': [4.0 * strength for strength in _STRENGTHS],
    'stribeck_velocity': [0.05],
    'offset': [0.3 * strength for strength in _STRENGTHS],
}
MOTORS = {
    'torque_constant': [0.1], 'gear_ratio': [100.0], 'resistance': [0.5], 'inductance': [5e-4],
    'rotor_inertia': [4e-5 * strength for strength in _STRENGTHS], 'efficiency': [0.8],
    'current_limit': [40.0], 'voltage_limit': [48.0],
}
BACKLASH = {'backlash': [1e-3]}


class State(NamedTuple):
    """Position and velocity, each (n,)."""

    q: FloatArray
    v: FloatArray


class Stepper(Protocol):
    """A simulated arm that takes one step per period."""

    def state(self) -> State:
        """Return the state that a controller receives."""

    def step(self, tau: FloatArray) -> object:
        """Simulate one PERIOD under the effort tau (n,)."""


class Library:
    """The library: Runge–Kutta of order 5, with events if there is friction or backlash."""

    def __init__(self, arm: ArmModel) -> None:
        self._simulation = ArmSimulation(arm, max_step=PERIOD)
        self._simulation.release()

    def state(self) -> State:
        return State(*self._simulation.motor_state)

    def step(self, tau: FloatArray) -> object:
        return self._simulation.step(tau, PERIOD)


class BareEngine:
    """One aba of Pinocchio per period, and one step of the semi-implicit Euler method in numpy."""

    def __init__(self, arm: ArmModel) -> None:
        self._model = arm.pinocchio_model
        self._data = self._model.createData()
        self._q, self._v = np.zeros(JOINTS), np.zeros(JOINTS)

    def state(self) -> State:
        return State(self._q, self._v)

    def step(self, tau: FloatArray) -> object:
        self._v = self._v + PERIOD * pin.aba(self._model, self._data, self._q, self._v, tau)
        self._q = self._q + PERIOD * self._v
        return None


class Mujoco:
    """
    MuJoCo's mj_step without contacts and limits, with its Euler or Runge–Kutta integrator.

    The model has the friction and motor terms that MuJoCo offers: damping, dry friction without
    the Stribeck effect, rotor inertia. Raises ImportError without MuJoCo.
    """

    def __init__(self, arm: ArmModel, method: str = 'EULER') -> None:
        self._mj = importlib.import_module('mujoco')
        off = self._mj.mjtDisableBit
        self._model = self._mj.MjModel.from_xml_string(URDF)
        self._model.opt.disableflags = off.mjDSBL_CONTACT | off.mjDSBL_LIMIT
        self._model.opt.timestep = PERIOD
        self._model.opt.integrator = getattr(self._mj.mjtIntegrator, f'mjINT_{method}')
        self._model.dof_damping[:] = arm.friction.viscous
        self._model.dof_frictionloss[:] = arm.friction.coulomb
        self._model.dof_armature[:] = arm.pinocchio_model.armature
        data = self._data = self._mj.MjData(self._model)
        self._tau = data.qfrc_applied
        self._state = State(data.qpos, data.qvel)

    def state(self) -> State:
        return State(self._state.q.copy(), self._state.v.copy())

    def step(self, tau: FloatArray) -> object:
        self._tau[:] = tau
        return self._mj.mj_step(self._model, self._data)


def arms() -> dict[str, ArmModel]:
    """Return the same arm with an increasing number of effects of real joints."""
    rigid = load_arm(URDF)
    names = rigid.joint_names
    rough = rigid.with_friction(make_friction(names, **_arrays(FRICTION)))
    return {
        RIGID: rigid,
        'and friction': rough,
        'and motors': rough.with_actuators(make_actuators(names, **_arrays(MOTORS))),
        ALL: rough.with_actuators(make_actuators(names, **_arrays({**MOTORS, **BACKLASH}))),
    }


def _arrays(values: Mapping[str, list[float]]) -> dict[str, Any]:
    return {name: np.array(value) for name, value in values.items()}


def steps_per_second(arm: ArmModel, stepper: Stepper) -> float:
    """Return the steps per second of computing, without the time for computing efforts."""
    dynamics = ArmDynamics(arm)
    frequency = np.asarray(2.0 * np.pi * (0.5 + 0.05 * np.arange(JOINTS)), dtype=np.float64)
    spent, steps = 0.0, round(SECONDS / PERIOD)
    for k in range(steps):
        tau = _effort(dynamics, frequency, k * PERIOD, *stepper.state())
        start = time.perf_counter()
        stepper.step(tau)
        spent += time.perf_counter() - start
    error = np.abs(stepper.state().q - _wanted(frequency * SECONDS)).max()
    if not error < LARGEST_ERROR:
        raise ValueError(f'the arm is {error:g} rad off its path, expected {LARGEST_ERROR:g}')
    return steps / spent


def _wanted(phase: FloatArray) -> FloatArray:
    return np.asarray(AMPLITUDE * (1.0 - np.cos(phase)))


def _effort(
    dynamics: ArmDynamics, frequency: FloatArray, t: float, q: FloatArray, v: FloatArray,
) -> FloatArray:
    """Return the computed torque that follows a sine at each joint."""
    phase = frequency * t
    rate = AMPLITUDE * frequency * np.sin(phase)
    a = AMPLITUDE * frequency**2 * np.cos(phase) + (
        2.0 * NATURAL_FREQUENCY * (rate - v) + NATURAL_FREQUENCY**2 * (_wanted(phase) - q))
    effort = dynamics.rigid_body.inverse_dynamics(q, v, a)
    return np.asarray(effort + dynamics.arm.friction.smooth_effort(rate))


def main() -> None:
    """Print steps per second, medians of interleaved rounds, and the speed of the closed loop."""
    known = arms()
    rows: dict[str, tuple[ArmModel, Callable[[ArmModel], Stepper]]] = {
        name: (arm, Library) for name, arm in known.items()}
    rows['Euler, bare aba'] = known[RIGID], BareEngine
    try:
        Mujoco(known[RIGID])
        rows['mj_step, Euler'] = known[RIGID], Mujoco
        rows['mj_step, Runge-Kutta 4'] = known[RIGID], lambda arm: Mujoco(arm, 'RK4')
        rows['mj_step, Euler, friction'] = known['and motors'], Mujoco
    except ImportError:
        print('MuJoCo is left out, as it is not installed: scripts/setup peers')
    speeds: dict[str, list[float]] = {name: [] for name in rows}
    for _ in range(ROUNDS):
        for name, (arm, make) in rows.items():
            speeds[name].append(steps_per_second(arm, make(arm)))
    print(f'{JOINTS} joints, steps of {1e3 * PERIOD:g} ms; the library takes its own by '
          'Runge–Kutta of order 5, with six accelerations each:')
    print(f'{"":28}{"steps per second":>16}{"× real time":>14}{"× rigid bodies":>16}')
    medians = {name: float(np.median(values)) for name, values in speeds.items()}
    for name, speed in medians.items():
        print(f'{name:28}{speed:16.0f}{PERIOD * speed:14.1f}{speed / medians[RIGID]:16.2f}')
    _print_closed_loop()


def _print_closed_loop() -> None:
    joints = {'joints': [f'joint{i + 1}' for i in range(JOINTS)]}
    effects = {f'friction.{name}': value for name, value in FRICTION.items()} | {
        f'actuator.{name}': value for name, value in {**MOTORS, **BACKLASH}.items()}
    print('simulated_arm in lock-step with dynamics, two processes:')
    for name, parameters in ((RIGID, joints), (ALL, {**joints, **effects})):
        speed = lock_step.times_real_time(URDF, parameters, 1.0 / PERIOD)
        print(f'{name:28}{speed / PERIOD:16.0f}{speed:14.2f}')


if __name__ == '__main__':
    main()
