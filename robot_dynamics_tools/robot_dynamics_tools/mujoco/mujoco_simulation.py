# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
An arm in MuJoCo: the model of an MJCF, driven by joint efforts, with its contacts.

The efforts act as `qfrc_applied`. Actuators of the MJCF that act on a driven joint are switched
off, because their forces would add to the efforts. All other actuators remain, at the control of
the first keyframe or 0, so that a gripper holds its position.
Source: MuJoCo's documentation, chapters "Computation" and "XML reference".
"""

from collections.abc import Sequence
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from robot_dynamics.arrays import FloatArray, IntArray
from robot_dynamics.dependencies import optional
from robot_dynamics.exceptions import InvalidInputError, ModelError
from robot_dynamics.model.external_wrench import ExternalWrench
from robot_dynamics.simulation.arm_simulation import ArmState, check_released
from robot_dynamics.simulation.plant import InnerController
from robot_dynamics.validation import check_unique, check_vector

BRAKE_INERTIA = 1e6
"""[kg·m²] or [kg] of a braked joint: contacts of a braked arm are those of a fixed body."""


def load_mjcf(path: str | Path) -> Any:
    """
    Return the `mujoco.MjModel` of an MJCF file.

    Raises ModelError if the file cannot be compiled, MissingDependencyError without MuJoCo.
    """
    if not Path(path).is_file():
        raise ModelError(f'mjcf is {str(path)!r}, which is no such file; expected an MJCF file')
    return _compiled('path', str(path), f'mjcf: MuJoCo rejects {str(path)!r}')


def model_of_mjcf(xml: str) -> Any:
    """Return the `mujoco.MjModel` of an MJCF without other files; raise as `load_mjcf` does."""
    return _compiled('string', xml, 'MuJoCo rejects the MJCF')


def _compiled(source: str, text: str, rejection: str) -> Any:
    mujoco = _mujoco()
    try:
        return getattr(mujoco.MjModel, f'from_xml_{source}')(text)
    except (ValueError, mujoco.FatalError) as error:
        raise ModelError(f'{rejection}: {error}') from None


def _mujoco() -> Any:
    mujoco = optional('mujoco', "an arm in MuJoCo (the extra 'mujoco')")
    mujoco.set_mju_user_warning(lambda _: None)  # otherwise each one is written to a log file
    return mujoco


class MujocoArm(NamedTuple):
    """The driven joints (n) of a model, their effort limits (n,), may be infinite, and gravity."""

    name: str
    joint_names: tuple[str, ...]
    joint_kinds: tuple[str, ...]
    effort_limit: FloatArray
    gravity: FloatArray


class MujocoSimulation:
    """
    An arm in MuJoCo with the interface of `ArmSimulation`: its brakes hold it until `release`.

    All arrays are (n,) in the order of `arm.joint_names`. `model` and `data` are those of MuJoCo.
    """

    def __init__(
        self, model: Any, joints: Sequence[str] = (), names: Sequence[str] = (),
        position: npt.ArrayLike | None = None,
    ) -> None:
        """
        Drive these joints of the MJCF, by default those that an actuator drives directly.

        Without such actuators, all hinge and slide joints are driven. `names` are other names for
        the joints. The arm starts at `position`, by default that of the first keyframe; without
        one, the reference pose or the limit nearest to it. Raises InvalidInputError.
        """
        self._mj = _mujoco()
        self.model, self.data = model, self._mj.MjData(model)
        self._timestep = float(model.opt.timestep)
        ids = self._selected(joints)
        own = tuple(model.joint(i).name for i in ids)
        if names and len(names) != len(own):
            raise InvalidInputError(
                f'joints has {len(names)} names, expected {len(own)}, one for each of {own}')
        self._q, self._v = model.jnt_qposadr[ids], model.jnt_dofadr[ids]
        slides = model.jnt_type[ids] == int(self._mj.mjtJoint.mjJNT_SLIDE)
        name = bytes(model.names[:]).split(b'\0', 1)[0].decode(errors='replace')
        self.arm = MujocoArm(
            name, tuple(names) or own,
            tuple('prismatic' if slide else 'revolute' for slide in slides),
            self._effort_limits(ids), model.opt.gravity.copy())
        actuators = self._actuators_of(ids)  # are switched off
        model.actuator_gaintype[actuators] = int(self._mj.mjtGain.mjGAIN_FIXED)
        model.actuator_biastype[actuators] = int(self._mj.mjtBias.mjBIAS_NONE)
        model.actuator_gainprm[actuators] = 0.0
        self._armature = model.dof_armature[self._v]
        self._home = self._initial(ids, position)
        self.reset()

    # ------------------------------------------------------------------ joints and actuators

    def _selected(self, joints: Sequence[str]) -> IntArray:
        """Return the numbers of the driven joints."""
        model, kinds = self.model, self._mj.mjtJoint
        movable = np.flatnonzero(
            np.isin(model.jnt_type, [int(kinds.mjJNT_HINGE), int(kinds.mjJNT_SLIDE)]))
        by_name = {model.joint(i).name: i for i in movable}
        if not joints:
            driven = [i for i in movable if len(self._actuators_of(int(i)))]
            joints = [model.joint(i).name for i in driven or movable]
        if not joints:
            raise InvalidInputError('the MJCF has no hinge or slide joint, expected at least one')
        check_unique('mjcf_joints', joints)
        for k, name in enumerate(joints):
            if not name or name not in by_name:
                raise InvalidInputError(
                    f'mjcf_joints[{k}] is {name!r}, expected the name of a hinge or slide joint '
                    f'of the MJCF: {list(by_name)}')
        return np.array([by_name[name] for name in joints])

    def _actuators_of(self, joints: IntArray | int) -> IntArray:
        """Return the numbers of the actuators that act on these joints directly."""
        model, kinds = self.model, self._mj.mjtTrn
        acts = np.isin(
            model.actuator_trntype, [int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT)])
        return np.flatnonzero(acts & np.isin(model.actuator_trnid[:, 0], joints))

    def _effort_limits(self, joints: IntArray) -> FloatArray:
        """Return the largest efforts, of `actuatorfrcrange` or of the actuators of the joint."""
        model = self.model
        limits = np.full(len(joints), math.inf)
        for k, j in enumerate(joints):
            actuators = self._actuators_of(j)
            if model.jnt_actfrclimited[j]:
                limits[k] = np.abs(model.jnt_actfrcrange[j]).max()
            elif len(actuators):
                limits[k] = sum(map(self._force_limit, actuators))
        return limits

    def _force_limit(self, actuator: int) -> float:
        model = self.model
        gear = float(abs(model.actuator_gear[actuator, 0]))
        if model.actuator_forcelimited[actuator]:
            return gear * float(np.abs(model.actuator_forcerange[actuator]).max())
        is_motor = not model.actuator_biastype[actuator] and not model.actuator_gaintype[actuator]
        if is_motor and model.actuator_ctrllimited[actuator]:
            gain = abs(float(model.actuator_gainprm[actuator, 0]))
            return gear * gain * float(np.abs(model.actuator_ctrlrange[actuator]).max())
        return math.inf

    def _initial(self, joints: IntArray, position: npt.ArrayLike | None) -> FloatArray:
        model = self.model
        if position is not None:
            return check_vector('initial_position', position, len(joints), self.arm.joint_names)
        if model.nkey:
            return np.array(model.key_qpos[0][self._q])
        low, high = np.where(
            model.jnt_limited[joints, None], model.jnt_range[joints], [-math.inf, math.inf]).T
        return np.asarray(np.clip(model.qpos0[self._q], low, high))

    # ------------------------------------------------------------------ interface of a simulation

    @property
    def state(self) -> ArmState:
        return ArmState(self.data.qpos[self._q], self.data.qvel[self._v])

    @property
    def motor_state(self) -> ArmState:
        """The state of the joints, as the drives have no backlash."""
        return self.state

    def reset(self) -> None:
        """Return to the initial state with engaged brakes, other bodies too."""
        if self.model.nkey:
            self._mj.mj_resetDataKeyframe(self.model, self.data, 0)
        else:
            self._mj.mj_resetData(self.model, self.data)
        self.data.qpos[self._q], self.data.qvel[self._v] = self._home, 0.0
        self._hold()
        self._mj.mj_forward(self.model, self.data)

    def release(self) -> None:
        """Release the brakes."""
        self.braked = False
        self.model.dof_armature[self._v] = self._armature

    def brake(self) -> None:
        """Engage the brakes: the driven joints stop at once; all other joints move on."""
        self.data.qvel[self._v] = 0.0
        self._hold()

    def _hold(self) -> None:
        self.braked = True
        self.model.dof_armature[self._v] = BRAKE_INERTIA
        self.effort = np.zeros(len(self._v))

    def set_gravity(self, gravity: FloatArray) -> None:
        """Change gravity (3,) [m/s²] at once."""
        self.model.opt.gravity[:] = gravity
        self.arm = self.arm._replace(gravity=gravity.copy())

    def check_body(self, name: str, field: str) -> None:
        """Raise InvalidInputError, which names `field`, if there is no such body."""
        bodies = [self.model.body(i).name for i in range(self.model.nbody)]
        if name not in bodies:
            raise InvalidInputError(f'{field} is {name!r}, expected a body of the MJCF: {bodies}')

    def step(
        self, tau: FloatArray, duration: float, wrenches: Sequence[ExternalWrench] = (),
    ) -> ArmState:
        """
        Return the state after `duration` [s] under the constant effort tau.

        Wrenches act on bodies, by name. The time step is that of the MJCF or the next smaller
        one of which `duration` is a multiple. Raises InvalidInputError if the brakes are engaged,
        and if the motion diverges.
        """
        check_released(self.braked)
        self.effort = tau
        self.wait(duration, wrenches)
        return self.state

    def wait(self, duration: float, wrenches: Sequence[ExternalWrench] = ()) -> None:
        """Let `duration` [s] pass; engaged brakes hold the driven joints, other bodies move."""
        model, data = self.model, self.data
        steps = max(1, math.ceil(duration / self._timestep - 1e-9))
        model.opt.timestep = duration / steps
        q = data.qpos[self._q]
        unstable = self._warnings()
        for _ in range(steps):
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[self._v] = self.effort
            self._push(wrenches)
            self._mj.mj_step(model, data)
            if self.braked:
                data.qpos[self._q], data.qvel[self._v] = q, 0.0
        if self._warnings() > unstable or not np.isfinite(data.qvel).all():
            raise InvalidInputError(
                f'the motion from position {q.tolist()} diverges in MuJoCo, expected efforts that '
                'the arm can bear, or a smaller timestep in the MJCF')

    def _push(self, wrenches: Sequence[ExternalWrench]) -> None:
        model, data = self.model, self.data
        for wrench in wrenches:
            body = model.body(wrench.link).id
            R = data.xmat[body].reshape(3, 3)
            self._mj.mj_applyFT(
                model, data, R @ wrench.force, R @ wrench.torque, data.xpos[body], body,
                data.qfrc_applied)

    def _warnings(self) -> int:
        """Return how often MuJoCo has found the simulation unstable."""
        kinds = self._mj.mjtWarning
        return sum(int(self.data.warning[int(kind)].number) for kind in (
            kinds.mjWARN_BADQPOS, kinds.mjWARN_BADQVEL, kinds.mjWARN_BADQACC))


class DirectDrives(InnerController):
    """Drives that deliver the commanded effort at the joints, and measure it."""

    def __init__(self, joint_count: int) -> None:
        self.idle_effort = np.zeros(joint_count)

    def set_gravity(self, gravity: FloatArray) -> None:
        """Do nothing: these drives compensate no gravity."""

    def with_own_compensation(
        self, effort: FloatArray, q: FloatArray, v: FloatArray,
    ) -> FloatArray:
        """Return the torque at the joints for a commanded effort, both (n,)."""
        return effort

    def measured(
        self, effort: FloatArray, q: FloatArray, v: FloatArray, braked: bool,
    ) -> FloatArray:
        """Return the effort that the robot reports, (n,)."""
        return effort
