# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Kinematics and dynamics of a point of a link, computed by Pinocchio."""

import numpy as np
import numpy.typing as npt
import pinocchio as pin
from robot_dynamics.arrays import FloatArray
from robot_dynamics.exceptions import InvalidInputError
from robot_dynamics.model.arm import ArmModel
from robot_dynamics.task_space.state import TaskSpaceState
from robot_dynamics.validation import (
    check_choice,
    check_samples,
    check_vector,
    is_empty,
    LARGEST_VALUE,
)

REFERENCES = ('base_aligned', 'local')
"""Axes of velocities and forces at the point: those of the base frame, or those of the link."""


class TaskSpace:
    """
    The task space of a point that is fixed to a link of an arm.

    `frame` is the link, and `point` (3,) [m] is given in its frame, by default its origin. The
    velocity v = J q̇ is that of the point and the angular velocity of the link, both along the
    axes of the base frame (`base_aligned`) or of the link (`local`). With `local`, v̇ and J̇ are
    derivatives of these components, v̇ = Rᵀ ẍ − ω × v; there is no such term with `base_aligned`.

    For one thread, because of Pinocchio's scratch memory; returned arrays are new.
    """

    def __init__(
        self, arm: ArmModel, frame: str, point: npt.ArrayLike = (0.0, 0.0, 0.0),
        reference: str = 'base_aligned',
    ) -> None:
        """Raise InvalidInputError for an unknown link or reference, or an invalid point."""
        link = arm.link_frame(frame, 'frame')
        offset = check_vector('point', point, 3, ('x', 'y', 'z'), LARGEST_VALUE)
        self.arm, self.frame, self.point = arm, frame, offset
        self.reference = check_choice('reference', reference, REFERENCES)
        self._axes = pin.LOCAL if reference == 'local' else pin.LOCAL_WORLD_ALIGNED
        self._model = arm.pinocchio_model.copy()
        self._id = self._model.addFrame(pin.Frame(
            f'{frame} {offset.tolist()}', link.parentJoint, link.parentFrame,
            link.placement * pin.SE3(np.eye(3), offset), pin.FrameType.OP_FRAME))
        self._data = self._model.createData()
        self._zero = np.zeros(self._model.nv)

    def __repr__(self) -> str:
        return (f'<TaskSpace of {self.frame!r} at {self.point.tolist()}, {self.reference}, '
                f'of {self.arm!r}>')

    def at(self, q: npt.ArrayLike, v: npt.ArrayLike = ()) -> TaskSpaceState:
        """
        Return task space at one state: q (n,) [rad] or [m], v = q̇ (n,), zero if it is empty.

        Raises InvalidInputError for another length, or a value that is not finite.
        """
        n, names = self.arm.joint_count, self.arm.joint_names
        position = check_vector('position', q, n, names, LARGEST_VALUE)
        velocity = np.zeros(n) if is_empty(v) else check_vector(
            'velocity', v, n, names, LARGEST_VALUE)
        limits = self.arm.limits
        return TaskSpaceState(
            position.copy(), limits.lower, limits.upper, *self._terms(position, velocity))

    def batch(self, q: npt.ArrayLike, v: npt.ArrayLike = ()) -> TaskSpaceState:
        """
        Return task space at many states, (samples, n) each; quantities have a leading axis.

        Raises InvalidInputError as `at` does, and for another number of samples of v.
        """
        n, names = self.arm.joint_count, self.arm.joint_names
        position = check_samples('position', q, n, names, LARGEST_VALUE)
        velocity = np.zeros_like(position) if is_empty(v) else check_samples(
            'velocity', v, n, names, LARGEST_VALUE)
        if len(velocity) != len(position):
            raise InvalidInputError(
                f'velocity has {len(velocity)} samples, expected {len(position)} as position '
                'has, or none')
        return self.unchecked_batch(position, velocity)

    def unchecked_batch(self, q: FloatArray, v: FloatArray) -> TaskSpaceState:
        """Return the states of `batch` for finite float64 arrays (samples, n)."""
        samples, n = q.shape
        shapes = (3,), (3, 3), (6, n), (6,), (n, n), (n,), (n,)
        terms = [np.empty((samples, *shape)) for shape in shapes]
        for i in range(samples):
            for array, value in zip(terms, self._terms(q[i], v[i])):
                array[i] = value
        limits = self.arm.limits
        return TaskSpaceState(q.copy(), limits.lower, limits.upper, *terms)

    def _terms(self, q: FloatArray, v: FloatArray) -> tuple[FloatArray, ...]:
        """Return pose, J, J̇ q̇, M, g and C q̇ at one state."""
        model, data, x = self._model, self._data, self.arm.coordinates
        q_tree, v_tree = x.position(q), x.rate(v)
        pin.computeAllTerms(model, data, q_tree, v_tree)
        J = pin.getFrameJacobian(model, data, self._id, self._axes)
        M, gravity = data.M, data.g.copy()
        coriolis = data.nle - gravity if v.any() else np.zeros_like(gravity)
        pin.forwardKinematics(model, data, q_tree, v_tree, self._zero)
        pose = pin.updateFramePlacement(model, data, self._id)
        # the derivative of the components of v: spatial in moving axes, else classical
        acceleration = (pin.getFrameAcceleration if self.reference == 'local' else
                        pin.getFrameClassicalAcceleration)
        bias = acceleration(model, data, self._id, self._axes).vector
        return (
            pose.translation.copy(), pose.rotation.copy(), x.jacobian(J), bias,
            np.array(x.form(M)), x.effort(gravity), x.effort(coriolis))
