# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
Position servos without torque reading: `identify` and mujoco.sysid on the same recordings.

    scripts/run python -m benchmarks.servo_sysid [--arms FIRST COUNT] [--masses]

The arms are generated, of 3 to 6 joints, with masses 15 % off the URDF. Their servos have rotors,
friction with presliding and a Stribeck curve, a backlash of 1 degree between rotor and link, a
delay of 20 ms, and positions of 8 bit (arms 0 to 2), 10 bit (3 to 5) or 12 bit (6 to 8); the
recordings have the command and the position at 30, 50 or 100 Hz. Both methods know the URDF and
the stiffness k_p. mujoco.sysid fits armature, dry friction, damping and stiffness per joint and
the delay, with `--masses` also mass and centre of mass of each body. Both results are then
simulated by MuJoCo with the commands of other motions, and compared with
their measured positions. Needs `scripts/setup peers`.
"""

import argparse
from collections.abc import Sequence
from contextlib import redirect_stdout
import importlib
import io
import sys
import time
from typing import Any, NamedTuple

from benchmarks.estimators import Case
import numpy as np
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import RigidBody
from robot_dynamics.model.arm_parameters import arm_from_parameters
from robot_dynamics_tools.analysis.motion_filter import filter_motion
from robot_dynamics_tools.analysis.position_drives import drive_effort
from robot_dynamics_tools.identification.identified_arm import fitted_urdf, parameter_values
from robot_dynamics_tools.identification.pipeline import identify
from robot_dynamics_tools.mujoco.mjcf import arm_to_mjcf
from robot_dynamics_tools.recordings.joint_series import JointSeries

RATES, BITS = (30.0, 50.0, 100.0), (8, 10, 12)
DELAY, BACKLASH, SECONDS = 0.02, np.deg2rad(1.0), 20.0
SAG = 0.05
"""[rad] under the largest gravity torque of a joint."""
STEP, MUJOCO_STEP = 2e-4, 4e-3
"""[s] of the integration of the servos, and of MuJoCo."""
BEGIN, REST = 1.0, 0.6
"""[s] that are not compared, and with a constant command before a sample counts as rest."""


class Recording(NamedTuple):
    """Times (m,) [s], commanded and measured positions (m, n) of one motion."""

    times: FloatArray
    command: FloatArray
    position: FloatArray

    def series(self, names: tuple[str, ...]) -> tuple[JointSeries, JointSeries]:
        """Return the measured and the commanded positions."""
        stamps = np.round(1e9 * self.times).astype(np.int64)
        measured, sent = (JointSeries(names, stamps, q, None, None, 0)
                          for q in (self.position, self.command))
        return measured, sent

    def held(self, step: float, delay: float) -> FloatArray:
        """Return the command at each `step` [s], held between samples, after a delay [s]."""
        times = np.arange(0.0, self.times[-1] + step, step)
        rows = np.searchsorted(self.times, times - delay + 1e-9, side='right') - 1
        return np.asarray(self.command[np.maximum(rows, 0)])


class Servos:
    """An arm with servos: rotors, backlash and friction before the links."""

    def __init__(self, seed: int) -> None:
        self.case = case = Case(seed)
        self.rate, self.bits = RATES[seed % 3], BITS[seed // 3 % 3]
        self.stiffness = case.limit / 2.5 / SAG
        self.inertia = np.diag(RigidBody(case.true).mass_matrix(np.zeros(case.n))) + case.rotor
        self.damping = 1.4 * np.sqrt(self.stiffness * self.inertia)

    def record(self, command: FloatArray) -> Recording:
        """Return the recording of a motion that is commanded at the rate of the arm."""
        quantum = 2.0 * np.pi / 2**self.bits
        command = quantum * np.round(command / quantum)
        times = np.arange(len(command)) / self.rate
        wanted = Recording(times, command, command)
        return wanted._replace(position=quantum * np.round(self._motion(wanted) / quantum))

    def _motion(self, wanted: Recording) -> FloatArray:
        """Return the positions (m, n) of the links, after a second at the first command."""
        case, h = self.case, STEP
        model, J, F = case.true.pinocchio_model, case.rotor, case.F
        data = model.createData()
        tooth = case.limit / 0.01
        damp = 0.2 * np.sqrt(tooth * np.minimum(J, self.inertia - J))
        q, v = wanted.command[0].copy(), np.zeros(case.n)
        theta, w, z = q.copy(), v.copy(), v.copy()
        held = wanted.held(h, DELAY)
        held = np.concatenate([np.tile(held[:1], (round(1.0 / h), 1)), held])
        found = np.empty_like(held)
        for k, q_c in enumerate(held):
            found[k] = q
            gap = theta - q
            pressed = gap - np.clip(gap, -0.5 * BACKLASH, 0.5 * BACKLASH)
            contact = tooth * pressed + damp * (w - v) * (pressed != 0.0)
            drive = np.clip(self.stiffness * (q_c - q) - self.damping * w, -case.limit, case.limit)
            z = np.clip(z + h * w / 0.003, -1.0, 1.0)
            friction = F * (1.0 + 0.4 * np.exp(-(w / 0.05)**2)) * z + case.viscous * w
            a = pin.aba(model, data, q, v, contact)
            w = w + h * (drive - friction - contact) / J
            v = v + h * a
            theta, q = theta + h * w, q + h * v
        rows = round(1.0 / h) + np.round(wanted.times / h).astype(int)
        return np.asarray(found[rows])

    def teleoperation(self) -> Recording:
        """Return a motion as of a leader arm: some joints at a time, at varied speeds, pauses."""
        rng, n, at = self.case.rng, self.case.n, np.zeros(self.case.n)
        pieces = list[FloatArray]()
        while sum(map(len, pieces)) < SECONDS * self.rate:
            moves = rng.uniform(size=n) < 0.6
            goal = np.where(moves, rng.uniform(-1.2, 1.2, n), at)
            s = np.linspace(0.0, 1.0, int(rng.uniform(0.5, 2.0) * self.rate))[:, None]
            pieces.append(at + (goal - at) * s**3 * (10.0 - 15.0 * s + 6.0 * s**2))
            pieces.append(np.tile(goal, (int(rng.uniform(0.0, 1.2) * self.rate), 1)))
            at = goal
        return self.record(np.concatenate(pieces))

    def unseen(self) -> list[Recording]:
        """Return sines, and moves with pauses."""
        half = SECONDS / 2.0
        return [self.record(motion(self.rate, half)) for motion in (
            self.case.sines, self.case.moves)]


class Model(NamedTuple):
    """A model of MuJoCo with position servos, the delay of the command [s], and the seconds."""

    mujoco: Any
    delay: float
    seconds: float

    def errors(self, recording: Recording) -> tuple[FloatArray, FloatArray]:
        """Return the errors (m, n) of the simulated positions, and (k, n) those at rests."""
        found = _positions(self.mujoco, recording, self.delay)
        error = found - recording.position
        late = np.searchsorted(recording.times, recording.times - REST)
        rests = np.abs(recording.command - recording.command[late]).max(axis=1) == 0.0
        counted = recording.times > BEGIN
        return error[counted], error[counted & rests]


def _positions(model: Any, recording: Recording, delay: float) -> FloatArray:
    mj = importlib.import_module('mujoco')
    data, held = mj.MjData(model), recording.held(model.opt.timestep, delay)
    data.qpos[:] = recording.position[0]
    found = np.empty_like(held)
    for k, data.ctrl[:] in enumerate(held):
        found[k] = data.qpos
        mj.mj_step(model, data)
    times = model.opt.timestep * np.arange(len(held))
    return np.stack([np.interp(recording.times, times, column) for column in found.T], axis=1)


def spec_of(arm: ArmModel, stiffness: FloatArray) -> Any:
    """Return the arm with position servos in MuJoCo, and a sensor per joint."""
    mj = importlib.import_module('mujoco')
    spec = mj.MjSpec.from_string(arm_to_mjcf(arm))
    spec.option.timestep = MUJOCO_STEP
    for motor, k_p in zip(spec.actuators, stiffness):
        motor.set_to_position(kp=k_p)
        motor.ctrllimited = False  # of an effort; that of positions includes the damping
        spec.add_sensor(
            name=motor.name, type=mj.mjtSensor.mjSENS_JOINTPOS, objname=motor.name,
            objtype=mj.mjtObj.mjOBJ_JOINT)
    return spec


def by_identify(servos: Servos, recording: Recording) -> Model:
    """Identify with the functions of `ros2 dynamics identify --train-fraction 1`."""
    begun = time.perf_counter()
    case = servos.case
    series, sent = recording.series(case.arm.joint_names)
    series, delay = drive_effort(series, sent, case.arm, servos.stiffness)
    models = identify(case.arm, [filter_motion(series)], 1.0).models
    arm = arm_from_parameters(
        fitted_urdf(case.urdf, case.arm, models.consistent),
        parameter_values(case.arm, models.consistent))
    seconds = time.perf_counter() - begun
    return Model(spec_of(arm, servos.stiffness).compile(), delay, seconds)


def by_sysid(servos: Servos, recording: Recording, with_masses: bool) -> Model:
    """Fit the parameters of MuJoCo's model to the simulated positions."""
    sysid = importlib.import_module('mujoco.sysid')
    begun = time.perf_counter()
    case, params = servos.case, sysid.ParameterDict()
    spec = spec_of(case.arm, servos.stiffness)

    def add(name: str, start: float, bounds: tuple[float, float], modifier: Any = None) -> None:
        params.add(sysid.Parameter(name, start, start * bounds[0], start * bounds[1],
                                   modifier=modifier))

    for name, k_p, limit in zip(case.arm.joint_names, servos.stiffness, case.limit):
        for field, start in (
                ('armature', 0.002 * limit), ('frictionloss', 0.02 * limit),
                ('damping', 0.1 * k_p)):
            add(f'{name}_{field}', start, (0.02, 20.0), lambda s, p, n=name, f=field: setattr(
                s.joint(n), f, [p.value[0], 0.0, 0.0] if f == 'damping' else p.value[0]))
        add(f'{name}_stiffness', k_p, (0.5, 2.0), lambda s, p, n=name: sysid.apply_pgain(
            s, n, p.value[0]))
    if with_masses:
        for body in spec.bodies[1:]:
            params.add(sysid.body_inertia_param(
                spec, spec.compile(), body.name, sysid.InertiaType.MassIpos))
    add('delay', 0.01, (0.0, 10.0))
    transform = sysid.SignalTransform()
    transform.delay('*', params['delay'])
    model = spec.compile()
    control = recording.held(MUJOCO_STEP, 0.0)
    residual = sysid.build_residual_fn(
        models_sequences=[sysid.ModelSequences(
            'arm', spec, 'teleoperation',
            sysid.create_initial_state(model, recording.position[0], np.zeros(case.n), None),
            sysid.TimeSeries(MUJOCO_STEP * np.arange(len(control)), control),
            sysid.TimeSeries.from_names(recording.times, recording.position, model))],
        modify_residual=transform.apply)
    with redirect_stdout(io.StringIO()):  # a line per iteration
        found, _ = sysid.optimize(params, residual, verbose=False, x_scale='jac')
    seconds = time.perf_counter() - begun
    return Model(sysid.apply_param_modifiers(found, spec), found['delay'].value[0], seconds)


