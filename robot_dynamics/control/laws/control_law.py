# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""
The interface of control laws, and the simplest law: gravity compensation.

A law states its effort and its closed loop, its parameters and its topics. Everything else is
common to all laws and is done by the controller: scaling of the gains, effort limits, efforts that
the robot adds on its own, references, stops, faults.
"""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NamedTuple

import numpy as np
from robot_dynamics.arrays import FloatArray
from robot_dynamics.control.laws.error_feedback import ErrorFeedback, Tracking
from robot_dynamics.control.options import ControllerOptions, LawOptions
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.model.arm_dynamics import UncheckedArmDynamics
from robot_dynamics.references.active_trajectory import ActiveTrajectory
from robot_dynamics.trajectories.interpolation import Reference
from robot_dynamics.validation import check_per_joint, check_scalar, is_empty, LARGEST_VALUE


class LawParameter(NamedTuple):
    """
    A parameter of a law, by the name that it has at the node.

    `default` is a text, a number, or the numbers of an array. An array has one value for all
    `entries`, by default the joints, or one per entry; an empty one is the default. `minimum` and
    `maximum` apply to each number.
    """

    name: str
    default: str | float | tuple[float, ...]
    description: str
    minimum: float = 0.0
    maximum: float = LARGEST_VALUE
    entries: tuple[str, ...] = ()

    @property
    def is_per_joint(self) -> bool:
        """Whether the parameter has one value per joint."""
        return isinstance(self.default, tuple) and not self.entries

    def checked(self, value: Any, joint_names: Sequence[str]) -> Any:
        """
        Return a text, a number, or an array with one value per entry, None if it has no default.

        Raises InvalidInputError, which names the parameter, for an invalid value.
        """
        if isinstance(self.default, str):
            return value
        if not isinstance(self.default, tuple):
            return check_scalar(self.name, value, self.minimum, self.maximum)
        value = self.default if is_empty(value) else value
        if is_empty(value):
            return None
        entries = self.entries or joint_names
        values = check_per_joint(self.name, value, entries)
        for entry, one in zip(entries, values):
            check_scalar(f'{self.name} of {entry!r}', one, self.minimum, self.maximum)
        return values


class LawTopic(NamedTuple):
    """
    A topic to which the node subscribes for a law, such as `~/force_feedback`.

    `message_type` is a name such as `sensor_msgs/msg/JointState`; `take` gets each message.
    """

    name: str
    message_type: str
    take: Callable[[Any, Any], Any]


class LawInput(NamedTuple):
    """
    The input of a law; arrays are (n,), in the order of the joints.

    `q` [rad] or [m] and `v` [rad/s] or [m/s] are those of the gate at `stamp_ns`.
    `q_ahead` is the position half a period of the states later, when the effort acts; it is `q`
    itself if the difference does not matter. `trajectory` is the reference to follow, or None.
    """

    dynamics: UncheckedArmDynamics
    stamp_ns: int
    q: FloatArray
    v: FloatArray
    q_ahead: FloatArray
    trajectory: ActiveTrajectory | None
    feedback: ErrorFeedback

    @property
    def gravity(self) -> FloatArray:
        """The gravity-compensation torque g(q) [N·m] or [N]."""
        return self.dynamics.rigid_body.gravity(self.q)

    @property
    def reference(self) -> Reference:
        """Position, velocity and acceleration of the reference; raise ValueError without one."""
        if self.trajectory is None:
            raise ValueError('a law that follows needs a reference')
        return self.trajectory.sample(self.stamp_ns)

    @property
    def position_error(self) -> FloatArray:
        """Reference minus measured position; of continuous joints the shortest distance."""
        return self.feedback.position_error(self.reference.position, self.q)

    @property
    def velocity_error(self) -> FloatArray:
        """Reference minus measured velocity."""
        return np.asarray(self.reference.velocity - self.v)


class LawOutput(NamedTuple):
    """
    An effort (n,) [N·m] or [N] before any limit.

    `friction` (n,) is the part of `effort` that compensates friction. `tracking` has the errors
    along a reference. `gravity` (n,) is g(q) if the law has computed it. `scale` is the smallest
    factor by which the law itself has scaled its gains down.
    """

    effort: FloatArray
    friction: FloatArray
    tracking: Tracking | None = None
    gravity: FloatArray | None = None
    scale: float = 1.0


class ControlLaw:
    """
    A law τ(q, q̇, reference); a subclass defines `effort` and, with feedback, `closed_loop`.

    A law that follows references is used while a reference is active; otherwise the controller
    uses gravity compensation. A law that does not follow references is used without a reference,
    for the reference of `~/stop` the controller uses computed torque.
    """

    follows: ClassVar[bool] = True
    """Whether the law follows references."""
    PARAMETERS: ClassVar[tuple[LawParameter, ...]] = ()
    """Parameters that the node declares for the law; a new value makes a new law."""
    TOPICS: ClassVar[tuple[LawTopic, ...]] = ()
    """Topics whose messages `take(law, message)` gets between two states, while it is in use."""
    REFERENCES: ClassVar[tuple[LawTopic, ...]] = ()
    """Topics of which `take(controller, message)` returns the trajectory that the node follows."""
    scale: FloatArray | float = 1.0
    """Factors s (n,) of the bandwidth, set by the controller: stiffness s² K, damping s D."""

    def __init__(self, *_: object) -> None:
        """Take the `ErrorFeedback` of the controller and the `LawOptions` of the class."""

    @classmethod
    def options(cls, arm: ArmModel, options: ControllerOptions) -> LawOptions:
        """
        Return the options for an arm with which the law is made.

        Raises InvalidInputError for a wrong value of a parameter.
        """
        given = options.parameters
        values = {
            one.name: one.checked(given.get(one.name, one.default), arm.joint_names)
            for one in cls.PARAMETERS}
        return LawOptions(**{**vars(options), 'parameters': values, 'arm': arm})

    def effort(self, state: LawInput) -> FloatArray:
        """Return the effort (n,) [N·m] or [N] for a state; multiply gains by s² and s."""
        raise NotImplementedError

    def closed_loop(self, M: FloatArray) -> tuple[FloatArray, FloatArray]:
        """
        Return M⁻¹ K [1/s²] and M⁻¹ D [1/s], (n, n) each, of the unscaled law at M(q) (n, n).

        K and D are the efforts per error of position and velocity. Without feedback they are 0.
        """
        return np.zeros_like(M), np.zeros_like(M)

    def stiffness(self, M: FloatArray) -> FloatArray:
        """Return the scaled efforts per position error of their joint, (n,) [N·m/rad] or [N/m]."""
        return np.asarray(self.scale**2 * np.diagonal(M @ self.closed_loop(M)[0]))

    def scale_gains(self, scale: FloatArray) -> None:
        """Scale the bandwidth by these factors (n,) in (0, 1] from now on."""
        self.scale = scale

    def limit_rate(self, effort_rate: FloatArray, inertia: FloatArray) -> None:
        """
        Take the rate limit of the effort, which a law may regard for large errors.

        `effort_rate` (n,) [N·m/s] or [N/s] is infinite if there is no limit; `inertia` (n,) are
        the largest sums of the rows of |M(q)|.
        """
        return

    def __call__(self, state: LawInput) -> LawOutput:
        """Return the effort for a state with its parts."""
        effort, trajectory = self.effort(state), state.trajectory
        return LawOutput(effort, np.zeros_like(effort), None if trajectory is None else (
            state.feedback.track(trajectory, state.stamp_ns, state.q, state.v)))


class GravityCompensation(ControlLaw):
    """The law τ = g(q)."""

    follows = False

    def __init__(self, feedback: ErrorFeedback, options: ControllerOptions) -> None:
        self._zero = np.zeros(len(feedback.gains.kp))
        self._zero.setflags(write=False)

    def __call__(self, state: LawInput) -> LawOutput:
        """Return g(q)."""
        gravity = state.gravity
        return LawOutput(gravity, self._zero, gravity=gravity)