def _figures(model: Model, motions: Sequence[Recording]) -> str:
    errors = [model.errors(each) for each in motions]
    all_, rests = (1e3 * np.sqrt(np.mean(np.concatenate(part)**2)) for part in zip(*errors))
    return f'{all_:.1f} | {rests:.1f} | {1e3 * model.delay:.0f} | {model.seconds:.1f}'


def main(argv: Sequence[str] = ()) -> None:
    """Print a line per arm and method."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--arms', type=int, nargs=2, default=(0, 6), metavar=('FIRST', 'COUNT'))
    parser.add_argument('--masses', action='store_true')
    arguments = parser.parse_args(argv)
    first, count = arguments.arms
    print('| arm | method | error [mrad] | at rest [mrad] | delay [ms] | fit [s] |\n'
          '| --- | --- | --- | --- | --- | --- |')
    for seed in range(first, first + count):
        servos = Servos(seed)
        recording, motions = servos.teleoperation(), servos.unseen()
        arm = f'{seed}: {servos.case.n} joints, {servos.bits} bit, {servos.rate:.0f} Hz'
        for method, model in (
                ('identify', by_identify(servos, recording)),
                ('mujoco.sysid', by_sysid(servos, recording, False)),
                *([('mujoco.sysid, masses', by_sysid(servos, recording, True))]
                  if arguments.masses else [])):
            print(f'| {arm} | {method} | {_figures(model, motions)} |', flush=True)


if __name__ == '__main__':
    main(sys.argv[1:])
